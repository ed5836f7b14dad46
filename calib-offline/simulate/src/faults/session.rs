//! A recording session: how every camera takes every pose, each as it is at that moment.

use crate::optics::CameraOptics;
use crate::scene::{Scene, bowed_corner, see_board_point};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use calib_rays::observed::View;
use nalgebra::Vector3;

/// Indices of cameras.
pub(super) const LEFT: &[usize] = &[0];
pub(super) const RIGHT: &[usize] = &[1];
pub(super) const BOTH: &[usize] = &[0, 1];

/// How one camera sees one pose.
#[derive(Debug, Clone)]
pub struct Take {
    /// The camera as it is then.
    pub camera: CameraOptics,
    /// Where it stands then.
    pub left_from_camera: RigidTransform,
    /// Where the board is when this camera exposes.
    pub left_from_board: RigidTransform,
    /// Height of the board's outermost corners over its middle, mm.
    pub bow_mm: f64,
    /// Where a nominal corner of the board really is: x scaled, and x that grows with y.
    pub stretch_and_shear: [f64; 2],
    /// How far right the last line is read later than the first, px.
    pub skew_px: f64,
}

impl Take {
    /// The pixel of a corner of the board, without noise.
    fn corner(&self, board: &BoardSpec, row: usize, col: usize) -> Option<PixelPoint> {
        let nominal = bowed_corner(board, self.bow_mm, row, col);
        let [stretch, shear] = self.stretch_and_shear;
        let corner = Vector3::new(
            nominal.x * stretch + nominal.y * shear,
            nominal.y,
            nominal.z,
        );
        let pixel = see_board_point(
            &self.camera,
            &self.left_from_camera,
            &self.left_from_board,
            &corner,
        )?;
        let height = f64::from(self.camera.sensor().height);
        let line = pixel.v / height - 0.5;
        Some(PixelPoint::new(pixel.u + self.skew_px * line, pixel.v))
    }
}

/// All takes of a scene.
#[derive(Debug, Clone)]
pub struct Session {
    /// The rig as it is at the beginning, and where the board was shown.
    pub scene: Scene,
    /// Camera by camera, pose by pose.
    pub takes: Vec<Vec<Take>>,
}

impl Session {
    /// Nothing changes and nothing is wrong.
    pub fn faultless(scene: Scene) -> Self {
        let takes = (0..scene.cameras.len())
            .map(|camera_idx| {
                let take = |pose: &RigidTransform| Take {
                    camera: scene.cameras[camera_idx].clone(),
                    left_from_camera: scene.left_from_camera[camera_idx],
                    left_from_board: *pose,
                    bow_mm: scene.settings.bow_mm,
                    stretch_and_shear: [1.0, 0.0],
                    skew_px: 0.0,
                };
                scene.true_poses.iter().map(take).collect()
            })
            .collect();
        Self { scene, takes }
    }

    /// Number of poses.
    pub fn pose_count(&self) -> usize {
        self.scene.true_poses.len()
    }

    /// The takes of some cameras in the second half of the poses.
    pub fn second_half(&mut self, cameras: &[usize]) -> impl Iterator<Item = &mut Take> {
        let half = self.pose_count() / 2;
        self.takes_of(cameras)
            .filter_map(move |(pose, take)| (pose >= half).then_some(take))
    }

    /// All takes of some cameras, with their poses.
    pub fn takes_of(&mut self, cameras: &[usize]) -> impl Iterator<Item = (usize, &mut Take)> {
        let takes = self.takes.iter_mut().enumerate();
        takes
            .filter(|(camera_idx, _)| cameras.contains(camera_idx))
            .flat_map(|(_, takes)| takes.iter_mut().enumerate())
    }

    /// What a corner finder reports: views in the order camera, pose.
    pub fn views(&self) -> Vec<View> {
        let board = &self.scene.settings.board;
        let mut views = Vec::new();
        for (camera_idx, takes) in self.takes.iter().enumerate() {
            for (pose, take) in takes.iter().enumerate() {
                let corners = self
                    .scene
                    .observe_view(camera_idx, pose, |row, col| take.corner(board, row, col));
                if !corners.is_empty() {
                    views.push(View {
                        camera_idx,
                        pose,
                        corners,
                    });
                }
            }
        }
        views
    }

    /// The rig as it is after the last pose.
    pub fn rig_at_the_end(&self) -> (Vec<CameraOptics>, Vec<RigidTransform>) {
        let last = self.takes.iter().filter_map(|takes| takes.last());
        last.map(|take| (take.camera.clone(), take.left_from_camera))
            .unzip()
    }
}
