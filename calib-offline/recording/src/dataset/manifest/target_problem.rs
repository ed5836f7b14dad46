//! What can be wrong with the measurement target in `dataset.toml`.

use super::limits::{MAX_SQUARE_MM, MIN_SQUARE_MM};
use crate::dataset::target::{TargetSpec, TargetSymmetry};
use std::path::PathBuf;

/// Large and small markers must differ by this factor at least, to be told apart in an image.
pub(super) const MIN_RADIUS_RATIO: f64 = 1.1;

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
