//! A stereo rig before a chessboard on a rotation stage, and what its cameras record.

use super::displaced::Displaced;
use super::optics::CameraOptics;
use super::pattern::Pattern;
use super::preset::{self, RigPreset};
use super::render::{PlateView, RenderSettings, Rendered};
use super::settings::{SceneError, SceneSettings};
use super::stage::{self, Placement, Wobble};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::hull::{convex_hull, hull_contains};
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, so3};
use nalgebra::Vector3;

/// A corner seen at a flatter angle than this against the board's normal (75 degrees) is lost to
/// any detector.
const MIN_FACING_COS: f64 = 0.26;

/// How far the board goes on before a late exposure: some 2 px on the standard rigs.
const LATE_SHIFT_MM: Vector3<f64> = Vector3::new(0.3, -0.1, 0.15);
/// And how it turns meanwhile.
const LATE_TURN_DEG: Vector3<f64> = Vector3::new(0.05, 0.3, -0.02);

/// A rig, a board and the truth about them. Poses are in the rig frame, which is the left camera's.
#[derive(Debug, Clone)]
pub struct Scene {
    /// What was asked for.
    pub settings: SceneSettings,
    /// Left and right camera.
    pub cameras: Vec<CameraOptics>,
    /// Their names.
    pub names: Vec<&'static str>,
    /// `left_from_camera`, the identity first.
    pub left_from_camera: Vec<RigidTransform>,
    /// `left_from_board` of every pose: all angles of the first placement, then the next.
    pub true_poses: Vec<RigidTransform>,
    /// Dial reading of every pose, degrees.
    pub pose_angles_deg: Vec<f64>,
    /// Placement of every pose.
    pub pose_placements: Vec<usize>,
    /// Where the stage stood.
    pub placements: Vec<Placement>,
    pub(super) rig: RigPreset,
}

impl Scene {
    /// Builds the scene.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] if a setting makes no sense.
    pub fn new(settings: SceneSettings) -> Result<Self, SceneError> {
        let mut rig = preset::rig(settings.optics, settings.sensor);
        rig.scale_spread(settings.spread);
        let placements = preset::placements(&rig, settings.placements, settings.seed);
        Self::of_rig(settings, rig, placements)
    }

    /// A rig that no preset knows, its stage at the placements given.
    pub(super) fn of_rig(
        settings: SceneSettings,
        rig: RigPreset,
        placements: Vec<Placement>,
    ) -> Result<Self, SceneError> {
        settings.check()?;
        let left_from_bench = rig.bench_from_camera[0].inverse();
        let wobble = Wobble {
            runout_mm: settings.runout_mm,
            wobble_deg: settings.wobble_deg,
        };
        let mut scene = Self {
            cameras: rig.cameras.to_vec(),
            names: vec!["left", "right"],
            left_from_camera: vec![
                RigidTransform::identity(),
                left_from_bench * rig.bench_from_camera[1],
            ],
            true_poses: Vec::new(),
            pose_angles_deg: Vec::new(),
            pose_placements: Vec::new(),
            placements,
            rig,
            settings,
        };
        for (placement_idx, placement) in scene.placements.iter().enumerate() {
            for &angle_deg in &scene.settings.angles_deg {
                let bench_from_board = stage::bench_from_board(
                    placement,
                    &scene.rig.mount,
                    &scene.settings.board,
                    angle_deg,
                    &stage::draw_wobble(scene.settings.seed, scene.true_poses.len(), &wobble),
                );
                scene.true_poses.push(left_from_bench * bench_from_board);
                scene.pose_angles_deg.push(angle_deg);
                scene.pose_placements.push(placement_idx);
            }
        }
        Ok(scene)
    }

    /// The ray of a pixel in its camera's frame, mm; `None` where the optics form no image.
    pub fn true_ray(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray> {
        self.cameras.get(camera_idx)?.ray(pixel)
    }

    /// The ray of a pixel in the rig (left camera) frame, mm.
    pub fn true_ray_in_left(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray> {
        let left_from_camera = self.left_from_camera.get(camera_idx)?;
        Some(
            self.true_ray(camera_idx, pixel)?
                .transformed(left_from_camera),
        )
    }

    /// The pixel that sees a point of the rig (left camera) frame; `None` beyond the sensor's edge.
    pub fn true_project(
        &self,
        camera_idx: usize,
        point_in_left: &Vector3<f64>,
    ) -> Option<PixelPoint> {
        let camera_from_left = self.left_from_camera.get(camera_idx)?.inverse();
        self.cameras
            .get(camera_idx)?
            .project(&camera_from_left.point(point_in_left))
    }

    /// Where a corner really is on the board, bow included, board frame, mm.
    pub fn corner_in_board(&self, row: usize, col: usize) -> Vector3<f64> {
        bowed_corner(&self.settings.board, self.settings.bow_mm, row, col)
    }

    /// Where a corner of a pose falls on a sensor, without noise; `None` if the camera does not
    /// see it (beyond the edge, from behind, or at too flat an angle).
    pub fn true_corner(
        &self,
        camera_idx: usize,
        pose: usize,
        row: usize,
        col: usize,
    ) -> Option<PixelPoint> {
        let left_from_board = self.true_poses.get(pose)?;
        self.project_board_point(camera_idx, left_from_board, &self.corner_in_board(row, col))
    }

    /// Where the board is when a camera exposes a pose, left camera frame: the true pose, save for
    /// the right camera's late exposures. `pose` must exist.
    pub fn exposed_pose(&self, camera_idx: usize, pose: usize) -> RigidTransform {
        let left_from_board = self.true_poses[pose];
        if camera_idx == 0 || !self.settings.unsynchronized_poses.contains(&pose) {
            return left_from_board;
        }
        let middle_in_board = self.settings.board.center_in_board();
        let turn = so3::exp(&LATE_TURN_DEG.map(f64::to_radians));
        let board_from_late = RigidTransform::new(
            turn,
            middle_in_board - turn * middle_in_board + LATE_SHIFT_MM,
        );
        left_from_board * board_from_late
    }

    /// As [`Self::true_corner`], for any point of a board at any pose.
    pub(super) fn project_board_point(
        &self,
        camera_idx: usize,
        left_from_board: &RigidTransform,
        point_in_board: &Vector3<f64>,
    ) -> Option<PixelPoint> {
        let camera = self.cameras.get(camera_idx)?;
        let left_from_camera = self.left_from_camera.get(camera_idx)?;
        see_board_point(camera, left_from_camera, left_from_board, point_in_board)
    }

    /// The board at a pose as a camera takes it, sensor noise included.
    ///
    /// `camera_idx` and `pose` must exist.
    pub fn render_board(
        &self,
        camera_idx: usize,
        pose: usize,
        settings: &RenderSettings,
    ) -> Rendered {
        let camera_from_left = self.left_from_camera[camera_idx].inverse();
        let mut view = PlateView {
            camera: &self.cameras[camera_idx],
            camera_from_plate: camera_from_left * self.exposed_pose(camera_idx, pose),
            pattern: Pattern::Chessboard(self.settings.board.clone()),
            bow_mm: self.settings.bow_mm,
            displaced: None,
        };
        if settings.is_displaced {
            view.displaced = Some(self.displaced(camera_idx, pose, &view));
        }
        let mut image = view.render(settings);
        if settings.noise_levels > 0.0 {
            image.add_noise(settings.noise_levels, self.settings.seed, camera_idx, pose);
        }
        image
    }

    /// What moves the image of every corner by its noise; a corner that is not seen stays where it is.
    fn displaced(&self, camera_idx: usize, pose: usize, view: &PlateView<'_>) -> Displaced {
        let board = &self.settings.board;
        let left_from_board = self.exposed_pose(camera_idx, pose);
        let displacement_mm = |k: usize, [du, dv]: [f64; 2]| {
            let corner = self.corner_in_board(k / board.cols, k % board.cols);
            let clean = self.project_board_point(camera_idx, &left_from_board, &corner)?;
            let seen = view.plate_point(PixelPoint::new(clean.u + du, clean.v + dv))?;
            Some(seen - corner.xy())
        };
        let noise_px = self.noise_px(camera_idx, pose).into_iter().enumerate();
        let corners_mm =
            noise_px.map(|(k, noise_px)| displacement_mm(k, noise_px).unwrap_or_default());
        Displaced::new(board.clone(), corners_mm.collect())
    }

    /// The ring target as a camera takes it, with the sensor noise of a stream.
    ///
    /// `camera_idx` must exist.
    pub fn render_target(
        &self,
        camera_idx: usize,
        left_from_target: &RigidTransform,
        settings: &RenderSettings,
        stream: usize,
    ) -> Rendered {
        let camera_from_left = self.left_from_camera[camera_idx].inverse();
        let view = PlateView {
            camera: &self.cameras[camera_idx],
            camera_from_plate: camera_from_left * *left_from_target,
            pattern: Pattern::RingTarget,
            bow_mm: 0.0,
            displaced: None,
        };
        let mut image = view.render(settings);
        image.add_noise(
            settings.noise_levels,
            self.settings.seed,
            camera_idx,
            stream,
        );
        image
    }

    /// Share of a camera's image that lies inside the hull of all its corners; of a fisheye's
    /// sensor only the image circle counts.
    pub fn hull_share(&self, camera_idx: usize) -> f64 {
        let Some(camera) = self.cameras.get(camera_idx) else {
            return 0.0;
        };
        let board = &self.settings.board;
        let mut corners = Vec::new();
        for pose in 0..self.true_poses.len() {
            for row in 0..board.rows {
                for col in 0..board.cols {
                    corners.extend(self.true_corner(camera_idx, pose, row, col));
                }
            }
        }
        let hull = convex_hull(corners);
        let sensor = camera.sensor();
        let (mut in_image, mut in_hull) = (0, 0);
        for k in 0..64 * 48 {
            let pixel = PixelPoint::new(
                (f64::from(k % 64) + 0.5) / 64.0 * f64::from(sensor.width) - 0.5,
                (f64::from(k / 64) + 0.5) / 48.0 * f64::from(sensor.height) - 0.5,
            );
            if camera.ray(pixel).is_some() {
                in_image += 1;
                in_hull += i32::from(hull_contains(&hull, pixel));
            }
        }
        f64::from(in_hull) / f64::from(in_image.max(1))
    }
}

/// Where a corner is on a board whose outermost corners stand `bow_mm` over its middle, board
/// frame, mm.
pub(super) fn bowed_corner(board: &BoardSpec, bow_mm: f64, row: usize, col: usize) -> Vector3<f64> {
    let mut corner = board.corner_in_board(row, col);
    let (width_mm, height_mm) = board.extent_mm();
    let x = 2.0 * corner.x / width_mm - 1.0;
    let y = 2.0 * corner.y / height_mm - 1.0;
    corner.z = bow_mm * (x * x + y * y) / 2.0;
    corner
}

/// The pixel that sees a point of a board (board frame, mm); `None` beyond the sensor's edge, from
/// behind, or at too flat an angle.
pub(super) fn see_board_point(
    camera: &CameraOptics,
    left_from_camera: &RigidTransform,
    left_from_board: &RigidTransform,
    point_in_board: &Vector3<f64>,
) -> Option<PixelPoint> {
    let point_in_left = left_from_board.point(point_in_board);
    let pixel = camera.project(&left_from_camera.inverse().point(&point_in_left))?;
    let ray = camera.ray(pixel)?.transformed(left_from_camera);
    let facing = ray.direction.dot(&left_from_board.rotation.column(2));
    (facing > MIN_FACING_COS).then_some(pixel)
}
