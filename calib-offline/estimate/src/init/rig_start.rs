//! What an initialization hands on.

use super::screening::Finding;
use crate::adjust::Observations;
use calib_rays::field::RayField;
use calib_rays::geometry::RigidTransform;

/// A starting point for the estimate of everything. The rig frame is that of camera 0, or of known poses.
#[derive(Debug, Clone)]
pub struct RigStart {
    /// What can be adjusted together: the views offered, screened.
    pub observations: Observations,
    /// What the screening did.
    pub findings: Vec<Finding>,
    /// Cubic field per camera.
    pub fields: Vec<RayField>,
    /// Per camera; the identity for camera 0, unless poses are known.
    pub camera_from_rig: Vec<RigidTransform>,
    /// Per pose index of the observations; `None` where no camera could place the board.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Median length of the residual vectors per camera, px, each camera by itself.
    pub median_px: Vec<f64>,
}
