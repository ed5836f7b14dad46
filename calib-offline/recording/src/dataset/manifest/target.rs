//! `[target]` and `target_images`: the measurement target, read as strictly as the rest.

use super::images::pattern_files;
use super::{
    MAX_CORNERS_PER_SIDE, MAX_SQUARE_MM, MIN_CORNERS_PER_SIDE, MIN_SQUARE_MM, ManifestError,
    RawCamera, Source, ranged,
};
use crate::dataset::Dataset;
use crate::dataset::target::{TargetSpec, TargetSymmetry};
use serde::Deserialize;
use std::path::PathBuf;
use toml::Spanned;

/// Large and small markers must differ by this factor at least, to be told apart in an image.
const MIN_RADIUS_RATIO: f64 = 1.1;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTarget {
    kind: Option<Spanned<String>>,
    rows: Option<Spanned<i64>>,
    cols: Option<Spanned<i64>>,
    pitch_mm: Option<Spanned<f64>>,
    outer_radius_mm: Option<Spanned<f64>>,
    direction_outer_radius_mm: Option<Spanned<f64>>,
    direction: Option<Spanned<Vec<Spanned<Vec<i64>>>>>,
}

/// What is wrong with the measurement target.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TargetProblem {
    /// A target that this program does not know.
    #[error("[target] kind = \"{kind}\" is not known")]
    Kind {
        /// The kind.
        kind: String,
    },
    /// No length.
    #[error("[target] {key} = {value} is no length between {MIN_SQUARE_MM} and {MAX_SQUARE_MM} mm")]
    Length {
        /// The key.
        key: &'static str,
        /// The value.
        value: f64,
    },
    /// Direction markers that are not clearly larger.
    #[error(
        "[target] direction_outer_radius_mm = {direction_mm} is not {MIN_RADIUS_RATIO} times \
         outer_radius_mm = {ordinary_mm} or more: the direction markers are the larger ones"
    )]
    NotLarger {
        /// Of a direction marker, mm.
        direction_mm: f64,
        /// Of an ordinary marker, mm.
        ordinary_mm: f64,
    },
    /// Markers that touch.
    #[error(
        "[target] direction_outer_radius_mm = {direction_mm}: neighboring markers would touch, their \
         centers are pitch_mm = {pitch_mm} apart"
    )]
    Touching {
        /// Of a direction marker, mm.
        direction_mm: f64,
        /// Of neighbors, mm.
        pitch_mm: f64,
    },
    /// A direction marker that is no row and column.
    #[error("[target] direction: an entry has {have} numbers; it must be [row, col]")]
    NoPlace {
        /// Numbers.
        have: usize,
    },
    /// A direction marker that the target does not have.
    #[error(
        "[target] direction: [{row}, {col}] is not on the target of {rows} rows and {cols} cols"
    )]
    OffTarget {
        /// The row.
        row: i64,
        /// The column.
        col: i64,
        /// Rows of the target.
        rows: usize,
        /// Columns of the target.
        cols: usize,
    },
    /// A direction marker twice.
    #[error("[target] direction names [{row}, {col}] twice")]
    DirectionTwice {
        /// The row.
        row: usize,
        /// The column.
        col: usize,
    },
    /// As many large markers as small ones.
    #[error("[target] direction names {have} of {markers} markers; it must be fewer than half")]
    TooManyDirections {
        /// Direction markers.
        have: usize,
        /// All markers.
        markers: usize,
    },
    /// Direction markers that do not tell the direction.
    #[error("[target] direction: the target looks the same {symmetry}")]
    Symmetric {
        /// How.
        symmetry: TargetSymmetry,
    },
    /// A target without images and without `markers.csv`.
    #[error(
        "[target]: no camera has target_images, and there is no {} beside the manifest",
        TargetSpec::MARKERS
    )]
    NothingToRead,
    /// Images of a target that is not described.
    #[error("target_images of camera \"{camera}\": there is no [target]")]
    NotDescribed {
        /// The camera.
        camera: String,
    },
    /// Cameras with different numbers of images of the target.
    #[error(
        "target_images: camera \"{first_camera}\" has {first_count} and camera \"{camera}\" has {count}"
    )]
    UnequalImages {
        /// First camera.
        first_camera: String,
        /// Its images.
        first_count: usize,
        /// Second camera.
        camera: String,
        /// Its images.
        count: usize,
    },
    /// One file for two views.
    #[error("target_images of camera \"{camera}\": {} is an image of another view too", image.display())]
    ImageUsedTwice {
        /// The camera.
        camera: String,
        /// The image.
        image: PathBuf,
    },
}

impl TargetProblem {
    /// What to do about it.
    pub(super) fn remedy(&self) -> &'static str {
        match self {
            Self::Kind { .. } => "write kind = \"rings\"",
            Self::Length { .. } => "give the length in mm, measured on the target",
            Self::NotLarger { .. } => "swap the two if they were mixed up",
            Self::Touching { .. } => "give radii, not diameters",
            Self::NoPlace { .. } | Self::OffTarget { .. } => {
                "write [row, col] of each, counted from 0"
            }
            Self::DirectionTwice { .. } => "name each larger marker once",
            Self::TooManyDirections { .. } => {
                "name the larger markers; the smaller ones must be the usual ones"
            }
            Self::Symmetric { .. } => {
                "name every larger marker; a target that looks the same after a turn or in a mirror cannot be numbered"
            }
            Self::NothingToRead => {
                "add target_images = \"target/left/*.png\" to the cameras, put markers.csv (camera,pose,row,col,u,v) into the folder, or take [target] out"
            }
            Self::NotDescribed { .. } => {
                "describe it: [target] with kind = \"rings\", rows, cols, pitch_mm, outer_radius_mm, direction_outer_radius_mm, direction"
            }
            Self::UnequalImages { .. } => {
                "images are matched by their order, one per pose: give every camera an image of each"
            }
            Self::ImageUsedTwice { .. } => {
                "each view needs its own image: check the patterns of the cameras"
            }
        }
    }
}

/// The target, if the manifest has one; the dataset has its cameras already.
pub(super) fn target(
    source: &Source,
    dataset: &Dataset,
    raw: Option<Spanned<RawTarget>>,
    cameras: &[Spanned<RawCamera>],
) -> Result<Option<TargetSpec>, ManifestError> {
    let Some(raw) = raw else {
        let stray = dataset
            .cameras
            .iter()
            .zip(cameras)
            .find_map(|(camera, raw)| Some((camera, raw.get_ref().target_images.as_ref()?)));
        return match stray {
            Some((camera, images)) => Err(source.problem(
                source.line_of(images),
                TargetProblem::NotDescribed {
                    camera: camera.name.clone(),
                },
            )),
            None => Ok(None),
        };
    };
    let line = source.line_of(&raw);
    let mut target = described(source, line, raw.into_inner())?;
    target.images = images(source, dataset, line, cameras)?;
    Ok(Some(target))
}

impl Source {
    fn problem(&self, line: usize, problem: TargetProblem) -> ManifestError {
        ManifestError::Target {
            file: self.file.clone(),
            line,
            problem,
        }
    }
}

/// The target without its images.
fn described(source: &Source, line: usize, raw: RawTarget) -> Result<TargetSpec, ManifestError> {
    let missing = |key| ManifestError::Missing {
        file: source.file.clone(),
        line,
        key,
    };
    if let Some(kind) = raw.kind
        && kind.get_ref() != "rings"
    {
        let line = source.line_of(&kind);
        let kind = kind.into_inner();
        return Err(source.problem(line, TargetProblem::Kind { kind }));
    }
    let count = |value, key| {
        let (least, most) = (MIN_CORNERS_PER_SIDE, MAX_CORNERS_PER_SIDE);
        ranged(source, line, value, key, least, most)
    };
    let rows = count(raw.rows, "[target] rows")? as usize;
    let cols = count(raw.cols, "[target] cols")? as usize;
    let length = |value: Option<Spanned<f64>>, key: &'static str, in_table: &'static str| {
        let value = value.ok_or_else(|| missing(in_table))?;
        let line = source.line_of(&value);
        let value = value.into_inner();
        if (MIN_SQUARE_MM..=MAX_SQUARE_MM).contains(&value) {
            Ok((value, line))
        } else {
            Err(source.problem(line, TargetProblem::Length { key, value }))
        }
    };
    let (pitch_mm, _) = length(raw.pitch_mm, "pitch_mm", "[target] pitch_mm")?;
    let (ordinary_mm, _) = length(
        raw.outer_radius_mm,
        "outer_radius_mm",
        "[target] outer_radius_mm",
    )?;
    let (direction_mm, direction_line) = length(
        raw.direction_outer_radius_mm,
        "direction_outer_radius_mm",
        "[target] direction_outer_radius_mm",
    )?;
    if direction_mm < MIN_RADIUS_RATIO * ordinary_mm {
        let problem = TargetProblem::NotLarger {
            direction_mm,
            ordinary_mm,
        };
        return Err(source.problem(direction_line, problem));
    }
    if 2.0 * direction_mm >= pitch_mm {
        let problem = TargetProblem::Touching {
            direction_mm,
            pitch_mm,
        };
        return Err(source.problem(direction_line, problem));
    }
    let direction = raw.direction.ok_or_else(|| missing("[target] direction"))?;
    let target = TargetSpec {
        rows,
        cols,
        pitch_mm,
        outer_radius_mm: ordinary_mm,
        direction_outer_radius_mm: direction_mm,
        direction: direction_markers(source, direction.get_ref(), rows, cols)?,
        images: Vec::new(),
    };
    let line = source.line_of(&direction);
    let (have, markers) = (target.direction.len(), target.marker_count());
    if 2 * have >= markers {
        let problem = TargetProblem::TooManyDirections { have, markers };
        return Err(source.problem(line, problem));
    }
    match target.symmetry() {
        Some(symmetry) => Err(source.problem(line, TargetProblem::Symmetric { symmetry })),
        None => Ok(target),
    }
}

fn direction_markers(
    source: &Source,
    raw: &[Spanned<Vec<i64>>],
    rows: usize,
    cols: usize,
) -> Result<Vec<(usize, usize)>, ManifestError> {
    let mut direction = Vec::with_capacity(raw.len());
    for place in raw {
        let line = source.line_of(place);
        let &[row, col] = place.get_ref().as_slice() else {
            let have = place.get_ref().len();
            return Err(source.problem(line, TargetProblem::NoPlace { have }));
        };
        let on_target = |value: i64, count: usize| {
            let value = usize::try_from(value).ok()?;
            (value < count).then_some(value)
        };
        let (Some(row), Some(col)) = (on_target(row, rows), on_target(col, cols)) else {
            let problem = TargetProblem::OffTarget {
                row,
                col,
                rows,
                cols,
            };
            return Err(source.problem(line, problem));
        };
        if direction.contains(&(row, col)) {
            return Err(source.problem(line, TargetProblem::DirectionTwice { row, col }));
        }
        direction.push((row, col));
    }
    Ok(direction)
}

/// The images of the target by camera.
fn images(
    source: &Source,
    dataset: &Dataset,
    target_line: usize,
    cameras: &[Spanned<RawCamera>],
) -> Result<Vec<Vec<PathBuf>>, ManifestError> {
    let has_markers = dataset.markers_path().exists();
    let mut seen: std::collections::BTreeSet<PathBuf> = dataset
        .cameras
        .iter()
        .flat_map(|camera| camera.images.iter().flatten().cloned())
        .collect();
    let mut images: Vec<Vec<PathBuf>> = Vec::with_capacity(cameras.len());
    // Name and count of the first camera that has any.
    let mut first: Option<(&str, usize)> = None;
    for (camera, raw) in dataset.cameras.iter().zip(cameras) {
        let Some(pattern) = &raw.get_ref().target_images else {
            images.push(Vec::new());
            continue;
        };
        let folder = &dataset.folder;
        let files = pattern_files(source, folder, "target_images", pattern, has_markers)?;
        let line = source.line_of(pattern);
        for image in &files {
            if !seen.insert(image.clone()) {
                let problem = TargetProblem::ImageUsedTwice {
                    camera: camera.name.clone(),
                    image: image.clone(),
                };
                return Err(source.problem(line, problem));
            }
        }
        match first {
            Some((first_camera, first_count)) if first_count != files.len() && !has_markers => {
                let problem = TargetProblem::UnequalImages {
                    first_camera: first_camera.to_owned(),
                    first_count,
                    camera: camera.name.clone(),
                    count: files.len(),
                };
                return Err(source.problem(line, problem));
            }
            Some(_) => {}
            None => first = Some((&camera.name, files.len())),
        }
        images.push(files);
    }
    if first.is_none() && !has_markers {
        return Err(source.problem(target_line, TargetProblem::NothingToRead));
    }
    Ok(images)
}

#[cfg(test)]
mod tests;
