//! Why there is no starting point.

use super::{MIN_CORNERS, MIN_POSES};
use calib_rays::geometry::SensorSize;

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
    /// The corners look as if seen by parallel rays.
    #[error(
        "camera {camera_idx} sees the boards without perspective: parallel projection leaves a \
         median residual of {parallel_px:.2} px, the best lens {lens_px:.2} px; rays that are all \
         parallel (a telecentric lens) do not tell how far away and which way tilted a flat board \
         is, and cannot be calibrated from it"
    )]
    ParallelRays {
        /// Index of the camera.
        camera_idx: usize,
        /// Median residual of the best parallel projection of each board.
        parallel_px: f64,
        /// Median residual of the best lens.
        lens_px: f64,
    },
    /// The common poses of two cameras contradict each other.
    #[error(
        "cameras {reference_idx} and {camera_idx} see the board in {pairs} common pose(s), but no \
         one placement of the two explains most of them: the middle pair misses by {misfit_px:.1} \
         px (images of different instants paired, the board numbered differently, or a camera \
         that moved)"
    )]
    CamerasDisagree {
        /// Index of the camera that was to be placed.
        camera_idx: usize,
        /// Index of the camera that it was compared with.
        reference_idx: usize,
        /// Root mean square over corners of what the middle pair misses by, px.
        misfit_px: f64,
        /// Number of common poses.
        pairs: usize,
    },
    /// A camera shares no pose with those already placed.
    #[error("camera {camera_idx} shares no pose with the other cameras")]
    NoCommonPose {
        /// Index of the camera.
        camera_idx: usize,
    },
}
