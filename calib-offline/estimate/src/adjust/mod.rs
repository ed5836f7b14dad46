//! Bundle adjustment: ray fields, poses, extrinsics and board shape moved together until the
//! residuals are smallest. Initialization uses it on a few boards of one camera, the joint estimate
//! on everything. METHOD 2.1 to 2.5.

mod assembly;
mod components;
pub mod covariance;
pub mod knots;
pub mod levenberg;
pub mod model;
mod moments;
pub mod normal_equations;
pub mod objective;
pub mod observations;
pub mod priors;
pub mod reduced;
pub mod residual;
pub mod robust;
mod spline_block;
#[cfg(test)]
mod tests;

pub use levenberg::{Outcome, StopReason};
pub use model::{CameraModel, Model};
pub use observations::Observations;
