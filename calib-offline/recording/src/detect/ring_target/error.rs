//! Why a dataset has no labelled markers, and what to do about it.

use crate::dataset::{CornersError, Dataset};
use crate::detect::DetectError;
use calib_rays::remedy::Remedy;

/// Why a dataset has no labelled markers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TargetError {
    /// The manifest describes no target.
    #[error("{} describes no [target]", Dataset::MANIFEST)]
    NoTarget,
    /// There is nothing to look at.
    #[error("no camera of {} has target_images", Dataset::MANIFEST)]
    NoImages,
    /// A file that is no image of its camera.
    #[error(transparent)]
    Images(#[from] DetectError),
    /// Every image was refused.
    #[error("none of {total} images of the target could be used; the first: {first}")]
    AllRefused {
        /// Images looked at.
        total: usize,
        /// File and reason of the first one.
        first: String,
    },
    /// The markers that were there already.
    #[error("the labelled markers cannot be used")]
    Markers(#[from] CornersError),
}

impl Remedy for TargetError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::NoTarget => {
                "describe it: [target] with kind = \"rings\", rows, cols, pitch_mm, outer_radius_mm, direction_outer_radius_mm, direction"
            }
            Self::NoImages => "add target_images = \"target/left/*.png\" to each [[camera]]",
            Self::Images(DetectError::BrokenImage { source, .. }) => return source.remedy(),
            Self::Images(_) => return None,
            Self::AllRefused { .. } => {
                "look at the images with calib-offline detect DATASET --target --overlay DIR"
            }
            Self::Markers(CornersError::OutOfBoard { .. }) => {
                "rows and columns count from 0; correct them, or rows and cols of [target]"
            }
            Self::Markers(CornersError::NotText { .. } | CornersError::Empty { .. }) => {
                "restore markers.csv, or delete it and run calib-offline detect DATASET --target"
            }
            Self::Markers(error) => return error.remedy(),
        };
        Some(text.to_owned())
    }
}
