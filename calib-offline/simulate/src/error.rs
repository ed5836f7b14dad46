//! Why a dataset could not be simulated.

use super::settings::SceneError;
use std::path::PathBuf;

/// Why a dataset could not be simulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// The settings make no scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The output path is a file.
    #[error("{}: the output must be a folder, and this is a file", .path.display())]
    OutputIsFile {
        /// The path given.
        path: PathBuf,
    },
    /// The output folder holds something.
    #[error("{}: the folder is not empty; --force replaces it with everything in it", .path.display())]
    OutputNotEmpty {
        /// The path given.
        path: PathBuf,
    },
    /// An argument cannot be read.
    #[error("{option} {text:?}: expected {expected}")]
    Argument {
        /// The option.
        option: &'static str,
        /// What was given.
        text: String,
        /// What would be right.
        expected: &'static str,
    },
    /// No point of the swept volume is seen by all cameras.
    #[error("only {have} of {need} matches found: the cameras hardly see the board together")]
    TooFewMatches {
        /// How many were asked for.
        need: usize,
        /// How many there are.
        have: usize,
    },
    /// Reading or writing a file.
    #[error("{}: {source}", .path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Encoding an image.
    #[error("{}: {source}", .path.display())]
    Image {
        /// Which.
        path: PathBuf,
        /// Why.
        source: image::ImageError,
    },
}
