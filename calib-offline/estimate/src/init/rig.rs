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

/// The same where poses are known beforehand: from all of these as one target; then every pose by itself, those
/// known where they are known to be. The rig's frame is theirs, and views of known poses are not screened.
fn start_known(observations: &Observations) -> Result<RigStart, InitError> {
    let mut start = start_free(&observations.with_known_as_one())?;
    let of_number = |pose: usize| start.observations.poses.binary_search(&pose).ok();
    let first = observations.known_poses.keys().next().copied();
    let first_from_known = first
        .and_then(of_number)
        .and_then(|idx| start.rig_from_board[idx])
        .unwrap_or_else(RigidTransform::identity);
    let known_from_first = first_from_known.inverse();
    start.rig_from_board = observations
        .poses
        .iter()
        .map(|pose| match observations.known_poses.get(pose) {
            Some(known) => Some(known.rig_from_board),
            None => Some(known_from_first * start.rig_from_board[of_number(*pose)?]?),
        })
        .collect();
    for camera_from_rig in &mut start.camera_from_rig {
        *camera_from_rig = *camera_from_rig * first_from_known;
    }
    start.findings.clear();
    start.observations = observations.clone();
    Ok(start)
}

/// Starts every camera by itself, then joins them over their common poses; views that cannot be
/// what they claim are found on the way ([`screen`]).
///
/// # Errors
/// What [`start_camera`] says of any camera; what [`screen`] says of their common poses.
pub fn start_rig(observations: &Observations) -> Result<RigStart, InitError> {
    if observations.known_poses.is_empty() {
        start_free(observations)
    } else {
        start_known(observations)
    }
}

fn start_free(observations: &Observations) -> Result<RigStart, InitError> {
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
