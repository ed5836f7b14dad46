//! What to simulate.

use super::preset::OpticsKind;
use super::render::RenderSettings;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::SensorSize;
use serde::{Deserialize, Serialize};

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
    /// How far apart the placements stand across the view, as a share of what covers the image.
    /// At 1 the image's edge cuts many boards off; with 0.3 and a board of 8 mm squares every
    /// corner of the pinhole rig is seen.
    pub spread: f64,
    /// Dial readings at each placement, degrees.
    pub angles_deg: Vec<f64>,
    /// Standard deviation of the corners per axis, px.
    pub noise_px: f64,
    /// Correlation of the noise of neighboring corners of a view; real boards have 0.2 to 0.7.
    pub noise_correlation: f64,
    /// Degrees of freedom of Student-t noise (same standard deviation, heavier tails); `None` is
    /// Gaussian.
    pub noise_tail: Option<f64>,
    /// Standard deviation of the pixels of matches per axis, px.
    pub match_noise_px: f64,
    /// Share of corners that are not found.
    pub missing_share: f64,
    /// Share of corners that are displaced by 3 to 10 px.
    pub outlier_share: f64,
    /// (camera index, pose) of views whose corners are numbered from the opposite end.
    pub flipped_views: Vec<(usize, usize)>,
    /// Poses that the right camera exposes late, after the board has moved on.
    pub unsynchronized_poses: Vec<usize>,
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
            board: BoardSpec::chessboard(15, 13, 10.0),
            placements,
            spread: 1.0,
            angles_deg: (-half_count..=half_count)
                .map(|k| f64::from(k) * step_deg)
                .collect(),
            noise_px: 0.0,
            noise_correlation: 0.0,
            noise_tail: None,
            match_noise_px: 0.05,
            missing_share: 0.0,
            outlier_share: 0.0,
            flipped_views: Vec::new(),
            unsynchronized_poses: Vec::new(),
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

    pub(super) fn check(&self) -> Result<(), SceneError> {
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
        number("spread", self.spread, 0.0, 3.0)?;
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
        number("noise correlation", self.noise_correlation, 0.0, 0.99)?;
        if let Some(nu) = self.noise_tail {
            number("noise tail", nu, 2.1, 1e6)?;
        }
        let last_pose = (self.placements * self.angles_deg.len() - 1) as f64;
        for &(camera_idx, pose) in &self.flipped_views {
            number("camera of a flipped view", camera_idx as f64, 0.0, 1.0)?;
            number("pose of a flipped view", pose as f64, 0.0, last_pose)?;
        }
        for &pose in &self.unsynchronized_poses {
            number("unsynchronized pose", pose as f64, 0.0, last_pose)?;
        }
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

/// What to write.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputSettings {
    /// Observed corners.
    pub corners: bool,
    /// Images of the board.
    pub images: bool,
    /// Images of the ring target.
    pub ring_target: bool,
    /// How images look.
    pub render: RenderSettings,
    /// 8 or 16 bits per pixel.
    pub image_depth: ImageDepth,
    /// How they are compressed.
    pub image_files: ImageFiles,
    /// How many matches inside the swept volume.
    pub point_count: usize,
    /// How many held-out corners.
    pub holdout_count: usize,
}

impl Default for OutputSettings {
    fn default() -> Self {
        Self {
            corners: true,
            images: false,
            ring_target: false,
            render: RenderSettings::default(),
            image_depth: ImageDepth::Eight,
            image_files: ImageFiles::Small,
            point_count: 500,
            holdout_count: 500,
        }
    }
}

/// How images are compressed; the pixels are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageFiles {
    /// As well as can be.
    Small,
    /// In a fraction of the time.
    Quick,
}

/// Bits per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageDepth {
    /// 8 bits.
    Eight,
    /// 16 bits.
    Sixteen,
}
