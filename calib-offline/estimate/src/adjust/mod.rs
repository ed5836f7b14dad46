//! Bundle adjustment: ray fields, poses, extrinsics and board shape moved together until the
//! residuals are smallest. Initialization uses it on a few boards of one camera, the joint estimate
//! on everything. METHOD 2.1 to 2.5.
//!
//! Here is the problem: what is seen ([`observations`]), what moves ([`model`]), what a residual is
//! ([`residual`]), what is known beforehand ([`priors`]), what is minimized ([`objective`], [`robust`])
//! and by which steps ([`levenberg`]). How the equations of a step are put together and solved quickly
//! is in [`equations`].

pub mod equations;
pub mod levenberg;
pub mod model;
pub mod objective;
pub mod observations;
pub mod prediction;
pub mod priors;
pub mod residual;
pub mod robust;
#[cfg(test)]
mod tests;

pub use calib_rays::numerics::levenberg::StopReason;
pub use levenberg::Outcome;
pub use model::{CameraModel, Model};
pub use observations::Observations;
