//! What can go wrong, one variant per stage, each wrapping that stage's own error.

use crate::alternating::AlternatingError;
use crate::atomic_file::WriteError;
use crate::cli::usage_error::UsageError;
use crate::compare::publication::ExperimentError;
use crate::dataset::{CornersError, ManifestError, SufficiencyError};
use crate::demo::DemoError;
use crate::detect::DetectError;
use crate::detect::overlay::OverlayError;
use crate::detect::ring_target::TargetError;
use crate::detect::suspicion::LabelSuspicion;
use crate::device::DeviceError;
use crate::export::ExportError;
use crate::init::InitError;
use crate::joint::EstimateError;
use crate::matches::MatchesError;
use crate::pack::{BlobError, PackError};
use crate::pinhole::PinholeError;
use crate::remedy::Remedy;
use crate::report::store::CalibrationError;
use crate::simulate::SimulateError;
use std::convert::Infallible;

/// Why a command did not do what it was asked for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The manifest of a dataset.
    #[error("the dataset cannot be used")]
    Manifest(#[from] ManifestError),
    /// The corners of a dataset.
    #[error("the corners of the dataset cannot be used")]
    Corners(#[from] CornersError),
    /// The search for corners in the images.
    #[error("the corners cannot be found")]
    Detect(#[from] DetectError),
    /// Pictures of the corners found.
    #[error("the overlays cannot be written")]
    Overlay(#[from] OverlayError),
    /// The markers of the measurement target.
    #[error("the markers of the target cannot be found")]
    Target(#[from] TargetError),
    /// A dataset that was to be simulated.
    #[error("the dataset cannot be simulated")]
    Simulate(#[from] SimulateError),
    /// Corners that no estimate could work with.
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
    /// Labels that contradict each other, found after no estimate was possible.
    #[error("the corners do not belong together as they are labelled: {suspicion}")]
    Labels {
        /// What is suspected.
        suspicion: LabelSuspicion,
        /// The failure that it explains.
        source: Box<Error>,
    },
    /// No starting point.
    #[error("no camera model explains these corners")]
    Init(#[from] InitError),
    /// No estimate.
    #[error("the estimate failed")]
    Estimate(#[from] EstimateError),
    /// No baseline.
    #[error("the pinhole baseline failed")]
    Pinhole(#[from] PinholeError),
    /// No estimate by the published procedure.
    #[error("the published procedure failed")]
    Alternating(#[from] AlternatingError),
    /// A calibration that was read.
    #[error("the calibration cannot be used")]
    Calibration(#[from] CalibrationError),
    /// A blob that was read.
    #[error("the blob cannot be used")]
    Blob(#[from] BlobError),
    /// Matches that were read.
    #[error("the matches cannot be used")]
    Matches(#[from] MatchesError),
    /// A rig that was to be packed.
    #[error("the calibration cannot be packed")]
    Pack(#[from] PackError),
    /// A blob that was to be written in another form.
    #[error("the blob cannot be exported")]
    Export(#[from] ExportError),
    /// A device that did not do what it was asked for.
    #[error("the device cannot be used")]
    Device(#[from] DeviceError),
    /// A result that JSON cannot say.
    #[error("the result cannot be written as JSON")]
    Json(#[from] serde_json::Error),
    /// A result that was to be written.
    #[error("the result cannot be written")]
    Write(#[from] WriteError),
    /// A demo that could not measure.
    #[error("the demo cannot measure")]
    Demo(#[from] DemoError),
    /// Experiments that came to nothing.
    #[error("the methods cannot be evaluated")]
    Experiment(#[from] ExperimentError),
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

/// The exit code where the data cannot determine the answer.
pub const DATA_UNDETERMINED: u8 = 3;

impl Error {
    /// The process's exit code: [`DATA_UNDETERMINED`], else 2.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Sufficiency(_)
            | Self::FewImages { .. }
            | Self::Labels { .. }
            | Self::Detect(DetectError::Consistency(_))
            | Self::Target(TargetError::AllRefused { .. })
            | Self::Init(_)
            | Self::Estimate(_)
            | Self::Pinhole(_)
            | Self::Alternating(_)
            | Self::Pack(PackError::NothingCalibrated { .. }) => DATA_UNDETERMINED,
            Self::Manifest(_)
            | Self::Corners(_)
            | Self::Detect(_)
            | Self::Overlay(_)
            | Self::Target(_)
            | Self::Simulate(_)
            | Self::Calibration(_)
            | Self::Blob(_)
            | Self::Matches(_)
            | Self::Pack(_)
            | Self::Export(_)
            | Self::Device(_)
            | Self::Demo(_)
            | Self::Experiment(_)
            | Self::Json(_)
            | Self::Write(_)
            | Self::Usage(_) => 2,
        }
    }
}

impl Remedy for Error {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Manifest(error) => return error.remedy(),
            Self::Corners(error) => return error.remedy(),
            Self::Detect(error) => return error.remedy(),
            Self::Overlay(error) => return error.remedy(),
            Self::Target(error) => return error.remedy(),
            Self::Simulate(error) => return error.remedy(),
            Self::Sufficiency(error) => return error.remedy(),
            Self::Labels { suspicion, .. } => return suspicion.remedy(),
            Self::Calibration(error) => return error.remedy(),
            Self::Blob(error) => return error.remedy(),
            Self::Matches(error) => return error.remedy(),
            Self::Pack(error) => return error.remedy(),
            Self::Export(error) => return error.remedy(),
            Self::Device(error) => return error.remedy(),
            Self::Experiment(error) => return error.remedy(),
            Self::Write(error) => return error.remedy(),
            Self::Usage(error) => return error.remedy(),
            Self::Json(_) | Self::Demo(_) => return None,
            Self::FewImages { .. } => {
                "correct dataset.toml or the images as the reason says; calib-offline detect DATASET \
                 --overlay DIR gives the reason for every image"
            }
            Self::Init(_) | Self::Estimate(_) => {
                "look at the corners with calib-offline inspect, and at the images with detect \
                 --overlay; check rows, cols and the image size in dataset.toml, and record the \
                 board at more tilts and distances"
            }
            Self::Pinhole(_) => {
                "leave the baseline out: calib-offline calibrate makes no assumption about the lens"
            }
            Self::Alternating(_) => {
                "leave --method out: the joint estimate takes all views together; or add boards at \
                 other distances"
            }
        };
        Some(text.to_owned())
    }
}
