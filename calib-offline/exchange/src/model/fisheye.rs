//! Fisheyes whose plane is the angle off axis: `OpenCV`'s, Kalibr's and COLMAP's, of Kannala and Brandt's kind.
//!
//! The ideal place is `theta` in the direction off axis, `theta` the angle. It is distorted radially by a polynomial in `theta^2`, then
//! by tangential and prism terms, which most forms do not have. Angles go up to straight back, beyond 90 degrees, where a
//! form by way of x / z would not.

use super::inverse::{followed, slope};
use super::{CameraModel, ImagePlane, central};
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::{Vector2, Vector3};
use std::f64::consts::PI;

/// A fisheye.
#[derive(Debug, Clone, PartialEq)]
pub struct Fisheye {
    /// Focal lengths and principal point.
    pub plane: ImagePlane,
    /// `k1, k2, ...` of `theta (1 + k1 theta^2 + k2 theta^4 + ...)`.
    pub radial: Vec<f64>,
    /// `p1, p2` of Brown's tangential terms.
    pub tangential: [f64; 2],
    /// `s1, s2, s3, s4` of a thin prism.
    pub prism: [f64; 4],
    /// Whether tangential terms and prism take the place that is distorted radially already, as COLMAP's
    /// `RAD_TAN_THIN_PRISM_FISHEYE` has it; else they take the ideal one.
    pub is_in_turn: bool,
}

impl Fisheye {
    /// With radial distortion only.
    pub fn radial(plane: ImagePlane, coefficients: &[f64]) -> Self {
        Self {
            plane,
            radial: coefficients.to_vec(),
            tangential: [0.0; 2],
            prism: [0.0; 4],
            is_in_turn: false,
        }
    }

    fn distorted(&self, ideal: &Vector2<f64>) -> Option<Vector2<f64>> {
        let squared = ideal.norm_squared();
        if !(squared <= PI * PI) {
            return None;
        }
        let radial = self
            .radial
            .iter()
            .rev()
            .fold(0.0, |sum, k| squared * (k + sum));
        let scaled = ideal * (1.0 + radial);
        let at = if self.is_in_turn { scaled } else { *ideal };
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.prism);
        let (s, xy) = (at.norm_squared(), at.x * at.y);
        Some(Vector2::new(
            scaled.x + 2.0 * p1 * xy + p2 * (s + 2.0 * at.x * at.x) + s * (s1 + s * s2),
            scaled.y + p1 * (s + 2.0 * at.y * at.y) + 2.0 * p2 * xy + s * (s3 + s * s4),
        ))
    }
}

impl CameraModel for Fisheye {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        let across = point.xy().norm();
        let angle = across.atan2(point.z);
        let ideal = if across > 0.0 {
            point.xy() * (angle / across)
        } else if point.z > 0.0 {
            Vector2::zeros()
        } else {
            return None;
        };
        // Beyond the greatest radius pixels see something else.
        let radial_slope = self
            .radial
            .iter()
            .enumerate()
            .rev()
            .fold(0.0, |sum, (k, c)| {
                angle * angle * ((2 * k + 3) as f64 * c + sum)
            });
        let is_before_fold = 1.0 + radial_slope > 0.0
            && slope(&|at: &Vector2<f64>| self.distorted(at), &ideal)?.determinant() > 0.0;
        if !is_before_fold {
            return None;
        }
        self.plane.pixel(&self.distorted(&ideal)?)
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let place = self.plane.place(pixel);
        let ideal = followed(|at| self.distorted(at), Vector2::zeros(), place)?;
        let angle = ideal.norm();
        let across = if angle > 0.0 {
            ideal * (angle.sin() / angle)
        } else {
            ideal
        };
        central(across.push(angle.cos()))
    }
}
