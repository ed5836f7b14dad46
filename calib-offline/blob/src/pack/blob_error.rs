//! Why a file is not a blob that can be used.

use calib_rays::remedy::Remedy;
use ray_runtime::OpenError;
use std::path::PathBuf;

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
        source: OpenError,
    },
}

impl Remedy for BlobError {
    fn remedy(&self) -> Option<String> {
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
                OpenError::WrongRounding { .. } => {
                    "nothing is wrong with the file: something in this process has changed how the processor rounds; set it to nearest"
                }
                _ => "pack the calibration again",
            },
        };
        Some(text.to_owned())
    }
}
