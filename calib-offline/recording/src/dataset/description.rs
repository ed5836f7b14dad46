//! A dataset as its manifest describes it.

use super::target::TargetSpec;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::SensorSize;
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
}

/// What is known about the rotation stage. Every part is optional and used for checks only.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StageSpec {
    /// Dial reading per pose, degrees.
    pub angles_deg: Option<Vec<f64>>,
    /// Stage placement per pose; poses of one placement share one axis.
    pub placement: Option<Vec<usize>>,
}
