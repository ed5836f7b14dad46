//! A camera: a lens and what stands before it.

use super::lens::Lens;
use super::media::Media;
use super::project::{self, Rays};
use calib_rays::geometry::{PixelPoint, Ray, SensorSize};
use nalgebra::Vector3;
use serde::Serialize;

/// One simulated camera. Frame: origin at the lens's center, z along its axis, x right, y down.
#[derive(Debug, Clone, Serialize)]
pub struct CameraOptics {
    sensor: SensorSize,
    lens: Lens,
    media: Media,
    /// Rays of a coarse lattice over the sensor: where the search for a pixel starts.
    #[serde(skip)]
    lattice: Vec<(PixelPoint, Ray)>,
}

impl CameraOptics {
    /// A camera whose rays are those of `lens` seen through `media`.
    pub fn new(sensor: SensorSize, lens: Lens, media: Media) -> Self {
        let mut camera = Self {
            sensor,
            lens,
            media,
            lattice: Vec::new(),
        };
        camera.lattice = project::start_lattice(&camera);
        camera
    }

    /// Size of the sensor.
    pub fn sensor(&self) -> SensorSize {
        self.sensor
    }

    /// The lens.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// What stands between lens and scene.
    pub fn media(&self) -> &Media {
        &self.media
    }

    /// The ray that a pixel sees, camera frame, mm; the direction has unit length and the origin
    /// lies on the last surface (for a lens in air: at its pupil).
    ///
    /// Defined beyond the sensor's edge as far as the optics are, which keeps the search for a
    /// pixel smooth there. `None` outside the image circle and where light is totally reflected.
    pub fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        self.media.refract(self.lens.ray(pixel)?)
    }

    /// The pixel that sees a point of the camera frame (mm), to 1e-10 px.
    ///
    /// `None` if no pixel of the sensor sees it.
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<PixelPoint> {
        self.project_unclipped(point_in_camera)
            .filter(|pixel| self.sensor.contains(*pixel))
    }

    /// As [`Self::project`], with pixels beyond the sensor's edge included.
    pub fn project_unclipped(&self, point_in_camera: &Vector3<f64>) -> Option<PixelPoint> {
        project::solve(self, &self.lattice, point_in_camera)
    }
}

impl Rays for CameraOptics {
    fn sensor(&self) -> SensorSize {
        self.sensor()
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        self.ray(pixel)
    }
}
