//! A stereo rig before a chessboard on a rotation stage, and what its cameras record.

use super::matches::{contains, convex_hull};
use super::optics::CameraOptics;
use super::pattern::Pattern;
use super::preset::{self, OpticsKind, RigPreset};
use super::random::{self, Purpose};
use super::render::{PlateView, RenderSettings, Rendered};
use super::stage::{self, Placement, Wobble};
use crate::board::BoardSpec;
use crate::dataset::{Corner, View};
use crate::geometry::{PixelPoint, Ray, RigidTransform, SensorSize};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A corner seen at a flatter angle than this against the board's normal (75 degrees) is lost to
/// any detector.
const MIN_FACING_COS: f64 = 0.26;

/// What to simulate. The default is the standard dataset of the pinhole rig, free of noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneSettings {
    /// Optics and rig.
    pub optics: OpticsKind,
    /// Sensor of both cameras (of the left one, for unequal rigs).
    pub sensor: SensorSize,
    /// The board.
    pub board: BoardSpec,
    /// How often the stage is put somewhere else.
    pub placements: usize,
    /// Dial readings at each placement, degrees.
    pub angles_deg: Vec<f64>,
    /// Standard deviation of the corners per axis, px.
    pub noise_px: f64,
    /// Standard deviation of the pixels of matches per axis, px.
    pub match_noise_px: f64,
    /// Share of corners that are not found.
    pub missing_share: f64,
    /// Share of corners that are displaced by 3 to 10 px.
    pub outlier_share: f64,
    /// Out-of-plane height of the board's outermost corners over its middle, mm (a paraboloid).
    pub bow_mm: f64,
    /// Run-out of the stage at the board's middle, standard deviation per axis, mm.
    pub runout_mm: f64,
    /// Wobble of the stage, standard deviation per axis, degrees.
    pub wobble_deg: f64,
    /// Of everything random.
    pub seed: u64,
}

impl Default for SceneSettings {
    fn default() -> Self {
        Self::standard(OpticsKind::Brown, 1)
    }
}

impl SceneSettings {
    /// The standard dataset of a rig without corner noise: 2 placements x 17 angles (-40 to 40 by
    /// 5 degrees), for the fisheye 5 x 9 (by 10 degrees). Matches carry 0.05 px.
    pub fn standard(optics: OpticsKind, seed: u64) -> Self {
        let (placements, half_count, step_deg) = match optics {
            OpticsKind::Fisheye => (5, 4, 10.0),
            _ => (2, 8, 5.0),
        };
        Self {
            optics,
            sensor: SensorSize::new(1280, 1024),
            board: BoardSpec {
                rows: 15,
                cols: 13,
                square_mm: 10.0,
            },
            placements,
            angles_deg: (-half_count..=half_count)
                .map(|k| f64::from(k) * step_deg)
                .collect(),
            noise_px: 0.0,
            match_noise_px: 0.05,
            missing_share: 0.0,
            outlier_share: 0.0,
            bow_mm: 0.0,
            runout_mm: 0.004,
            wobble_deg: 0.001,
            seed,
        }
    }

    /// [`Self::standard`] with 0.05 px of corner noise.
    pub fn standard_noisy(optics: OpticsKind, seed: u64) -> Self {
        Self {
            noise_px: 0.05,
            ..Self::standard(optics, seed)
        }
    }

    fn check(&self) -> Result<(), SceneError> {
        let number = |name: &'static str, value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(SceneError::OutOfRange {
                    name,
                    value,
                    low,
                    high,
                })
            }
        };
        number("board rows", self.board.rows as f64, 2.0, 1000.0)?;
        number("board columns", self.board.cols as f64, 2.0, 1000.0)?;
        number("square_mm", self.board.square_mm, 1e-3, 1e4)?;
        number("placements", self.placements as f64, 1.0, 1000.0)?;
        number(
            "number of angles",
            self.angles_deg.len() as f64,
            1.0,
            1000.0,
        )?;
        for &angle in &self.angles_deg {
            number("angle in degrees", angle, -180.0, 180.0)?;
        }
        number("noise_px", self.noise_px, 0.0, 100.0)?;
        number("match_noise_px", self.match_noise_px, 0.0, 100.0)?;
        number("missing share", self.missing_share, 0.0, 1.0)?;
        number("outlier share", self.outlier_share, 0.0, 1.0)?;
        number("bow_mm", self.bow_mm, -10.0, 10.0)?;
        number("runout_mm", self.runout_mm, 0.0, 10.0)?;
        number("wobble_deg", self.wobble_deg, 0.0, 10.0)?;
        number("sensor width", f64::from(self.sensor.width), 64.0, 20000.0)?;
        number(
            "sensor height",
            f64::from(self.sensor.height),
            64.0,
            20000.0,
        )
    }
}

/// Why a scene cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A setting makes no sense.
    #[error("{name} is {value}, it must lie between {low} and {high}")]
    OutOfRange {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The least allowed.
        low: f64,
        /// The most allowed.
        high: f64,
    },
}

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
        settings.check()?;
        let rig = preset::rig(settings.optics, settings.sensor);
        let placements = preset::placements(&rig, settings.placements, settings.seed);
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
        let board = &self.settings.board;
        let mut corner = board.corner_in_board(row, col);
        let (width_mm, height_mm) = board.extent_mm();
        let x = 2.0 * corner.x / width_mm - 1.0;
        let y = 2.0 * corner.y / height_mm - 1.0;
        corner.z = self.settings.bow_mm * (x * x + y * y) / 2.0;
        corner
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

    /// As [`Self::true_corner`], for any point of a board at any pose.
    pub(super) fn project_board_point(
        &self,
        camera_idx: usize,
        left_from_board: &RigidTransform,
        point_in_board: &Vector3<f64>,
    ) -> Option<PixelPoint> {
        let point = left_from_board.point(point_in_board);
        let pixel = self.true_project(camera_idx, &point)?;
        let ray = self.true_ray_in_left(camera_idx, pixel)?;
        let facing = ray.direction.dot(&left_from_board.rotation.column(2));
        (facing > MIN_FACING_COS).then_some(pixel)
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
        let view = PlateView {
            camera: &self.cameras[camera_idx],
            camera_from_plate: camera_from_left * self.true_poses[pose],
            pattern: Pattern::Chessboard(self.settings.board),
            bow_mm: self.settings.bow_mm,
        };
        let mut image = view.render(settings);
        if settings.noise_levels > 0.0 {
            image.add_noise(settings.noise_levels, self.settings.seed, camera_idx, pose);
        }
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
                in_hull += i32::from(contains(&hull, pixel));
            }
        }
        f64::from(in_hull) / f64::from(in_image.max(1))
    }

    /// What a detector would report: every visible corner with noise, some missing, some wrong.
    ///
    /// Views in the order camera, pose; corners in the order row, column. A view without corners
    /// is left out.
    pub fn observe_corners(&self) -> Vec<View> {
        let mut views = Vec::new();
        for camera_idx in 0..self.cameras.len() {
            for pose in 0..self.true_poses.len() {
                let corners = self.observe_view(camera_idx, pose);
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

    fn observe_view(&self, camera_idx: usize, pose: usize) -> Vec<Corner> {
        let settings = &self.settings;
        let stream = |purpose| random::stream(settings.seed, purpose, camera_idx, pose);
        let mut noise_rng = stream(Purpose::Noise);
        let mut missing_rng = stream(Purpose::Missing);
        let mut outlier_rng = stream(Purpose::Outliers);
        let sensor = self.cameras[camera_idx].sensor();
        let mut corners = Vec::new();
        for row in 0..settings.board.rows {
            for col in 0..settings.board.cols {
                // Drawn for every corner, seen or not: what one corner gets depends on no other.
                let noise = [
                    random::normal(&mut noise_rng),
                    random::normal(&mut noise_rng),
                ];
                let is_missing = random::uniform(&mut missing_rng) < settings.missing_share;
                let is_outlier = random::uniform(&mut outlier_rng) < settings.outlier_share;
                let outlier_px = random::between(&mut outlier_rng, 3.0, 10.0);
                let outlier_angle = random::between(&mut outlier_rng, 0.0, std::f64::consts::TAU);
                let Some(clean) = self.true_corner(camera_idx, pose, row, col) else {
                    continue;
                };
                let mut pixel = PixelPoint::new(
                    clean.u + settings.noise_px * noise[0],
                    clean.v + settings.noise_px * noise[1],
                );
                if is_outlier {
                    pixel.u += outlier_px * outlier_angle.cos();
                    pixel.v += outlier_px * outlier_angle.sin();
                }
                if !is_missing && sensor.contains(pixel) {
                    corners.push(Corner {
                        row,
                        col,
                        pixel,
                        sigma_px: None,
                    });
                }
            }
        }
        corners
    }
}
