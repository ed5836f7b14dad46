//! What can be wrong with `dataset.toml`, where, and what to do about it.

use super::board_problem::BoardProblem;
use super::limits::MAX_CAMERAS;
use super::target_problem::TargetProblem;
use crate::dataset::known_poses::KnownPosesError;
use crate::dataset::{BoardKind, CornersError, Dataset};
use calib_rays::remedy::Remedy;
use std::path::PathBuf;

/// Why `dataset.toml` was not accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ManifestError {
    /// There is no dataset at this place.
    #[error("{}: there is no {} here", path.display(), Dataset::MANIFEST)]
    NotFound {
        /// The place.
        path: PathBuf,
    },
    /// The system refused to read it.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The manifest.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is not text.
    #[error("{}: is not text (no UTF-8 from byte {byte} on)", file.display())]
    NotText {
        /// The manifest.
        file: PathBuf,
        /// The first byte that is not UTF-8.
        byte: usize,
    },
    /// Not TOML, a key that means nothing, or a value of the wrong kind.
    #[error("{}:{line}: {message}", file.display())]
    Syntax {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// What the TOML reader says of it.
        message: String,
    },
    /// A table or key without which there is no dataset.
    #[error("{}:{line}: {key} is missing", file.display())]
    Missing {
        /// The manifest.
        file: PathBuf,
        /// From 1: where the key belongs.
        line: usize,
        /// The key with its table, as in `[board] rows`.
        key: &'static str,
    },
    /// The square size is missing.
    #[error("{}:{line}: [board] square_mm is missing, and there is no default: the square size sets the scale of every result", file.display())]
    SquareSizeMissing {
        /// The manifest.
        file: PathBuf,
        /// From 1: where `[board]` begins.
        line: usize,
    },
    /// The square size is no length.
    #[error("{}:{line}: [board] square_mm = {value} is {problem}; the square size sets the scale of every result", file.display())]
    SquareSize {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The value.
        value: f64,
        /// In words: zero, negative, not a number, infinite, too small, too large.
        problem: &'static str,
    },
    /// A number that cannot be meant.
    #[error("{}:{line}: {key} = {value}; it must be from {least} to {most}", file.display())]
    OutOfRange {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The key with its table.
        key: &'static str,
        /// The value.
        value: i64,
        /// Smallest value accepted.
        least: i64,
        /// Largest value accepted.
        most: i64,
    },
    /// A board that this program does not know.
    #[error("{}:{line}: [board] kind = \"{kind}\" is not known", file.display())]
    BoardKind {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The kind.
        kind: String,
    },
    /// A printed target that cannot be meant.
    #[error("{}:{line}: {problem}", file.display())]
    Board {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// What is wrong.
        problem: BoardProblem,
    },
    /// A key that this kind of target does not take.
    #[error("{}:{line}: [board] {key} means nothing with kind = \"{kind}\"", file.display())]
    BoardKey {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// The kind.
        kind: &'static str,
    },
    /// A name that could not stand in a CSV header.
    #[error("{}:{line}: [[camera]] name = {name:?} cannot be used", file.display())]
    CameraName {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The name.
        name: String,
    },
    /// More cameras than a blob can hold.
    #[error("{}:{line}: there are {have} cameras; {} are possible", file.display(), MAX_CAMERAS)]
    TooManyCameras {
        /// The manifest.
        file: PathBuf,
        /// From 1: the first one too many.
        line: usize,
        /// Cameras.
        have: usize,
    },
    /// Two cameras with one name.
    #[error("{}:{line}: camera \"{name}\" was already described in line {first_line}", file.display())]
    DuplicateCamera {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The name.
        name: String,
        /// Line of the first one.
        first_line: usize,
    },
    /// `images` and `image_list` for one camera.
    #[error("{}:{line}: camera \"{camera}\" has both images and image_list", file.display())]
    ImagesTwice {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The camera.
        camera: String,
    },
    /// A pattern with `*` or `?` in its folder.
    #[error("{}:{line}: {key} = \"{pattern}\": * and ? may stand in the file name only, not in its folder", file.display())]
    PatternInFolder {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// The pattern.
        pattern: String,
    },
    /// The folder of a pattern cannot be read.
    #[error("{}:{line}: {key} = \"{pattern}\": the folder {} cannot be read", file.display(), folder.display())]
    ImageFolder {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// The pattern.
        pattern: String,
        /// The folder.
        folder: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A pattern that means no file.
    #[error("{}:{line}: {key} = \"{pattern}\" matches no file in {}", file.display(), folder.display())]
    NoMatch {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// The pattern.
        pattern: String,
        /// The folder searched.
        folder: PathBuf,
    },
    /// A listed image that is not there.
    #[error("{}:{line}: image_list of camera \"{camera}\": pose {pose} is \"{image}\", and there is no such file", file.display())]
    ListedImageMissing {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The camera.
        camera: String,
        /// The pose.
        pose: usize,
        /// The entry.
        image: String,
    },
    /// A list without any image.
    #[error("{}:{line}: image_list of camera \"{camera}\" names no image", file.display())]
    EmptyImageList {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The camera.
        camera: String,
    },
    /// One file for two views.
    #[error("{}:{line}: the image {} is used twice, for camera \"{first_camera}\" pose {first_pose} and for camera \"{camera}\" pose {pose}", file.display(), image.display())]
    ImageUsedTwice {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The image.
        image: PathBuf,
        /// First camera.
        first_camera: String,
        /// First pose.
        first_pose: usize,
        /// Second camera.
        camera: String,
        /// Second pose.
        pose: usize,
    },
    /// Cameras with different numbers of images.
    #[error("{}:{line}: camera \"{first_camera}\" has {first_count} images and camera \"{camera}\" has {count}", file.display())]
    UnequalImages {
        /// The manifest.
        file: PathBuf,
        /// From 1: the second camera.
        line: usize,
        /// First camera.
        first_camera: String,
        /// Its images.
        first_count: usize,
        /// Second camera.
        camera: String,
        /// Its images.
        count: usize,
    },
    /// A stage list whose length does not fit the images.
    #[error("{}:{line}: [stage] {key} has {have} entries, there are {need} poses", file.display())]
    StageLength {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// Entries.
        have: usize,
        /// Poses.
        need: usize,
    },
    /// A dial reading that is not a number.
    #[error("{}:{line}: [stage] angles_deg: entry {index} is {value}", file.display())]
    StageAngle {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// From 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// A pose left out that does not exist.
    #[error("{}:{line}: [dataset] exclude names pose {pose}, the images are poses 0 to {last}", file.display())]
    ExcludedUnknown {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The pose.
        pose: usize,
        /// Last pose.
        last: usize,
    },
    /// A camera without images, and no `corners.csv`.
    #[error("{}:{line}: camera \"{camera}\" has no images, and there is no {} beside the manifest", file.display(), Dataset::CORNERS)]
    NothingToRead {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The camera.
        camera: String,
    },
    /// A number of the board's certificate that cannot be meant.
    #[error("{}:{line}: [board.certificate] {key} = {value} is not between {least:e} and {most:e}", file.display())]
    Certificate {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// The value.
        value: f64,
        /// Least that can be meant.
        least: f64,
        /// Most that can be meant.
        most: f64,
    },
    /// A date that is none.
    #[error("{}:{line}: [recording] date = \"{text}\" is not a date", file.display())]
    Date {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// What stands there.
        text: String,
    },
    /// Points, and no file of them: nothing in an image says where they are.
    #[error("{}: [board] kind = \"points\" needs {} beside it, and there is none", file.display(), Dataset::CORNERS)]
    NoPlaces {
        /// The manifest.
        file: PathBuf,
    },
    /// The places of the points, which stand in the file of corners.
    #[error("{source}")]
    Places {
        /// What is wrong with that file.
        source: CornersError,
    },
    /// The poses that are known beforehand.
    #[error("{source}")]
    KnownPoses {
        /// What is wrong with their file.
        source: KnownPosesError,
    },
    /// The measurement target.
    #[error("{}:{line}: {problem}", file.display())]
    Target {
        /// The manifest.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// What is wrong with it.
        problem: TargetProblem,
    },
}

impl Remedy for ManifestError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::NotFound { .. } => {
                "give the folder that holds dataset.toml, or write one: [board] with rows, cols, square_mm, and a [[camera]] with name, width, height, images"
            }
            Self::Read { .. } | Self::ImageFolder { .. } => "check the path and the permissions",
            Self::NotText { .. } => "save the manifest as UTF-8 text",
            Self::Syntax { .. } => {
                "correct the line; the keys are [dataset] exclude; [board] kind, rows, cols, square_mm, square_height_mm, marked, marker_mm, dictionary, legacy, first_id, tag_mm, spacing, family, border_bits, pitch_mm, diameter_mm, asymmetric, direction, outer_radius_mm, direction_outer_radius_mm; [board.certificate] scale_ppm_sd, flatness_mm_sd, expansion_ppm_per_k, expansion_ppm_per_k_sd, calibrated_at_c, used_at_c, used_at_c_sd; [[camera]] name, width, height, images or image_list, target_images, optics, serial; [recording] name, by, date; [stage] angles_deg, placement; [poses] known; [target] kind, rows, cols, pitch_mm, outer_radius_mm, direction_outer_radius_mm, direction"
            }
            Self::Missing { .. } => {
                "add it; rows and cols count inner corners, width and height are pixels"
            }
            Self::SquareSizeMissing { .. } | Self::SquareSize { .. } => {
                "measure the board across many squares, divide, and write for example square_mm = 10.0"
            }
            Self::OutOfRange { .. } => {
                "rows and cols count inner corners (one less than squares), width and height are pixels of the image"
            }
            Self::BoardKind { .. } => {
                return Some(format!(
                    "write kind = \"{}\"",
                    BoardKind::WORDS.join("\" or \"")
                ));
            }
            Self::Board { problem, .. } => return Some(problem.remedy()),
            Self::BoardKey { .. } => "remove the key, or write the kind that was meant",
            Self::CameraName { .. } => {
                "use up to 64 letters, digits, '-', '_' and '.'; the name becomes part of CSV headers such as u_left"
            }
            Self::TooManyCameras { .. } => "calibrate the cameras in groups that share poses",
            Self::DuplicateCamera { .. } => "give each camera its own name",
            Self::ImagesTwice { .. } => "keep one of the two",
            Self::PatternInFolder { .. } => {
                "write one pattern per camera, such as \"left/*.png\"; image_list names images one by one"
            }
            Self::NoMatch { .. } => "check the folder, the ending and upper and lower case",
            Self::ListedImageMissing { .. } => {
                "correct the name; write \"\" for a pose that this camera has no image of"
            }
            Self::EmptyImageList { .. } => "name the images, one per pose",
            Self::ImageUsedTwice { .. } => {
                "each view needs its own image: check the patterns of the two cameras"
            }
            Self::UnequalImages { .. } => {
                "images are matched by their order, one per pose; where a camera has no image of a pose, list them instead: image_list = [\"l01.png\", \"\", \"l03.png\"], with \"\" for the missing one"
            }
            Self::StageLength { .. } => "give one entry per pose, or leave the key out",
            Self::StageAngle { .. } => "give the dial reading in degrees, or leave angles_deg out",
            Self::ExcludedUnknown { .. } => "poses count from 0 in the natural order of the images",
            Self::NothingToRead { .. } => {
                "add images = \"folder/*.png\" to the camera, or put corners.csv (camera,pose,row,col,u,v; with kind = \"points\" camera,pose,u,v,x_mm,y_mm,z_mm) into the folder"
            }
            Self::Certificate { .. } => {
                "give standard deviations in ppm and mm, temperatures in degrees Celsius, or leave the key out"
            }
            Self::Date { .. } => "write year-month-day, such as date = \"2026-11-30\"",
            Self::NoPlaces { .. } => {
                "write it with camera,pose,u,v,x_mm,y_mm,z_mm, one line for each point that a camera sees"
            }
            Self::Places { source } => return source.remedy(),
            Self::KnownPoses { source } => return source.remedy(),
            Self::Target { problem, .. } => problem.remedy(),
        };
        Some(text.to_owned())
    }
}
