//! Why methods cannot be compared.

use crate::pipeline::CalibrateError;
use calib_blob::matches::MatchesError;
use calib_rays::remedy::Remedy;

/// Why methods cannot be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// Unusable input, or no method has an answer.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// Files of matches whose truth is known.
    #[error(transparent)]
    Matches(#[from] MatchesError),
}

impl Remedy for CompareError {
    fn remedy(&self) -> Option<String> {
        match self {
            Self::Calibrate(error) => error.remedy(),
            Self::Matches(error) => error.remedy(),
        }
    }
}
