//! All cameras in the frame of the first, all poses in it.

use super::InitError;
use super::focal_scan::start_camera;
use super::known_rig;
use super::pair_consensus::COARSE_LIMIT_SIGMA;
pub use super::rig_start::RigStart;
use super::screening::screen;
use crate::adjust::Observations;
use calib_rays::board::BoardShape;
use calib_rays::field::RayField;
use calib_rays::in_order;

/// Starts every camera by itself, then joins them over their common poses; views that cannot be
/// what they claim are found on the way ([`screen`]).
///
/// # Errors
/// What [`start_camera`] says of any camera; what [`screen`] says of their common poses.
pub fn start_rig(observations: &Observations) -> Result<RigStart, InitError> {
    if observations.known_poses.is_empty() {
        start_free(observations)
    } else {
        known_rig::start(observations)
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
