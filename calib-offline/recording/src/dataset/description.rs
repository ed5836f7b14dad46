//! A dataset as its manifest describes it.

use super::target::TargetSpec;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::SensorSize;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// A dataset; corners are loaded or detected separately.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// The folder that holds `dataset.toml`.
    pub folder: PathBuf,
    /// The calibration board.
    pub board: BoardSpec,
    /// One or more cameras, in the manifest's order.
    pub cameras: Vec<CameraSpec>,
    /// The rotation stage, if the manifest speaks of one. Without it poses are free.
    pub stage: Option<StageSpec>,
    /// Poses that the user leaves out.
    pub excluded_poses: BTreeSet<usize>,
    /// The measurement target, if the manifest describes one. No calibration depends on it.
    pub target: Option<TargetSpec>,
    /// What the board's maker or a measurement says of it.
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Certificate {
    /// Of the scale, parts per million.
    pub scale_ppm_sd: Option<f64>,
    /// Of the face from a plane, mm.
    pub flatness_mm_sd: Option<f64>,
    /// Thermal expansion, parts per million and kelvin.
    pub expansion_ppm_per_k: Option<f64>,
    /// Temperature at which its lengths hold, degrees Celsius.
    pub calibrated_at_c: Option<f64>,
    /// Temperature while it was recorded, degrees Celsius.
    pub used_at_c: Option<f64>,
}

/// What the recording is called, who made it, and when; text as it stands in the manifest.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
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
