//! An estimate in the frame that users get: the board at the datum pose.

use super::Estimate;
use calib_rays::field::{CalibratedCamera, CoverageMask, Rig};
use calib_rays::geometry::RigidTransform;
use nalgebra::Vector3;

impl Estimate {
    /// The calibrated rig. The datum is the first pose used, or the frame of poses that are known; the calibrated area of a camera is
    /// that of the corners that count.
    ///
    /// `names` are those of the cameras, in order.
    pub fn rig(&self, names: &[String]) -> Rig {
        let cameras = self
            .model
            .cameras
            .iter()
            .zip(names)
            .enumerate()
            .map(|(camera_idx, (camera, name))| CalibratedCamera {
                name: name.clone(),
                coverage: self.coverage(camera_idx),
                field: camera.field.clone(),
                rig_from_camera: self.datum_from_model() * camera.camera_from_rig.inverse(),
            })
            .collect();
        Rig {
            cameras,
            datum_pose: self.observations.poses.first().copied().unwrap_or(0),
            frame_is_known: self.model.has_known_poses(),
            match_noise_px: None,
            uncertainty: Vec::new(),
        }
    }

    /// Per pose of the observations, in the rig's frame.
    pub fn rig_from_board(&self) -> Vec<RigidTransform> {
        let datum = self.datum_from_model();
        self.model
            .rig_from_board
            .iter()
            .map(|pose| datum * *pose)
            .collect()
    }

    /// Distances from the first camera to the middles of the boards, mm, rising. `rig` is that of
    /// [`Self::rig`].
    pub fn board_distances_mm(&self, rig: &Rig) -> Vec<f64> {
        let center_in_board = self.observations.board.center_in_board();
        let camera = rig.cameras.first().map(|camera| camera.rig_from_camera);
        let place = camera.map_or_else(Vector3::zeros, |camera| camera.translation_mm);
        let mut distances: Vec<f64> = self
            .rig_from_board()
            .iter()
            .map(|pose| (pose.point(&center_in_board) - place).norm())
            .collect();
        distances.sort_by(f64::total_cmp);
        distances
    }

    /// From the frame of the model to the one that users get.
    pub(super) fn datum_from_model(&self) -> RigidTransform {
        let frame_pose = self.model.frame_pose();
        frame_pose
            .and_then(|pose_idx| self.model.rig_from_board.get(pose_idx))
            .map_or_else(RigidTransform::identity, RigidTransform::inverse)
    }

    fn coverage(&self, camera_idx: usize) -> CoverageMask {
        self.observations.coverage(camera_idx, |view, corner| {
            self.robust_weights[view][corner] > 0.0
        })
    }
}
