//! The division model (Fitzgibbon 2001): COLMAP's `DIVISION`. A place `p` sees `(p, 1 + k |p|^2)`.

use super::{CameraModel, ImagePlane, central};
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::Vector3;

/// The division model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Division {
    /// Focal lengths and principal point.
    pub plane: ImagePlane,
    /// `k`.
    pub coefficient: f64,
}

impl CameraModel for Division {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        let root = point.z * point.z - 4.0 * self.coefficient * point.xy().norm_squared();
        let under = point.z + root.sqrt();
        // Written so that NaN is refused.
        if !(under > 0.0) {
            return None;
        }
        self.plane.pixel(&(point.xy() * (2.0 / under)))
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let place = self.plane.place(pixel);
        let s = place.norm_squared();
        // Beyond this radius places see what nearer ones see.
        if self.coefficient * s >= 1.0 {
            return None;
        }
        central(place.push(1.0 + self.coefficient * s))
    }
}
