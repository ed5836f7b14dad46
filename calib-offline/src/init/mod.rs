//! Initialization: from labelled corners to fields, poses and extrinsics good enough to adjust.
//!
//! Zhang's closed form is no starting point here: a rotation about one axis parallel to the board
//! is a near-critical motion for it, and it knows no distortion. Instead ([`focal_scan`]) each
//! camera tries ideal lenses of many focal lengths and two kinds, places every board by its
//! bearings ([`bearing_pose`]), and refines the best few with a cubic field; the cameras are then
//! joined over their common poses ([`rig`]). METHOD section 3.

pub mod bearing_pose;
pub mod focal_scan;
pub mod rig;

pub use crate::dataset::sufficiency::MIN_POSES;
use crate::geometry::SensorSize;

/// Fewest corners that place a board.
pub const MIN_CORNERS: usize = 6;

/// Why no starting point was found. All mean that the data cannot determine the answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InitError {
    /// Not enough poses with usable corners.
    #[error(
        "camera {camera_idx} sees {have} usable pose(s) of the board, at least {MIN_POSES} are needed \
         (a pose is usable with {MIN_CORNERS} corners that do not lie on one line)"
    )]
    TooFewPoses {
        /// Index of the camera.
        camera_idx: usize,
        /// Usable poses.
        have: usize,
    },
    /// No ideal lens explains the corners even roughly.
    #[error(
        "camera {camera_idx}: no lens explains its corners: the best leaves a median residual of \
         {median_px:.1} px on a {sensor} sensor"
    )]
    NoLens {
        /// Index of the camera.
        camera_idx: usize,
        /// Best median residual.
        median_px: f64,
        /// The sensor.
        sensor: SensorSize,
    },
    /// A camera shares no pose with those already placed.
    #[error("camera {camera_idx} shares no pose with the other cameras")]
    NoCommonPose {
        /// Index of the camera.
        camera_idx: usize,
    },
}
