//! Requests that cannot be met.

use crate::pipeline::NoSuchPose;
use calib_judge::TaskWordsError;
use calib_rays::remedy::Remedy;
use firmware_sim::owner::{KeyError, ManifestError};
use firmware_sim::slot_image::SlotImageError;
use std::path::PathBuf;

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
    /// A file and an object that would both be standard output.
    #[error("-o - and --json: standard output cannot be the file and the object")]
    TwoOnStandardOutput,
    /// A file that is neither of the kinds that the command reads.
    #[error("{}: is not {expected}", path.display())]
    UnknownKind {
        /// The file.
        path: PathBuf,
        /// What it could have been.
        expected: &'static str,
    },
    /// The image of a slot cannot be made without this.
    #[error("slot-image needs {option}")]
    SlotImageLacks {
        /// What to give.
        option: &'static str,
    },
    /// There is no such image.
    #[error(transparent)]
    SlotImage(SlotImageError),
    /// A manifest that does not go with this image of a slot.
    #[error("{}: {source}", path.display())]
    ManifestOfSlot {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: SlotImageError,
    },
    /// A kind of target that is not printed.
    #[error("kind = \"{kind}\" has no print of its own")]
    NothingToPrint {
        /// The kind.
        kind: &'static str,
    },
    /// There is no such file.
    #[error("{}: does not exist", path.display())]
    NotFound {
        /// The place.
        path: PathBuf,
    },
    /// A file that is there and cannot be read.
    #[error("{}: cannot be read", path.display())]
    Unreadable {
        /// The place.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A frame that the rig does not have.
    #[error("the rig has no camera \"{name}\" whose frame could be used; it has {}", known.join(", "))]
    UnknownFrame {
        /// The name.
        name: String,
        /// The rig's cameras.
        known: Vec<String>,
    },
    /// A camera that the rig does not have.
    #[error("--camera: the rig has no camera \"{name}\"; it has {}", known.join(", "))]
    UnknownCamera {
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
    /// A pose to leave out that the recording does not have.
    #[error(transparent)]
    NoSuchPose(#[from] NoSuchPose),
    /// What takes standard deviations, in an arithmetic without any.
    #[error(
        "--arithmetic integer gives no standard deviations, which --lengths, --match-noise-px and --estimate-match-noise take"
    )]
    NoSigmaInIntegers,
    /// A blob that integers cannot look up.
    #[error("{}: integers cannot look this blob up", path.display())]
    Unsuited {
        /// The blob.
        path: PathBuf,
        /// Why.
        #[source]
        cause: ray_runtime::integer::Unsuited,
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
    /// What `compare` did is done by `methods`.
    #[error(
        "compare is for two calibrations; methods are compared on one dataset by calib-offline methods"
    )]
    CompareIsMethods,
    /// A measurement that nobody can read.
    #[error("--task: no error can be predicted")]
    Task(#[source] TaskWordsError),
    /// Lengths between matches that pass by once.
    #[error("--lengths: the matches come from standard input, and are read twice")]
    LengthsOfStream,
    /// A blob where a calibration is needed.
    #[error("{}: is a blob, and does not hold the corners that it was made from", path.display())]
    BlobWithoutCorners {
        /// The file.
        path: PathBuf,
    },
    /// Two calibrations of different cameras.
    #[error("the calibrations have different cameras: {} and {}", first.join(", "), second.join(", "))]
    OtherCameras {
        /// The first one's, with their sizes.
        first: Vec<String>,
        /// The second one's.
        second: Vec<String>,
    },
    /// Two calibrations without a place in common.
    #[error("the calibrations have no calibrated pixels in common that see the same points")]
    NothingInCommon,
    /// Rays that do not meet, and nobody says where they matter.
    #[error(
        "the rays of its cameras do not meet in a point, so that it matters how far away things are"
    )]
    NeedsDistance,
    /// Cameras that are called otherwise in the dataset.
    #[error("{calibration}: its cameras are {}, the dataset's {}", found.join(", "), wanted.join(", "))]
    AuditCameras {
        /// The calibration.
        calibration: String,
        /// Its cameras.
        found: Vec<String>,
        /// Those of the dataset.
        wanted: Vec<String>,
    },
    /// Images of another size.
    #[error("{calibration}: camera \"{camera}\" has {} x {} px, in the dataset {} x {}", found[0], found[1], wanted[0], wanted[1])]
    AuditSensor {
        /// The calibration.
        calibration: String,
        /// The camera.
        camera: String,
        /// Its size there.
        found: [u32; 2],
        /// In the dataset.
        wanted: [u32; 2],
    },
    /// A lens that a format has no place for.
    #[error("--model {lens}: the format has no place for it; it holds {}", held.join(", "))]
    ExportLens {
        /// The lens.
        lens: &'static str,
        /// Those that it holds.
        held: Vec<&'static str>,
    },
    /// Images to undistort that nobody named.
    #[error("--format undistort: which images are meant? --images is missing")]
    NoImages,
    /// A key is never replaced.
    #[error("{}: exists, and a key is never replaced", path.display())]
    KeyExists {
        /// The file.
        path: PathBuf,
    },
    /// The system gives no randomness.
    #[error("the system gives no randomness for a key")]
    NoRandomness(#[source] std::io::Error),
    /// A file that holds no key.
    #[error("{}: {source}", path.display())]
    Key {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: KeyError,
    },
    /// Terms that no device could take.
    #[error("the blob cannot be signed so: {0}")]
    Manifest(ManifestError),
    /// A signature that is not by this key, or not of these bytes.
    #[error("{}: this signature is not by --public-key, or not of what these options say", path.display())]
    OtherSignature {
        /// The file.
        path: PathBuf,
    },
    /// A key that the device does not have.
    #[error("the device has another owner: none of its keys begins with {found}")]
    NotTheOwner {
        /// First digits of the public key.
        found: String,
    },
    /// A device with an owner and a blob without a manifest.
    #[error("the device has an owner and takes signed blobs only, and {} is not signed", rig.display())]
    NotSigned {
        /// The blob.
        rig: PathBuf,
        /// What to run.
        command: String,
    },
    /// The input would be replaced by the output.
    #[error("{}: is what the command reads", path.display())]
    OutputIsInput {
        /// The file.
        path: PathBuf,
    },
}

impl Remedy for UsageError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::TwoOnStandardOutput => "leave --json out, or name a file",
            Self::Exists { .. } => "choose another place, or replace it with --force",
            Self::UnknownKind { .. } | Self::NotFound { .. } => "check the path",
            Self::Unreadable { .. } => "check the path and the permissions",
            Self::SlotImageLacks { .. } => {
                "give what the device's firmware hands to the storage: its flash driver's unit and block, and the start and length of its region"
            }
            Self::SlotImage(error) | Self::ManifestOfSlot { source: error, .. } => {
                return slot_image_remedy(error);
            }
            Self::NothingToPrint { .. } => {
                "choose chessboard, charuco, aprilgrid, circles or rings"
            }
            Self::UnknownFrame { .. } => {
                "leave --frame out for the rig's own frame, or name one of its cameras"
            }
            Self::UnknownCamera { .. } => "name one of its cameras",
            Self::OneCamera { .. } => {
                "calibrate two cameras together; a single one gives rays only"
            }
            Self::NoSuchPose(error) => return error.remedy(),
            Self::LengthsOfStream => "write the matches to a file first",
            Self::Task(error) => return error.remedy(),
            Self::NoSigmaInIntegers | Self::Unsuited { .. } => "leave --arithmetic integer out",
            Self::NoDevice => "give its address, such as --device tcp:127.0.0.1:7777",
            Self::NotPacked { .. } => {
                "pack it first: calib-offline pack calibration.json -o rig.rays"
            }
            Self::CompareIsMethods => {
                "calib-offline methods DATASET, with the same options, or calib-offline compare A.json B.json"
            }
            Self::BlobWithoutCorners { .. } => {
                "give the calibration.json that the blob was packed from"
            }
            Self::OtherCameras { .. } => {
                "compare calibrations of one rig, with the same names and image sizes"
            }
            Self::NeedsDistance => "say it with --distance-mm",
            Self::AuditCameras { .. } => {
                "name the cameras in the order of the calibration's files with --names A,B, as dataset.toml does"
            }
            Self::AuditSensor { .. } => {
                "record with the resolution, binning and region of the calibration"
            }
            Self::NothingInCommon => "look at both with calib-offline inspect",
            Self::ExportLens { .. } => "take one that it holds; --format opencv holds all of them",
            Self::NoImages => "give the folder of the images with --images FOLDER",
            Self::KeyExists { .. } => {
                "choose another name: devices may have been built for that key"
            }
            Self::NoRandomness(_) => {
                "make the key elsewhere, such as with openssl genpkey -algorithm ed25519"
            }
            Self::Key { .. } | Self::Manifest(_) => return None,
            Self::OtherSignature { .. } => {
                "repeat all options that --to-be-signed was given, and sign that very file"
            }
            Self::NotTheOwner { .. } => {
                "calib-offline device status shows the first digits of its keys"
            }
            Self::NotSigned { command, .. } => return Some(command.clone()),
            Self::OutputIsInput { .. } => "choose another place for what it writes",
        };
        Some(text.to_owned())
    }
}

fn slot_image_remedy(error: &SlotImageError) -> Option<String> {
    let text = match error {
        SlotImageError::Unsupported(_) => "give --unit and --block as the part's flash driver says",
        SlotImageError::NotBlocks { .. }
        | SlotImageError::PastTheEnd { .. }
        | SlotImageError::TooShort { .. } => {
            "give the --region-address and --region-size that the firmware hands to the storage"
        }
        SlotImageError::NoSuchSlot(_) => "give --slot 0 or --slot 1",
        SlotImageError::TooLong { .. } => {
            "pack it with a larger error bound, or give the storage a larger region"
        }
        SlotImageError::NoRecord => "give a shorter --serial, or leave it out",
        SlotImageError::NotAManifest | SlotImageError::OtherManifest => {
            "sign this very blob with calib-offline sign, and give that manifest"
        }
        SlotImageError::OtherSerial { signed, .. } => {
            return Some(format!(
                "give --serial {signed:?}, or sign the blob for this rig or for --any-rig"
            ));
        }
        _ => return None,
    };
    Some(text.to_owned())
}
