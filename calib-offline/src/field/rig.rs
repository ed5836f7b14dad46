//! Calibrated cameras in one common frame: what an estimate hands to everything after it.

use super::{CoverageMask, RayField};
use crate::geometry::TriangulateError;
use crate::geometry::{PixelPoint, Ray, RigidTransform, Triangulation, triangulate_rays};
use serde::{Deserialize, Serialize};

/// One calibrated camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibratedCamera {
    /// Unique in the rig.
    pub name: String,
    /// What each pixel sees, camera frame.
    pub field: RayField,
    /// Where the field is backed by observations.
    pub coverage: CoverageMask,
    /// Where the camera is. The rig frame is the board at the datum pose.
    pub rig_from_camera: RigidTransform,
}

/// One or more calibrated cameras in the rig frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rig {
    /// In the dataset's order.
    pub cameras: Vec<CalibratedCamera>,
    /// The pose whose board frame is the rig frame.
    pub datum_pose: usize,
}

/// Why a match has no point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MeasureError {
    /// A pixel lies outside its camera's calibrated area.
    #[error("a pixel lies outside the calibrated area of camera {camera_idx}")]
    Outside {
        /// Index of the camera.
        camera_idx: usize,
    },
    /// The rays do not meet in front of the cameras.
    #[error(transparent)]
    Triangulate(#[from] TriangulateError),
}

impl CalibratedCamera {
    /// What the pixel sees, rig frame; `None` outside the calibrated area.
    pub fn ray_in_rig(&self, pixel: PixelPoint) -> Option<Ray> {
        self.coverage
            .contains(pixel)
            .then(|| self.field.ray(pixel).transformed(&self.rig_from_camera))
    }
}

impl Rig {
    /// The index of the camera with this name.
    pub fn camera_idx(&self, name: &str) -> Option<usize> {
        self.cameras.iter().position(|camera| camera.name == name)
    }

    /// The point seen at `(camera_idx, pixel)` by two or more cameras, rig frame, mm.
    ///
    /// # Errors
    /// [`MeasureError::Outside`] for the first pixel without a ray (an index without a camera
    /// counts as one), else what the rays give.
    pub fn triangulate(
        &self,
        sightings: &[(usize, PixelPoint)],
    ) -> Result<Triangulation, MeasureError> {
        let rays = sightings
            .iter()
            .map(|&(camera_idx, pixel)| {
                self.cameras
                    .get(camera_idx)
                    .and_then(|camera| camera.ray_in_rig(pixel))
                    .ok_or(MeasureError::Outside { camera_idx })
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(triangulate_rays(&rays)?)
    }
}
