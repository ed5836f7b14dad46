//! The enhanced unified model (Khomutenko, Garcia, Martinet 2016): Kalibr's and COLMAP's EUCM.
//!
//! The place is `(x, y) / (alpha d + (1 - alpha) z)`, `d = sqrt(beta (x^2 + y^2) + z^2)`.

use super::{CameraModel, ImagePlane, central};
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::Vector3;

/// The enhanced unified model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eucm {
    /// Focal lengths and principal point.
    pub plane: ImagePlane,
    /// 0 to 1.
    pub alpha: f64,
    /// Above 0.
    pub beta: f64,
}

impl CameraModel for Eucm {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        let Self { alpha, beta, .. } = *self;
        let d = (beta * point.xy().norm_squared() + point.z * point.z).sqrt();
        let under = alpha * d + (1.0 - alpha) * point.z;
        let share = if alpha > 0.5 {
            (1.0 - alpha) / alpha
        } else {
            alpha / (1.0 - alpha)
        };
        if !(under > 0.0 && point.z > -share * d) {
            return None;
        }
        self.plane.pixel(&(point.xy() / under))
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let Self { alpha, beta, .. } = *self;
        let place = self.plane.place(pixel);
        let s = place.norm_squared();
        let root = 1.0 - (2.0 * alpha - 1.0) * beta * s;
        if !(root >= 0.0) {
            return None;
        }
        let z = (1.0 - beta * alpha * alpha * s) / (alpha * root.sqrt() + 1.0 - alpha);
        central(place.push(z))
    }
}
