//! What can go wrong, each kind with the error of its own room: the only one that knows all of them.

use crate::cli::usage_error::UsageError;
use crate::compare::CompareError;
use crate::compare::publication::ExperimentError;
use crate::demo::DemoError;
use crate::device::DeviceError;
use crate::pipeline::{CalibrateError, VerifyError};
use crate::report::store::CalibrationError;
use calib_blob::export::ExportError;
use calib_blob::matches::{LengthsError, MatchesError, NoiseError, PixelsError};
use calib_blob::pack::{BlobError, PackError};
use calib_exchange::mesh::MeshError;
use calib_exchange::ply::PointsError;
use calib_exchange::undistort::UndistortError;
use calib_exchange::{ExchangeError, ImportError};
use calib_rays::remedy::Remedy;
use calib_recording::atomic_file::WriteError;
use calib_recording::dataset::{CornersError, ManifestError, SufficiencyError};
use calib_recording::detect::DetectError;
use calib_recording::detect::overlay::OverlayError;
use calib_recording::detect::ring_target::TargetError;
use calib_simulate::SimulateError;
use std::convert::Infallible;

/// Why a command did not do what it was asked for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The manifest of a dataset.
    #[error("the dataset cannot be used")]
    Manifest(#[from] ManifestError),
    /// A dataset that gives no calibration, or no corners.
    #[error(transparent)]
    Calibrate(CalibrateError),
    /// Pictures of the corners found.
    #[error("the overlays cannot be written")]
    Overlay(#[from] OverlayError),
    /// The markers of the measurement target.
    #[error("the markers of the target cannot be found")]
    Target(#[from] TargetError),
    /// A dataset that was to be simulated.
    #[error("the dataset cannot be simulated")]
    Simulate(#[from] SimulateError),
    /// A calibration that was read.
    #[error("the calibration cannot be used")]
    Calibration(#[from] CalibrationError),
    /// A calibration that was to be held against a dataset.
    #[error("the calibration cannot be verified")]
    Verify(#[from] VerifyError),
    /// A blob that was read.
    #[error("the blob cannot be used")]
    Blob(#[from] BlobError),
    /// Matches that were read.
    #[error("the matches cannot be used")]
    Matches(#[from] MatchesError),
    /// Pixels that were read.
    #[error("the pixels cannot be used")]
    Pixels(#[from] PixelsError),
    /// Gaps that do not say how noisy matches are.
    #[error("the noise of the matches cannot be estimated")]
    Noise(#[from] NoiseError),
    /// Known lengths that were read.
    #[error("the lengths cannot be used")]
    Lengths(#[from] LengthsError),
    /// A rig that was to be packed.
    #[error("the calibration cannot be packed")]
    Pack(#[from] PackError),
    /// A blob that was to be written in another form.
    #[error("the blob cannot be exported")]
    Export(#[from] ExportError),
    /// A rig that was to be written for another tool.
    #[error("the rig cannot be exported")]
    Exchange(#[from] ExchangeError),
    /// A mesh that was to be made.
    #[error("the mesh cannot be made")]
    Mesh(#[from] MeshError),
    /// Images that were to be undistorted.
    #[error("the images cannot be undistorted")]
    Undistort(#[from] UndistortError),
    /// Points that were to be written as a cloud.
    #[error("the points cannot be exported")]
    Points(#[from] PointsError),
    /// A calibration by another tool.
    #[error("the calibration of another tool cannot be used")]
    Import(#[from] ImportError),
    /// A device that did not do what it was asked for.
    #[error("the device cannot be used")]
    Device(#[from] DeviceError),
    /// A result that JSON cannot say.
    #[error("the result cannot be written as JSON")]
    Json(#[from] serde_json::Error),
    /// A result that was to be written.
    #[error("the result cannot be written")]
    Write(#[from] WriteError),
    /// A result that did not reach standard output. The command's files stand.
    #[error("the result does not reach standard output")]
    Output(#[source] std::io::Error),
    /// A demo that could not measure.
    #[error("the demo cannot measure")]
    Demo(#[source] DemoError),
    /// Experiments that came to nothing.
    #[error("the methods cannot be evaluated")]
    Experiment(#[source] Box<ExperimentError>),
    /// A request that cannot be met.
    #[error("the command cannot be run so")]
    Usage(#[from] UsageError),
}

/// What cannot fail fails with no error.
impl From<Infallible> for Error {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}

/// A pose to leave out that there is not is a request that cannot be met.
impl From<CalibrateError> for Error {
    fn from(error: CalibrateError) -> Self {
        match error {
            CalibrateError::Exclude(error) => Self::Usage(error.into()),
            other => Self::Calibrate(other),
        }
    }
}

impl From<CornersError> for Error {
    fn from(error: CornersError) -> Self {
        Self::Calibrate(error.into())
    }
}

impl From<DetectError> for Error {
    fn from(error: DetectError) -> Self {
        Self::Calibrate(error.into())
    }
}

impl From<SufficiencyError> for Error {
    fn from(error: SufficiencyError) -> Self {
        Self::Calibrate(error.into())
    }
}

/// What a comparison gives is told as what it is.
impl From<CompareError> for Error {
    fn from(error: CompareError) -> Self {
        match error {
            CompareError::Calibrate(error) => error.into(),
            CompareError::Matches(error) => error.into(),
        }
    }
}

impl From<ExperimentError> for Error {
    fn from(error: ExperimentError) -> Self {
        match error {
            ExperimentError::Manifest(error) => error.into(),
            ExperimentError::Calibrate(error) => error.into(),
            ExperimentError::Matches(error) => error.into(),
            ExperimentError::Target(error) => error.into(),
            ExperimentError::Simulate(error) => error.into(),
            error @ ExperimentError::Truth { .. } => Self::Experiment(Box::new(error)),
        }
    }
}

impl From<DemoError> for Error {
    fn from(error: DemoError) -> Self {
        match error {
            DemoError::Pack(error) => error.into(),
            error => Self::Demo(error),
        }
    }
}

/// The exit code where the data cannot determine the answer.
const DATA_UNDETERMINED: u8 = 3;

impl Error {
    /// The process's exit code: 3 where the data cannot determine the answer, else 2.
    pub fn exit_code(&self) -> u8 {
        let is_undetermined = match self {
            Self::Calibrate(error) => error.is_undetermined(),
            Self::Verify(error) => error.is_undetermined(),
            Self::Target(error) => matches!(error, TargetError::AllRefused { .. }),
            Self::Pack(error) => matches!(error, PackError::NothingCalibrated { .. }),
            Self::Exchange(error) | Self::Mesh(MeshError::Rays(error)) => {
                matches!(error, ExchangeError::TooFewRays { .. })
            }
            Self::Noise(error) => !matches!(error, NoiseError::NothingPredicted),
            _ => false,
        };
        if is_undetermined {
            DATA_UNDETERMINED
        } else {
            2
        }
    }
}

impl Remedy for Error {
    fn remedy(&self) -> Option<String> {
        match self {
            Self::Manifest(error) => error.remedy(),
            Self::Calibrate(error) => error.remedy(),
            Self::Overlay(error) => error.remedy(),
            Self::Target(error) => error.remedy(),
            Self::Simulate(error) => error.remedy(),
            Self::Calibration(error) => error.remedy(),
            Self::Verify(error) => error.remedy(),
            Self::Blob(error) => error.remedy(),
            Self::Matches(error) => error.remedy(),
            Self::Pixels(error) => error.remedy(),
            Self::Noise(error) => error.remedy(),
            Self::Lengths(error) => error.remedy(),
            Self::Pack(error) => error.remedy(),
            Self::Export(error) => error.remedy(),
            Self::Exchange(error) => error.remedy(),
            Self::Mesh(error) => error.remedy(),
            Self::Undistort(error) => error.remedy(),
            Self::Points(error) => error.remedy(),
            Self::Import(error) => error.remedy(),
            Self::Device(error) => error.remedy(),
            Self::Write(error) => error.remedy(),
            Self::Demo(error) => error.remedy(),
            Self::Experiment(error) => error.remedy(),
            Self::Usage(error) => error.remedy(),
            Self::Output(_) => Some(
                "check where standard output goes; with --json, names must be UTF-8. What the command wrote to files stands"
                    .to_owned(),
            ),
            Self::Json(_) => None,
        }
    }
}
