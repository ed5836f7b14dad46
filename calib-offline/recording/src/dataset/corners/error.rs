//! What can be wrong with `corners.csv`, where, and what to do about it.

use super::header::{
    Columns, HEADER, HEADER_WITH_SIGMA, POINTS_HEADER, POINTS_HEADER_WITH_SIGMA,
    POINTS_HEADER_WITH_SIGMAS,
};
use crate::dataset::{BoardKind, Dataset};
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::remedy::Remedy;
use std::path::PathBuf;

/// Why `corners.csv` was not accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CornersError {
    /// The system refused to read it.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is not text.
    #[error("{}:{line}: is not text (no UTF-8)", file.display())]
    NotText {
        /// The file.
        file: PathBuf,
        /// From 1: the first line that is not UTF-8.
        line: usize,
    },
    /// It holds nothing, or only a header.
    #[error("{}:{line}: there are no corners in it", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
        /// From 1: the last line.
        line: usize,
    },
    /// The first line is not the header.
    #[error("{}:1: the header is \"{found}\", it must be {}", file.display(), headers(kind))]
    Header {
        /// The file.
        file: PathBuf,
        /// What stands there, shortened.
        found: String,
        /// What the target is.
        kind: Box<BoardKind>,
    },
    /// Too few or too many fields.
    #[error("{}:{line}: has {have} fields, the header has {need}", file.display())]
    FieldCount {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// Fields.
        have: usize,
        /// Columns.
        need: usize,
    },
    /// A field that is no number, or no count.
    #[error("{}:{line}: {column} is \"{text}\", it must be a {expected}", file.display())]
    Number {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The column.
        column: &'static str,
        /// The field, shortened.
        text: String,
        /// What it must be.
        expected: &'static str,
    },
    /// A camera that the manifest does not know.
    #[error("{}:{line}: camera \"{camera}\" is not in {}, which has {}", file.display(), Dataset::MANIFEST, known.join(", "))]
    UnknownCamera {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The name.
        camera: String,
        /// The manifest's names.
        known: Vec<String>,
    },
    /// A corner that the board does not have.
    #[error("{}:{line}: row {row}, col {col} is not on the board of {rows} rows and {cols} cols (the largest in the file are row {largest_row}, col {largest_col}, counted from 0)", file.display())]
    OutOfBoard {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The row.
        row: usize,
        /// The column.
        col: usize,
        /// Rows of the board.
        rows: usize,
        /// Columns of the board.
        cols: usize,
        /// Largest row in the file.
        largest_row: usize,
        /// Largest column in the file.
        largest_col: usize,
    },
    /// A pixel that is not a number or infinite.
    #[error("{}:{line}: {column} is {value}; a {} must be a finite number", file.display(), if column.ends_with("_mm") { "place" } else { "pixel" })]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// `u`, `v`, or a coordinate.
        column: &'static str,
        /// The value.
        value: f64,
    },
    /// A place farther away than anything that is measured.
    #[error("{}:{line}: {column} is {value:e}; a place is no farther than {most_mm:e} mm from the origin", file.display())]
    FarPlace {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The coordinate.
        column: &'static str,
        /// The value.
        value: f64,
        /// The most, mm.
        most_mm: f64,
    },
    /// A pixel off the sensor.
    #[error("{}:{line}: the pixel ({}, {}) lies outside camera \"{camera}\" of {sensor} pixels; its corners reach from ({}, {}) to ({}, {}): the image size in {} does not fit the corners", file.display(), pixel.u, pixel.v, least.u, least.v, most.u, most.v, Dataset::MANIFEST)]
    OutsideImage {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The camera.
        camera: String,
        /// Its size.
        sensor: SensorSize,
        /// The pixel.
        pixel: PixelPoint,
        /// Smallest u and v of the camera's corners.
        least: PixelPoint,
        /// Largest u and v of the camera's corners.
        most: PixelPoint,
    },
    /// A noise that is none.
    #[error("{}:{line}: {column} is {value}; it must be above 0, or empty if it is not known", file.display())]
    Sigma {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The column.
        column: &'static str,
        /// The value.
        value: f64,
    },
    /// One corner twice in one view.
    #[error("{}:{line}: camera \"{camera}\", pose {pose}, {label} stands already in line {first_line}", file.display())]
    Duplicate {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// Line of the first one.
        first_line: usize,
        /// The camera.
        camera: String,
        /// The pose.
        pose: usize,
        /// What the corner is called there.
        label: String,
    },
    /// A place that the target does not have.
    #[error("{}:{line}: the point ({}, {}, {}) mm is none of the target's", file.display(), at_mm[0], at_mm[1], at_mm[2])]
    OtherPlace {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The place, mm.
        at_mm: [f64; 3],
    },
    /// A stage list whose length does not fit the poses.
    #[error("{}: [stage] {key} has {have} entries, and {} has {poses} poses numbered {first} to {last}", file.display(), Dataset::CORNERS)]
    StageLength {
        /// The manifest.
        file: PathBuf,
        /// The key.
        key: &'static str,
        /// Entries.
        have: usize,
        /// Poses in the corners.
        poses: usize,
        /// Smallest pose number.
        first: usize,
        /// Largest pose number.
        last: usize,
    },
}

/// The headers that a target's file may have, in words.
fn headers(kind: &BoardKind) -> String {
    match kind {
        BoardKind::Points => format!(
            "\"{POINTS_HEADER}\", \"{POINTS_HEADER_WITH_SIGMA}\" or \"{POINTS_HEADER_WITH_SIGMAS}\""
        ),
        _ => format!("\"{HEADER}\" or \"{HEADER_WITH_SIGMA}\""),
    }
}

/// A kind whose corners are labelled in the other way.
fn other_labels(kind: &BoardKind) -> BoardKind {
    match kind {
        BoardKind::Points => BoardKind::Chessboard,
        _ => BoardKind::Points,
    }
}

impl Remedy for CornersError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Read { .. } => "check the path and the permissions".to_owned(),
            Self::NotText { .. } => {
                "this is not a CSV file; restore it, or delete it and run calib-offline detect"
                    .to_owned()
            }
            Self::Empty { .. } => {
                "add corners, or delete the file and run calib-offline detect".to_owned()
            }
            Self::Header { found, .. } if found.contains([';', '\t']) => {
                "save the file with commas between the fields".to_owned()
            }
            Self::Header { found, kind, .. }
                if Columns::of(&found.replace(' ', ""), &other_labels(kind)).is_some() =>
            {
                let other = other_labels(kind);
                format!(
                    "the columns are those of [board] kind = \"{}\"",
                    other.word()
                )
            }
            Self::Header { .. } => "the first line names the columns, in this order".to_owned(),
            Self::FieldCount { .. } => {
                "each line has one corner; decimal points are points, not commas".to_owned()
            }
            Self::Number { .. } => {
                "correct the field; poses, rows and columns count from 0".to_owned()
            }
            Self::UnknownCamera { camera, known, .. } => {
                let meant = camera.parse().ok().and_then(|k: usize| known.get(k));
                let counted = meant.map_or(String::new(), |name| {
                    format!("cameras are called by their names, so {camera} may be {name}; ")
                });
                format!(
                    "{counted}correct the name, or describe the camera in a [[camera]] of dataset.toml"
                )
            }
            Self::OutOfBoard {
                rows,
                cols,
                largest_row,
                largest_col,
                ..
            } => {
                if largest_row < cols && largest_col < rows {
                    format!(
                        "rows and columns swapped? Every corner fits a board with rows = {cols}, cols = {rows}"
                    )
                } else {
                    format!(
                        "rows and cols of the manifest count inner corners; the file needs at least rows = {}, cols = {}",
                        largest_row + 1,
                        largest_col + 1
                    )
                }
            }
            Self::FarPlace { .. } => {
                "correct the coordinate, which is in millimeters, or take the origin nearer"
                    .to_owned()
            }
            Self::NotFinite { .. } => "leave out corners that were not seen".to_owned(),
            Self::OutsideImage {
                sensor,
                least,
                most,
                ..
            } => {
                let turned = SensorSize::new(sensor.height, sensor.width);
                if turned.contains(*least) && turned.contains(*most) {
                    "width and height swapped? Every corner fits the turned image".to_owned()
                } else {
                    "give the size of the images that the corners were found in as width and height; the center of the top-left pixel is (0, 0)".to_owned()
                }
            }
            Self::Sigma { .. } => "correct or empty the field".to_owned(),
            Self::OtherPlace { .. } => {
                "write the same coordinates in every line of one point".to_owned()
            }
            Self::Duplicate { .. } => "keep the better of the two lines".to_owned(),
            Self::StageLength { .. } => {
                "give one entry per pose, in the order of the pose numbers, or leave the key out"
                    .to_owned()
            }
        };
        Some(text)
    }
}
