//! Why nothing could be counted.

use std::path::PathBuf;

use thiserror::Error;

use crate::counting::KNOWN_INSTRUCTIONS;
use crate::images::ImagesError;

/// Why nothing could be counted.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CostError {
    /// There is no QEMU, or no image.
    #[error(transparent)]
    Images(#[from] ImagesError),
    /// A file could not be read or written.
    #[error("{what}")]
    Io {
        /// Which.
        what: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file is not a blob.
    #[error("{} cannot be opened", path.display())]
    Blob {
        /// The file.
        path: PathBuf,
        /// What the runtime says.
        source: ray_runtime::OpenError,
    },
    /// A blob has no camera.
    #[error("{} has no camera", path.display())]
    NoCamera {
        /// The file.
        path: PathBuf,
    },
    /// No pixels of two cameras were found whose rays meet.
    #[error("{}: of {tries} random pairs of pixels, none gives a point", path.display())]
    NoMatches {
        /// The file.
        path: PathBuf,
        /// Pairs that were tried.
        tries: usize,
    },
    /// An image is no ELF file.
    #[error("{} cannot be read as an image", path.display())]
    Elf {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: object::Error,
    },
    /// The counting image failed.
    #[error("the counting image failed on {} ({status})", path.display())]
    Failed {
        /// The blob that it was given.
        path: PathBuf,
        /// How it ended.
        status: std::process::ExitStatus,
    },
    /// The counting image did not write what it should have written.
    #[error("the counting image wrote {records} records, not {expected}")]
    Records {
        /// How many came.
        records: usize,
        /// How many there should be.
        expected: usize,
    },
    /// The check of the counting failed: this QEMU does not count.
    #[error("a block of {KNOWN_INSTRUCTIONS} instructions was counted as {counted}")]
    Miscounted {
        /// What came out.
        counted: i64,
    },
    /// Some work takes more instructions than the counter holds.
    #[error("{}: some of its work takes more instructions than can be counted, some two millions", path.display())]
    TooLong {
        /// The blob.
        path: PathBuf,
    },
    /// The runtime gave no result where it gave one on this computer.
    #[error("{}: `{what}` came to no result in {failed} runs", path.display())]
    NoResult {
        /// The blob.
        path: PathBuf,
        /// The work.
        what: &'static str,
        /// Runs without result.
        failed: usize,
    },
}
