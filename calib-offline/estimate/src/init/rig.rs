//! All cameras in the frame of the first, all poses in it.

use super::InitError;
use super::focal_scan::start_camera;
use super::pair_consensus::COARSE_LIMIT_SIGMA;
use super::screening::{Finding, screen};
use crate::adjust::Observations;
use calib_rays::board::BoardShape;
use calib_rays::field::RayField;
use calib_rays::geometry::RigidTransform;
use calib_rays::in_order;

/// A starting point for the estimate of everything. The rig frame is that of camera 0.
#[derive(Debug, Clone)]
pub struct RigStart {
    /// What can be adjusted together: the views offered, screened.
    pub observations: Observations,
    /// What the screening did.
    pub findings: Vec<Finding>,
    /// Cubic field per camera.
    pub fields: Vec<RayField>,
    /// Per camera; the identity for camera 0.
    pub camera_from_rig: Vec<RigidTransform>,
    /// Per pose index of the observations; `None` where no camera could place the board.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Median length of the residual vectors per camera, px, each camera by itself.
    pub median_px: Vec<f64>,
}

/// Starts every camera by itself, then joins them over their common poses; views that cannot be
/// what they claim are found on the way ([`screen`]).
///
/// # Errors
/// What [`start_camera`] says of any camera; what [`screen`] says of their common poses.
pub fn start_rig(observations: &Observations) -> Result<RigStart, InitError> {
    let cameras = in_order::try_map(0..observations.sensors.len(), |idx| {
        start_camera(&observations.of_camera(idx), idx)
    })?;
    let median_px = cameras.iter().map(|camera| camera.median_px).collect();
    let fields: Vec<RayField> = cameras.into_iter().map(|camera| camera.field).collect();
    let seen_through: Vec<&RayField> = fields.iter().collect();
    let screened = screen(
        observations,
        &seen_through,
        &BoardShape::default(),
        COARSE_LIMIT_SIGMA,
    )?;
    Ok(RigStart {
        observations: screened.observations,
        findings: screened.findings,
        camera_from_rig: screened.camera_from_rig,
        rig_from_board: screened.rig_from_board,
        fields,
        median_px,
    })
}
