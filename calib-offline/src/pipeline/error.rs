//! Why a dataset gives no calibration.

use crate::methods::MethodError;
use calib_judge::plausibility::Misread;
use calib_judge::{Cause, TaskError};
use calib_rays::remedy::Remedy;
use calib_recording::dataset::{CornersError, SufficiencyError};
use calib_recording::detect::DetectError;
use std::path::PathBuf;

/// Why a dataset gives no calibration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
    /// The corners of the dataset.
    #[error("the corners of the dataset cannot be used")]
    Corners(#[from] CornersError),
    /// The search for corners in the images.
    #[error("the corners cannot be found")]
    Detect(#[from] DetectError),
    /// A pose to leave out that there is not.
    #[error(transparent)]
    Exclude(#[from] NoSuchPose),
    /// Known poses of another recording.
    #[error(transparent)]
    Known(#[from] NoKnownPose),
    /// Corners that no method could work with.
    #[error("these corners cannot determine a calibration")]
    Sufficiency(#[from] SufficiencyError),
    /// Images that show too little of the board.
    #[error("{refused} of {total} images were refused; the first: {first}")]
    FewImages {
        /// Images that were refused.
        refused: usize,
        /// Images looked at.
        total: usize,
        /// The file and the reason of the first one refused.
        first: String,
        /// What is missing.
        source: SufficiencyError,
    },
    /// A recording that contradicts itself, looked at after no method had an answer.
    #[error("the recording contradicts itself: {}", first.text)]
    Implausible {
        /// What explains the failure best.
        first: Box<Cause>,
        /// All that was found, that one first.
        causes: Vec<Cause>,
        /// The failure that it explains.
        source: MethodError,
    },
    /// Known places or poses that contradict what was seen, and how they fit.
    #[error("{}: {known}", file.display())]
    Misread {
        /// The file that they stand in.
        file: PathBuf,
        /// What is wrong with them.
        known: Misread,
        /// The failure that it explains, if there was no answer at all.
        source: Option<MethodError>,
    },
    /// No answer.
    #[error(transparent)]
    Method(#[from] MethodError),
    /// A measurement whose error cannot be expected.
    #[error("the error of this measurement cannot be predicted")]
    Task(#[from] TaskError),
}

/// A pose to leave out that the recording does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("there is no pose {pose} to leave out; the last is pose {last}")]
pub struct NoSuchPose {
    /// The pose asked for.
    pub pose: usize,
    /// The last pose.
    pub last: usize,
}

/// Poses that are known beforehand, and none of them seen.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}: no pose that [poses] known lists has corners; the first listed is pose {first}", file.display())]
pub struct NoKnownPose {
    /// The file that lists them.
    pub file: PathBuf,
    /// The first pose listed.
    pub first: usize,
}

impl CalibrateError {
    /// Whether the input can be used, and the data cannot determine the answer.
    pub fn is_undetermined(&self) -> bool {
        match self {
            Self::Corners(_) | Self::Exclude(_) | Self::Known(_) => false,
            Self::Detect(error) => matches!(
                error,
                DetectError::Consistency(_)
                    | DetectError::WrongCount { .. }
                    | DetectError::WrongTarget { .. }
            ),
            Self::Task(error) => error.is_undetermined(),
            Self::Sufficiency(_)
            | Self::FewImages { .. }
            | Self::Implausible { .. }
            | Self::Misread { .. }
            | Self::Method(_) => true,
        }
    }
}

impl Remedy for CalibrateError {
    fn remedy(&self) -> Option<String> {
        match self {
            Self::Corners(error) => error.remedy(),
            Self::Detect(error) => error.remedy(),
            Self::Exclude(error) => error.remedy(),
            Self::Known(_) => Some(
                "number the poses as corners.csv or the images do, from 0, or leave [poses] known out".to_owned(),
            ),
            Self::Sufficiency(error) => error.remedy(),
            Self::FewImages { .. } => Some(
                "correct dataset.toml or the images as the reason says; calib-offline detect DATASET \
                 --overlay DIR gives the reason for every image"
                    .to_owned(),
            ),
            Self::Implausible { .. } => Some(
                "correct that first; calib-offline inspect DATASET says what else is to be seen".to_owned(),
            ),
            Self::Misread { known, .. } => known.remedy(),
            Self::Method(error) => error.remedy(),
            Self::Task(error) => error.remedy(),
        }
    }
}

impl Remedy for NoSuchPose {
    fn remedy(&self) -> Option<String> {
        Some("poses count from 0; see calib-offline inspect DATASET".to_owned())
    }
}
