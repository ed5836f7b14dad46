//! Where cameras and boards stand, as far as the quick look knows; the first camera's frame is the rig's.

use super::look::Look;
use super::whole_camera::WholeCamera;
use calib_rays::geometry::RigidTransform;

/// Cameras and boards in one frame.
pub struct Placed {
    /// Per camera; `None` where it shares too few poses.
    pub camera_from_rig: Vec<Option<RigidTransform>>,
    /// Per pose index; `None` where no camera that is placed can say.
    pub rig_from_board: Vec<Option<RigidTransform>>,
}

impl Placed {
    /// By what the cameras' views agree on; each board by the camera of lowest number.
    pub fn of(look: &Look<'_>, cameras: &[WholeCamera]) -> Self {
        let mut camera_from_rig: Vec<Option<RigidTransform>> = vec![None; look.cameras.len()];
        if let Some(first) = camera_from_rig.first_mut() {
            *first = Some(RigidTransform::identity());
        }
        for whole in cameras {
            camera_from_rig[whole.camera_idx] =
                camera_from_rig[whole.reference].map(|t| whole.agreed.second_from_first * t);
        }
        let mut rig_from_board = vec![None; look.observations.poses.len()];
        for (view, fit) in look.observations.views.iter().zip(&look.fits) {
            if let (None, Some(fit), Some(camera_from_rig)) = (
                rig_from_board[view.pose_idx],
                fit,
                camera_from_rig[view.camera_idx],
            ) {
                rig_from_board[view.pose_idx] =
                    Some(camera_from_rig.inverse() * fit.camera_from_board);
            }
        }
        Self {
            camera_from_rig,
            rig_from_board,
        }
    }
}
