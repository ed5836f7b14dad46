//! Why experiments came to nothing.

use crate::pipeline::CalibrateError;
use calib_blob::matches::MatchesError;
use calib_rays::remedy::Remedy;
use calib_recording::dataset::ManifestError;
use calib_recording::detect::ring_target::TargetError;
use calib_simulate::SimulateError;
use std::path::PathBuf;

/// Why experiments came to nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// The manifest of a dataset.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// A dataset that gives no calibration.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// Files of matches.
    #[error(transparent)]
    Matches(#[from] MatchesError),
    /// Images of the measurement target.
    #[error(transparent)]
    Target(#[from] TargetError),
    /// A set-up that was to be simulated.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// A file with the truth of a simulated dataset.
    #[error("{}: is not the truth of this dataset: {problem}", file.display())]
    Truth {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

impl Remedy for ExperimentError {
    fn remedy(&self) -> Option<String> {
        match self {
            Self::Manifest(error) => error.remedy(),
            Self::Calibrate(error) => error.remedy(),
            Self::Matches(error) => error.remedy(),
            Self::Target(error) => error.remedy(),
            Self::Simulate(error) => error.remedy(),
            Self::Truth { .. } => Some(
                "simulate the dataset anew, or delete the file: experiments that need it are then left out"
                    .to_owned(),
            ),
        }
    }
}
