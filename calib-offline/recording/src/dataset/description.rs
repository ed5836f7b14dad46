//! A dataset as its manifest describes it.

use super::target::TargetSpec;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::SensorSize;
use calib_rays::observed::KnownPose;
use calib_rays::print::{AprilGrid, Charuco, Circles};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// A dataset; corners are loaded or detected separately.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// The folder that holds `dataset.toml`.
    pub folder: PathBuf,
    /// What the calibration target is.
    pub kind: BoardKind,
    /// The calibration target's labels, and where they lie.
    pub board: BoardSpec,
    /// One or more cameras, in the manifest's order.
    pub cameras: Vec<CameraSpec>,
    /// The rotation stage, if the manifest speaks of one. Without it poses are free.
    pub stage: Option<StageSpec>,
    /// Poses of the target that are known beforehand, by number; empty where the cameras find all of them.
    pub known_poses: BTreeMap<usize, KnownPose>,
    /// The file that they stand in.
    pub known_poses_file: Option<PathBuf>,
    /// Poses that the user leaves out.
    pub excluded_poses: BTreeSet<usize>,
    /// The measurement target, if the manifest describes one. No calibration depends on it.
    pub target: Option<TargetSpec>,
    /// What the board's maker or a measurement says of it. `board` is as warm as it says.
    pub certificate: Option<Certificate>,
    /// Who recorded it, and when.
    pub recording: Option<RecordingSpec>,
}

impl Dataset {
    /// The manifest's file name.
    pub const MANIFEST: &str = "dataset.toml";
    /// The corners' file name.
    pub const CORNERS: &str = "corners.csv";

    /// Where the corners are, or would be written.
    pub fn corners_path(&self) -> PathBuf {
        self.folder.join(Self::CORNERS)
    }

    /// Where the target's labelled markers are, or would be written.
    pub fn markers_path(&self) -> PathBuf {
        self.folder.join(TargetSpec::MARKERS)
    }

    /// The index of the camera with this name.
    pub fn camera_idx(&self, name: &str) -> Option<usize> {
        self.cameras.iter().position(|camera| camera.name == name)
    }

    /// Whether any camera has an image.
    pub fn has_images(&self) -> bool {
        self.cameras
            .iter()
            .any(|camera| camera.images.iter().any(Option::is_some))
    }

    /// Poses that have an entry in the cameras' lists of images; 0 if there are none.
    pub fn image_pose_count(&self) -> usize {
        self.cameras
            .iter()
            .map(|camera| camera.images.len())
            .max()
            .unwrap_or(0)
    }
}

/// What a calibration target is: `[board] kind`. A kind with facts of its own that only a detector needs
/// carries them.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub enum BoardKind {
    /// The inner corners of a chessboard.
    #[default]
    Chessboard,
    /// A chessboard with a dot in the middle of some squares: (row, col), from 0 at the upper left.
    MarkedChessboard(Vec<(usize, usize)>),
    /// A chessboard with a coded marker in each white square.
    Charuco(Charuco),
    /// A grid of `AprilTags`.
    AprilGrid(AprilGrid),
    /// A grid of circles.
    Circles(Circles),
    /// A grid of rings, some of them larger.
    Rings(TargetSpec),
    /// Points with known places, which stand in the file of corners.
    Points,
}

impl BoardKind {
    /// The words of all of them in the manifest.
    pub const WORDS: [&str; 6] = [
        "chessboard",
        "charuco",
        "aprilgrid",
        "circles",
        "rings",
        "points",
    ];

    /// What its labels are.
    pub const fn points(&self) -> &'static str {
        match self {
            Self::Chessboard | Self::MarkedChessboard(_) | Self::Charuco(_) => "inner corners",
            Self::AprilGrid(_) => "tags' corners",
            Self::Circles(_) => "circles",
            Self::Rings(_) => "rings",
            Self::Points => "points",
        }
    }

    /// The same in one word.
    pub const fn points_in_a_word(&self) -> &'static str {
        match self {
            Self::Circles(_) | Self::Rings(_) | Self::Points => self.points(),
            _ => "corners",
        }
    }

    /// What rows and cols of the manifest count.
    pub const fn counted(&self) -> &'static str {
        match self {
            Self::AprilGrid(_) => "tags",
            _ => self.points(),
        }
    }

    /// The word in the manifest.
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Chessboard | Self::MarkedChessboard(_) => Self::WORDS[0],
            Self::Charuco(_) => Self::WORDS[1],
            Self::AprilGrid(_) => Self::WORDS[2],
            Self::Circles(_) => Self::WORDS[3],
            Self::Rings(_) => Self::WORDS[4],
            Self::Points => Self::WORDS[5],
        }
    }
}

/// One camera of a dataset.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraSpec {
    /// Unique in the dataset.
    pub name: String,
    /// Size of the sensor region that the images show.
    pub sensor: SensorSize,
    /// One entry per pose, in order; `None` where this camera has no image of the pose. Empty if
    /// the dataset has corners only.
    pub images: Vec<Option<PathBuf>>,
    /// What the user expects of its rays; `None` is no expectation.
    pub optics: Option<ExpectedOptics>,
    /// Serial number.
    pub serial: Option<String>,
}

/// What stands before a camera, as far as the user declares it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ExpectedOptics {
    /// A lens in air: all rays meet in a point.
    Plain,
    /// A window in air.
    Window,
    /// A flat port into another medium.
    Port,
    /// Some housing.
    Housing,
    /// A mirror: the board is seen as its mirror image.
    Mirror,
    /// A fisheye lens.
    Fisheye,
    /// Parallel rays.
    Telecentric,
}

/// Standard deviations and temperatures of the board; a key that is not given is not known.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Certificate {
    /// Of the scale, parts per million.
    pub scale_ppm_sd: Option<f64>,
    /// Of the face from a plane, mm: of each coefficient of the shape that is estimated.
    pub flatness_mm_sd: Option<f64>,
    /// Thermal expansion, parts per million and kelvin.
    pub expansion_ppm_per_k: Option<f64>,
    /// Its standard deviation; not given, it counts as exact.
    pub expansion_ppm_per_k_sd: Option<f64>,
    /// Temperature at which its lengths hold, degrees Celsius.
    pub calibrated_at_c: Option<f64>,
    /// Temperature while it was recorded, degrees Celsius.
    pub used_at_c: Option<f64>,
    /// Its standard deviation, kelvin; not given, it counts as exact.
    pub used_at_c_sd: Option<f64>,
}

impl Certificate {
    /// By how much the board was longer while it was recorded than certified, parts per million; `None` if one
    /// of the three numbers that it takes is not given.
    pub fn expansion_ppm(&self) -> Option<f64> {
        Some(self.expansion_ppm_per_k? * (self.used_at_c? - self.calibrated_at_c?))
    }

    /// Standard deviation of [`Self::expansion_ppm`], to first order, parts per million; `None` where no standard
    /// deviation is given.
    pub fn expansion_ppm_sd(&self) -> Option<f64> {
        self.expansion_ppm()?;
        if self.expansion_ppm_per_k_sd.is_none() && self.used_at_c_sd.is_none() {
            return None;
        }
        let warmer_k = self.used_at_c? - self.calibrated_at_c?;
        let by_expansion = warmer_k * self.expansion_ppm_per_k_sd.unwrap_or(0.0);
        let by_temperature = self.expansion_ppm_per_k? * self.used_at_c_sd.unwrap_or(0.0);
        Some(by_expansion.hypot(by_temperature))
    }
}

/// What the recording is called, who made it, and when; text as it stands in the manifest.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub struct RecordingSpec {
    /// Name.
    pub name: Option<String>,
    /// Person.
    pub by: Option<String>,
    /// Day, as year-month-day.
    pub date: Option<String>,
}

/// What is known about the rotation stage. Every part is optional and used for checks only.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StageSpec {
    /// Dial reading per pose, degrees.
    pub angles_deg: Option<Vec<f64>>,
    /// Stage placement per pose; poses of one placement share one axis.
    pub placement: Option<Vec<usize>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_that_is_warmer_than_certified_is_longer() {
        let mut certificate = Certificate {
            expansion_ppm_per_k: Some(9.0),
            calibrated_at_c: Some(20.0),
            used_at_c: Some(23.5),
            ..Certificate::default()
        };
        assert_eq!(certificate.expansion_ppm(), Some(31.5));
        assert_eq!(certificate.expansion_ppm_sd(), None);
        // 3.5 K of 1.2 ppm/K, and 0.5 K of 9 ppm/K.
        certificate.expansion_ppm_per_k_sd = Some(1.2);
        assert_eq!(certificate.expansion_ppm_sd(), Some(3.5 * 1.2));
        certificate.used_at_c_sd = Some(0.5);
        let both = 4.2f64.hypot(4.5);
        assert!((certificate.expansion_ppm_sd().unwrap() - both).abs() < 1e-12);
        certificate.used_at_c = None;
        assert_eq!(certificate.expansion_ppm(), None);
        assert_eq!(certificate.expansion_ppm_sd(), None);
    }
}
