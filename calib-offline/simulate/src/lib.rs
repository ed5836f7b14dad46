//! Simulated cameras with known rays: ground truth for tests, benchmarks and the sample datasets.
//!
//! [`Scene`] is a stereo rig in front of a chessboard on a rotation stage. Its optics are exact
//! ([`optics`]): a pixel's ray is a closed form, or iterated to round-off, and a point's pixel is
//! found by solving for the ray through it. Everything random comes from the seed, and each kind of
//! disturbance has its own random stream, so that switching one on leaves the others as they were.
//!
//! Shares `geometry`, `board` and the corner types of `dataset` with the estimator, and nothing
//! else: a mistake in the ray field cannot hide in both.

mod displaced;
mod error;
pub mod faults;
mod images;
pub mod matches;
mod observe;
pub mod optics;
pub mod output;
pub mod pattern;
pub mod preset;
pub mod random;
pub mod render;
pub mod scene;
pub mod settings;
pub mod shots;
pub mod stage;
mod tables;
pub mod tank;
pub mod target;
mod writer;

pub use error::SimulateError;
pub use matches::{MatchSet, TrueMatch};
pub use optics::CameraOptics;
pub use output::{SimulateSummary, write_dataset};
pub use preset::OpticsKind;
pub use render::RenderSettings;
pub use scene::Scene;
pub use settings::{ImageDepth, ImageFiles, OutputSettings, SceneError, SceneSettings};

#[cfg(test)]
mod output_tests;
#[cfg(test)]
mod render_tests;
#[cfg(test)]
mod tests;
