//! A camera of another tool, and what one of its files holds.

use crate::model::CameraModel;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};

/// A format of calibrations that is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `OpenCV`'s `FileStorage`: YAML, XML or JSON.
    OpenCv,
    /// ROS' `camera_info` in YAML.
    Ros,
    /// Kalibr's `camchain.yaml`.
    Kalibr,
    /// mrcal's `.cameramodel`.
    Mrcal,
    /// COLMAP's `cameras.txt`.
    Colmap,
    /// MATLAB's parameters as JSON.
    Matlab,
    /// `DICe`'s camera system in XML.
    Dice,
}

impl Format {
    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OpenCv => "OpenCV",
            Self::Ros => "ROS",
            Self::Kalibr => "Kalibr",
            Self::Mrcal => "mrcal",
            Self::Colmap => "COLMAP",
            Self::Matlab => "MATLAB",
            Self::Dice => "DICe",
        }
    }
}

/// What a file of another tool holds.
#[derive(Debug)]
pub struct ForeignFile {
    /// Its format.
    pub format: Format,
    /// Its cameras, in its order.
    pub cameras: Vec<ForeignCamera>,
    /// What else must be known of it, in words.
    pub notes: Vec<String>,
}

/// A file of cameras, or of where they stand.
#[derive(Debug)]
pub(crate) enum Content {
    /// Cameras.
    Cameras(ForeignFile),
    /// `OpenCV`'s `R` and `T` alone: the second camera from the first.
    Extrinsics(RigidTransform),
}

impl Content {
    /// Whether its format's lengths are meters, as its documents say: no unit is asked for.
    pub(crate) fn is_in_meters(&self) -> bool {
        match self {
            Self::Cameras(held) => matches!(
                held.format,
                Format::Ros | Format::Kalibr | Format::Mrcal | Format::Colmap
            ),
            Self::Extrinsics(_) => false,
        }
    }
}

/// A camera of another tool.
#[derive(Debug)]
pub struct ForeignCamera {
    /// Unique in the rig.
    pub name: String,
    /// The sensor.
    pub sensor: SensorSize,
    /// The model's name in its tool.
    pub model_name: String,
    /// What it sees.
    pub model: Box<dyn CameraModel>,
    /// Where it stands in the file's own frame; `None` where the file does not say.
    pub rig_from_camera: Option<RigidTransform>,
    /// The part of the image that the file calls valid, a polygon; `None` where it says nothing.
    pub valid: Option<Vec<PixelPoint>>,
}
