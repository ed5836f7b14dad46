//! Why there is no pinhole.

use crate::init::InitError;

/// Why there is no baseline. All but the last mean that the data cannot determine it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PinholeError {
    /// Too few usable views, no perspective in them, or no pose in common with other cameras.
    #[error(transparent)]
    Init(#[from] InitError),
    /// No start led anywhere.
    #[error(
        "camera {camera_idx}: no pinhole explains its {views} usable view(s) of the board: neither \
         Zhang's closed form nor the scan of focal lengths gives a start with all boards before \
         the camera"
    )]
    NoStart {
        /// Index of the camera.
        camera_idx: usize,
        /// Usable views.
        views: usize,
    },
    /// An adjustment was to start with a board behind a camera.
    #[error(
        "camera {camera_idx} would see the board of pose {pose} behind itself: no pinhole sees \
         more than a half space, and with cameras that stand as their common poses say, this \
         view contradicts the others"
    )]
    BehindCamera {
        /// Index of the camera.
        camera_idx: usize,
        /// Number of the pose.
        pose: usize,
    },
    /// The calibrated area of a camera has no ray: the distortion folds back before it.
    #[error(
        "camera {camera_idx}: the distortion found folds back before the corners that were seen; no \
         pinhole explains this lens"
    )]
    NoRays {
        /// Index of the camera.
        camera_idx: usize,
    },
    /// No board was placed, so there is no frame for the rig.
    #[error("no board was placed")]
    NoPose,
    /// The observations have no such camera.
    #[error("there is no camera {camera_idx}, there are {have}")]
    NoSuchCamera {
        /// Index asked for.
        camera_idx: usize,
        /// Number of cameras.
        have: usize,
    },
}
