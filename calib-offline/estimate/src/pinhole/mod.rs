//! The baseline: a pinhole with Brown-Conrady distortion per camera, calibrated from Zhang's closed
//! form, and the places of the cameras to each other; what the publication compares with, and what
//! `OpenCV`'s `calibrateCamera` and `stereoCalibrate` compute from the same corners.
//!
//! [`calibrate_camera()`] takes one camera at a time: homographies ([`homography`]), focal lengths in
//! closed form ([`zhang()`]), then all numbers and poses together ([`adjustment`]). It starts from the
//! project's own initialization too and keeps the lower minimum. [`calibrate_rig`] joins the cameras
//! over their common poses; [`PinholeRig::rig`] gives them as ray fields, for everything that measures with a rig.

pub mod adjustment;
pub mod brown;
pub mod calibrate_camera;
mod error;
pub mod field_rig;
pub mod homography;
mod reprojection;
pub mod rig;
pub mod stereo;
#[cfg(test)]
mod tests;
pub mod zhang;

pub use adjustment::{CameraDeviations, Loss, Settings};
pub use brown::BrownCamera;
pub use calibrate_camera::{CameraFit, StartKind, StartTried, calibrate_camera};
pub use error::PinholeError;
pub use field_rig::FieldRig;
pub use homography::PixelHomography;
pub use rig::PinholeRig;
pub use stereo::{Refine, RigSettings, calibrate_rig};
pub use zhang::{ZhangCamera, ZhangForm, zhang};
