//! Why a method has no answer.

use calib_estimate::alternating::AlternatingError;
use calib_estimate::init::InitError;
use calib_estimate::joint::EstimateError;
use calib_estimate::pinhole::PinholeError;
use calib_rays::board::BoardSpec;
use calib_rays::remedy::Remedy;
use std::error::Error;
use std::sync::Arc;

/// Why a method has no answer. All mean that the data cannot determine it.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum MethodError {
    /// No starting point.
    #[error("no camera model explains these corners")]
    Start(#[from] InitError),
    /// No joint estimate.
    #[error("the estimate failed")]
    Joint(#[from] EstimateError),
    /// No estimate by the published procedure.
    #[error("the published procedure failed")]
    Alternating(#[from] AlternatingError),
    /// No baseline.
    #[error("the pinhole baseline failed")]
    Pinhole(#[from] PinholeError),
    /// A method for flat boards that stand at z = 0 of their own frame, and another target.
    #[error("{method} needs a flat grid whose poses are free; the target is {target}")]
    NeedsBoard {
        /// The method.
        method: &'static str,
        /// What the target is.
        target: String,
    },
    /// No answer of a method that is not one of this program's.
    #[error("the method failed")]
    Other(#[source] Arc<dyn Error + Send + Sync>),
}

impl MethodError {
    /// Refuses a target that is no flat grid.
    ///
    /// # Errors
    /// [`Self::NeedsBoard`].
    pub fn check_board(method: &'static str, board: &BoardSpec) -> Result<(), Self> {
        if board.layout.is_grid() {
            return Ok(());
        }
        Err(Self::NeedsBoard {
            method,
            target: board.words(),
        })
    }

    /// The innermost cause, in words: what a table has room for.
    pub fn reason(&self) -> String {
        let mut cause: &dyn Error = self;
        while let Some(inner) = cause.source() {
            cause = inner;
        }
        cause.to_string()
    }
}

impl Remedy for MethodError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Start(_) | Self::Joint(_) => {
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
            Self::NeedsBoard { .. } => {
                "leave --method out: the joint estimate takes points with known places"
            }
            Self::Other(_) => return None,
        };
        Some(text.to_owned())
    }
}
