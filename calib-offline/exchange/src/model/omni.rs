//! Mei's unified model: Kalibr's and `OpenCV`'s `omni`, a sphere whose point is seen from `xi` behind its middle.
//!
//! `m = P / |P|`, the ideal place is `(m.x, m.y) / (m.z + xi)`, distorted by Brown's formula ([`crate::brown`]).

use super::inverse::followed;
use super::{CameraModel, ImagePlane, central};
use crate::brown::distort;
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::{Vector2, Vector3};

/// The unified model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Omni {
    /// Focal lengths and principal point.
    pub plane: ImagePlane,
    /// From the middle of the sphere to the center of projection.
    pub xi: f64,
    /// `k1, k2, p1, p2, k3, 0, 0, 0`.
    pub coefficients: [f64; 8],
}

impl CameraModel for Omni {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        let on_sphere = point.try_normalize(0.0)?;
        let depth = on_sphere.z + self.xi;
        // Below this points of the sphere are hidden behind others: the plane has each place twice.
        let least = if self.xi > 1.0 {
            -1.0 / self.xi
        } else {
            -self.xi
        };
        if !(depth > 0.0 && on_sphere.z > least) {
            return None;
        }
        let ideal = on_sphere.xy() / depth;
        let brown = distort(ideal.x, ideal.y, &self.coefficients);
        if !(brown.gain > 0.0 && brown.slope.determinant() > 0.0) {
            return None;
        }
        self.plane.pixel(&brown.at)
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let place = self.plane.place(pixel);
        let distorted = |at: &Vector2<f64>| Some(distort(at.x, at.y, &self.coefficients).at);
        let ideal = followed(distorted, Vector2::zeros(), place)?;
        let s = ideal.norm_squared();
        let under = 1.0 + (1.0 - self.xi * self.xi) * s;
        if !(under >= 0.0) {
            return None;
        }
        let scale = (self.xi + under.sqrt()) / (1.0 + s);
        central((ideal * scale).push(scale - self.xi))
    }
}
