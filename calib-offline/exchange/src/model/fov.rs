//! The field-of-view model (Devernay and Faugeras 2001): Kalibr's `fov`, COLMAP's `FOV`.
//!
//! A radius `tan(theta)` becomes `atan(2 tan(w / 2) tan(theta)) / w`. With `w` near zero it is a pinhole.

use super::{CameraModel, ImagePlane, central};
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// The field-of-view model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fov {
    /// Focal lengths and principal point.
    pub plane: ImagePlane,
    /// `w`, rad, above 0 and below a half turn.
    pub angle_rad: f64,
}

impl CameraModel for Fov {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        if !(point.z > 0.0) {
            return None;
        }
        let ideal = point.xy() / point.z;
        let radius = ideal.norm();
        if radius == 0.0 {
            return self.plane.pixel(&ideal);
        }
        let w = self.angle_rad;
        let distorted = (2.0 * (w / 2.0).tan() * radius).atan() / w;
        self.plane.pixel(&(ideal * (distorted / radius)))
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let place = self.plane.place(pixel);
        let radius = place.norm();
        let w = self.angle_rad;
        if !(radius * w < FRAC_PI_2) {
            return None;
        }
        if radius == 0.0 {
            return central(place.push(1.0));
        }
        let ideal = (radius * w).tan() / (2.0 * (w / 2.0).tan());
        central((place * (ideal / radius)).push(1.0))
    }
}
