//! The baseline's result: Brown cameras, where they stand, and what they measure.

use super::adjustment::CameraDeviations;
use super::brown::BrownCamera;
use super::calibrate_camera::CameraFit;
use calib_rays::field::rig::MeasureError;
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, Triangulation, triangulate_rays};
use calib_rays::numerics::levenberg::StopReason;

/// Calibrated cameras in the frame of the first.
#[derive(Debug, Clone)]
pub struct PinholeRig {
    /// In the order of the observations.
    pub cameras: Vec<BrownCamera>,
    /// Per camera; the identity for the first.
    pub camera_from_first: Vec<RigidTransform>,
    /// Per pose index of the observations; `None` where no camera could place the board.
    pub first_from_board: Vec<Option<RigidTransform>>,
    /// Each camera by itself, before they were joined.
    pub fits: Vec<CameraFit>,
    /// Sum of squared residuals, each with its corner's relative weight, px^2.
    pub cost_px2: f64,
    /// Root mean square length of the residual vectors of the corners used, px.
    pub rms_px: f64,
    /// Corners used, all cameras together.
    pub corner_count: usize,
    /// Which, per view and corner of the observations.
    pub is_used: Vec<Vec<bool>>,
    /// Linearizations of the adjustment of all together.
    pub iterations: usize,
    /// Why it ended.
    pub stop: StopReason,
    /// Per camera, from the residuals' own variance: 0 for what was held, `None` if the data leave
    /// something open.
    pub deviations: Option<Vec<CameraDeviations>>,
}

impl PinholeRig {
    /// What a pixel sees, frame of the first camera, mm; `None` beyond the fold of the distortion.
    /// `camera_idx` must exist.
    pub fn ray_in_first(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray> {
        let first_from_camera = self.camera_from_first[camera_idx].inverse();
        let ray = self.cameras[camera_idx].ray(pixel)?;
        Some(ray.transformed(&first_from_camera))
    }

    /// Where the rays of pixels meet, frame of the first camera, mm. Pixels come with the index of
    /// their camera, which must exist.
    ///
    /// # Errors
    /// [`MeasureError`]; a pixel beyond the fold is outside.
    pub fn triangulate(
        &self,
        pixels: &[(usize, PixelPoint)],
    ) -> Result<Triangulation, MeasureError> {
        let rays = pixels
            .iter()
            .map(|&(camera_idx, pixel)| {
                self.ray_in_first(camera_idx, pixel)
                    .ok_or(MeasureError::Outside { camera_idx })
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(triangulate_rays(&rays)?)
    }

    /// Distance of a camera's center from that of the first, mm. `camera_idx` must exist.
    pub fn baseline_mm(&self, camera_idx: usize) -> f64 {
        self.camera_from_first[camera_idx].translation_mm.norm()
    }
}
