//! The double sphere (Usenko, Demmel, Cremers 2018): Kalibr's `ds`.
//!
//! With `d1 = |P|`, `w = xi d1 + z`, `d2 = sqrt(x^2 + y^2 + w^2)` the place is `(x, y) / (alpha d2 + (1 - alpha) w)`.

use super::{CameraModel, ImagePlane, central};
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::Vector3;

/// The double sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubleSphere {
    /// Focal lengths and principal point.
    pub plane: ImagePlane,
    /// Between the middles of the spheres.
    pub xi: f64,
    /// 0 to 1.
    pub alpha: f64,
}

impl CameraModel for DoubleSphere {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        let Self { xi, alpha, .. } = *self;
        let d1 = point.norm();
        let w = xi * d1 + point.z;
        let d2 = f64::hypot(point.xy().norm(), w);
        let under = alpha * d2 + (1.0 - alpha) * w;
        let w1 = if alpha > 0.5 {
            (1.0 - alpha) / alpha
        } else {
            alpha / (1.0 - alpha)
        };
        let w2 = (w1 + xi) / (2.0 * w1 * xi + xi * xi + 1.0).sqrt();
        if !(under > 0.0 && point.z > -w2 * d1) {
            return None;
        }
        self.plane.pixel(&(point.xy() / under))
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let Self { xi, alpha, .. } = *self;
        let place = self.plane.place(pixel);
        let s = place.norm_squared();
        let root = 1.0 - (2.0 * alpha - 1.0) * s;
        if !(root >= 0.0) {
            return None;
        }
        let z = (1.0 - alpha * alpha * s) / (alpha * root.sqrt() + 1.0 - alpha);
        let inner = z * z + (1.0 - xi * xi) * s;
        if !(inner >= 0.0) {
            return None;
        }
        let scale = (z * xi + inner.sqrt()) / (z * z + s);
        central((place * scale).push(scale * z - xi))
    }
}
