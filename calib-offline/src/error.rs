//! What can go wrong, one variant per stage, each wrapping that stage's own error.

use crate::demo::DemoError;
use crate::device::DeviceError;
use crate::experiments::ExperimentError;
use crate::report::store::CalibrationError;
use calib_blob::export::ExportError;
use calib_blob::matches::MatchesError;
use calib_blob::pack::PackError;
use calib_estimate::alternating::AlternatingError;
use calib_estimate::init::InitError;
use calib_estimate::joint::EstimateError;
use calib_estimate::pinhole::PinholeError;
use calib_recording::atomic_file::WriteError;
use calib_recording::dataset::{CornersError, ManifestError, SufficiencyError};
use calib_recording::detect::DetectError;
use calib_recording::detect::overlay::OverlayError;
use calib_recording::detect::ring_target::TargetError;
use calib_recording::detect::suspicion::LabelSuspicion;
use calib_simulate::SimulateError;
use std::convert::Infallible;
use std::path::PathBuf;

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

/// Why a file is not a blob that this version reads.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BlobError {
    /// The system refused to read it.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The runtime refused it.
    #[error("{}: the runtime refuses it", file.display())]
    Open {
        /// The file.
        file: PathBuf,
        /// What the runtime said.
        source: ray_runtime::OpenError,
    },
}

/// A request that cannot be met.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UsageError {
    /// Something stands where the result is to be written.
    #[error("{}: exists", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A file that is neither of the kinds that the command reads.
    #[error("{}: is not {expected}", path.display())]
    UnknownKind {
        /// The file.
        path: PathBuf,
        /// What it could have been.
        expected: &'static str,
    },
    /// There is no such file.
    #[error("{}: does not exist", path.display())]
    NotFound {
        /// The place.
        path: PathBuf,
    },
    /// A frame that the rig does not have.
    #[error("the rig has no camera \"{name}\" whose frame could be used; it has {}", known.join(", "))]
    UnknownFrame {
        /// The name.
        name: String,
        /// The rig's cameras.
        known: Vec<String>,
    },
    /// One camera cannot triangulate.
    #[error("{}: has one camera, a point takes two", path.display())]
    OneCamera {
        /// The rig.
        path: PathBuf,
    },
    /// A pose that the recording does not have.
    #[error("there is no pose {pose} to leave out; the last is pose {last}")]
    NoSuchPose {
        /// The pose asked for.
        pose: usize,
        /// The last pose.
        last: usize,
    },
    /// A device's verb without its address.
    #[error("which device is meant? --device is missing")]
    NoDevice,
    /// A file that is to be flashed and is no blob.
    #[error("{}: is a calibration, and a device takes blobs", path.display())]
    NotPacked {
        /// The file.
        path: PathBuf,
    },
    /// The input would be replaced by the output.
    #[error("{}: is what the command reads", path.display())]
    OutputIsInput {
        /// The file.
        path: PathBuf,
    },
}

impl UsageError {
    /// What to do about it.
    pub fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Exists { .. } => "choose another place, or replace it with --force",
            Self::UnknownKind { .. } | Self::NotFound { .. } => "check the path",
            Self::UnknownFrame { .. } => {
                "leave --frame out for the rig's own frame, or name one of its cameras"
            }
            Self::OneCamera { .. } => {
                "calibrate two cameras together; a single one gives rays only"
            }
            Self::NoSuchPose { .. } => "poses count from 0; see calib-offline inspect DATASET",
            Self::NoDevice => "give its address, such as --device tcp:127.0.0.1:7777",
            Self::NotPacked { .. } => {
                "pack it first: calib-offline pack calibration.json -o rig.rays"
            }
            Self::OutputIsInput { .. } => "choose another place with -o",
        };
        Some(text.to_owned())
    }
}

impl BlobError {
    /// What to do about it.
    pub fn remedy(&self) -> Option<String> {
        use ray_runtime::OpenError;
        let text = match self {
            Self::Read { .. } => "check the path and the permissions",
            Self::Open { source, .. } => match source {
                OpenError::Truncated { .. } => "the file is cut off: copy it again, binary",
                OpenError::BadMagic { .. } => {
                    "this is no .rays file: write one with calib-offline pack"
                }
                OpenError::WrongVersion { .. } => {
                    "pack the calibration again with this version, or read it with the one that wrote it"
                }
                OpenError::TrailingBytes { .. } | OpenError::BadCrc { .. } => {
                    "the file was damaged on the way: copy it again, binary"
                }
                _ => "pack the calibration again",
            },
        };
        Some(text.to_owned())
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

    /// What to do about it.
    pub fn remedy(&self) -> Option<String> {
        match self {
            Self::Manifest(error) => error.remedy(),
            Self::Corners(error) => error.remedy(),
            Self::Sufficiency(error) => error.remedy(),
            Self::FewImages { .. } => Some(
                "correct dataset.toml or the images as the reason says; calib-offline detect DATASET \
                 --overlay DIR gives the reason for every image"
                    .to_owned(),
            ),
            Self::Labels { suspicion, .. } => Some(suspicion.remedy()),
            Self::Detect(DetectError::NoImages) => {
                Some("add images = \"folder/*.png\" to each [[camera]] of dataset.toml".to_owned())
            }
            Self::Detect(DetectError::BrokenImage { source, .. }) => Some(source.remedy()),
            Self::Json(_) | Self::Demo(_) => None,
            Self::Detect(_) => Some(
                "look at the images with --overlay DIR; a board with an odd and an even number of corners cannot be turned unnoticed"
                    .to_owned(),
            ),
            Self::Target(error) => error.remedy(),
            Self::Experiment(error) => Some(error.remedy()),
            Self::Overlay(_) => Some("choose another folder for --overlay".to_owned()),
            Self::Simulate(_) => Some("see calib-offline simulate --help".to_owned()),
            Self::Init(_) | Self::Estimate(_) => Some(
                "look at the corners with calib-offline inspect, and at the images with detect \
                 --overlay; check rows, cols and the image size in dataset.toml, and record the \
                 board at more tilts and distances"
                    .to_owned(),
            ),
            Self::Pinhole(_) => Some(
                "leave the baseline out: calib-offline calibrate makes no assumption about the lens"
                    .to_owned(),
            ),
            Self::Alternating(_) => Some(
                "leave --method out: the joint estimate takes all views together; or add boards at \
                 other distances"
                    .to_owned(),
            ),
            Self::Calibration(error) => error.remedy(),
            Self::Blob(error) => error.remedy(),
            Self::Matches(error) => error.remedy(),
            Self::Pack(error) => Some(pack_remedy(error)),
            Self::Export(error) => Some(error.remedy()),
            Self::Device(error) => error.remedy(),
            Self::Write(error) => error.remedy(),
            Self::Usage(error) => error.remedy(),
        }
    }
}

fn pack_remedy(error: &PackError) -> String {
    match error {
        PackError::BadSetting { .. } => "give a bound in pixels such as 0.001".to_owned(),
        PackError::BoundNotReached { best_px, .. } => {
            format!(
                "ask for more: --max-error-px {:.1e} or above",
                1.1 * best_px
            )
        }
        PackError::TooFewBytes { need, .. } => format!(
            "allow {need} bytes, a larger --max-error-px, or leave the uncertainty out with --no-uncertainty"
        ),
        PackError::NothingCalibrated { .. } => {
            "calibrate with corners over more of the sensor".to_owned()
        }
        _ => {
            "check the lengths and the camera names with calib-offline inspect: a blob holds up to \
              a kilometer and needs names that differ"
                .to_owned()
        }
    }
}
