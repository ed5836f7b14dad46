//! All cameras in the frame of the first, all poses in it.

use super::InitError;
use super::focal_scan::{CameraStart, start_camera};
use crate::adjust::Observations;
use crate::field::RayField;
use crate::geometry::{RigidTransform, so3};
use nalgebra::Vector3;
use rayon::prelude::*;

/// A starting point for the estimate of everything. The rig frame is that of camera 0.
#[derive(Debug, Clone)]
pub struct RigStart {
    /// Cubic field per camera.
    pub fields: Vec<RayField>,
    /// Per camera; the identity for camera 0.
    pub camera_from_rig: Vec<RigidTransform>,
    /// Per pose index of the observations; `None` where no camera could place the board.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Median length of the residual vectors per camera, px, each camera by itself.
    pub median_px: Vec<f64>,
}

/// Starts every camera by itself, then joins them over their common poses.
///
/// The relative rotation is the geodesic median over the common poses, the translation the
/// componentwise median, so that a minority of wrong views does no harm (METHOD 3.4).
///
/// # Errors
/// What [`start_camera`] says of any camera; [`InitError::NoCommonPose`].
pub fn start_rig(observations: &Observations) -> Result<RigStart, InitError> {
    let camera_count = observations.sensors.len();
    let starts: Vec<CameraStart> = (0..camera_count)
        .into_par_iter()
        .map(|idx| start_camera(&observations.of_camera(idx), idx))
        .collect::<Result<_, _>>()?;
    // Per camera and pose of the whole set.
    let camera_from_board: Vec<Vec<Option<RigidTransform>>> = (0..camera_count)
        .map(|idx| {
            let mut all = vec![None; observations.poses.len()];
            let views = observations.views.iter().filter(|v| v.camera_idx == idx);
            for (view, pose) in views.zip(&starts[idx].camera_from_board) {
                all[view.pose_idx] = *pose;
            }
            all
        })
        .collect();

    let mut rig_from_board = camera_from_board[0].clone();
    let mut camera_from_rig: Vec<Option<RigidTransform>> = vec![None; camera_count];
    camera_from_rig[0] = Some(RigidTransform::identity());
    // Always the camera with the most poses in common with what is placed already.
    for _ in 1..camera_count {
        let next = (0..camera_count)
            .filter(|idx| camera_from_rig[*idx].is_none())
            .map(|idx| (common(&camera_from_board[idx], &rig_from_board), idx))
            .max_by_key(|(pairs, idx)| (pairs.len(), usize::MAX - idx));
        let Some((pairs, idx)) = next else { break };
        let Some(transform) = robust_mean(&pairs) else {
            return Err(InitError::NoCommonPose { camera_idx: idx });
        };
        camera_from_rig[idx] = Some(transform);
        let rig_from_camera = transform.inverse();
        for (rig, camera) in rig_from_board.iter_mut().zip(&camera_from_board[idx]) {
            if let (None, Some(camera)) = (&rig, camera) {
                *rig = Some(rig_from_camera * *camera);
            }
        }
    }
    Ok(RigStart {
        median_px: starts.iter().map(|s| s.median_px).collect(),
        fields: starts.into_iter().map(|s| s.field).collect(),
        camera_from_rig: camera_from_rig
            .into_iter()
            .map(|t| t.unwrap_or_else(RigidTransform::identity))
            .collect(),
        rig_from_board,
    })
}

/// `camera_from_rig` as each common pose gives it.
fn common(
    camera_from_board: &[Option<RigidTransform>],
    rig_from_board: &[Option<RigidTransform>],
) -> Vec<(RigidTransform, RigidTransform)> {
    camera_from_board
        .iter()
        .zip(rig_from_board)
        .filter_map(|(camera, rig)| Some(((*camera)?, (*rig)?)))
        .collect()
}

fn robust_mean(pairs: &[(RigidTransform, RigidTransform)]) -> Option<RigidTransform> {
    let rotations: Vec<_> = pairs
        .iter()
        .map(|(camera, rig)| camera.rotation * rig.rotation.transpose())
        .collect();
    let rotation = so3::geodesic_median(&rotations)?;
    let median = |axis: usize| {
        let mut values: Vec<f64> = pairs
            .iter()
            .map(|(camera, rig)| (camera.translation_mm - rotation * rig.translation_mm)[axis])
            .collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    Some(RigidTransform::new(
        rotation,
        Vector3::new(median(0), median(1), median(2)),
    ))
}
