//! The pinhole with up to 14 coefficients, as `OpenCV` orders them, mrcal's `OPENCV4` to `OPENCV12`, COLMAP's perspective ones,
//! MATLAB's and `DICe`'s.
//!
//! Brown's formula is that of [`crate::brown`]. A thin prism adds `s1 r^2 + s2 r^4` to x and `s3 r^2 + s4 r^4` to y, `r` being that of
//! the ideal place; a tilted sensor (Scheimpflug) is a homography after that.

use super::inverse::followed;
use super::{CameraModel, ImagePlane, central};
use crate::brown::distort;
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::{Matrix3, Vector2, Vector3};

/// A pinhole with distortion; what a form does not have is zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Focal lengths and principal point.
    pub plane: ImagePlane,
    /// `k1, k2, p1, p2, k3, k4, k5, k6`.
    pub coefficients: [f64; 8],
    /// `s1, s2, s3, s4`.
    pub prism: [f64; 4],
    /// `tau_x, tau_y`, rad.
    pub tilt_rad: [f64; 2],
}

/// Numbers of coefficients that there are forms for.
pub const COUNTS: [usize; 6] = [0, 4, 5, 8, 12, 14];

impl Pinhole {
    /// From coefficients in `OpenCV`'s order; `None` for a number of them that there is no form for.
    pub fn new(plane: ImagePlane, coefficients: &[f64]) -> Option<Self> {
        if !COUNTS.contains(&coefficients.len()) {
            return None;
        }
        let mut all = [0.0; 14];
        all[..coefficients.len()].copy_from_slice(coefficients);
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tx, ty] = all;
        Some(Self {
            plane,
            coefficients: [k1, k2, p1, p2, k3, k4, k5, k6],
            prism: [s1, s2, s3, s4],
            tilt_rad: [tx, ty],
        })
    }

    /// The homography of the tilted sensor.
    fn tilt(&self) -> Matrix3<f64> {
        Self::tilt_of(self.tilt_rad)
    }

    /// That of a sensor tilted by these angles.
    pub(crate) fn tilt_of(tilt_rad: [f64; 2]) -> Matrix3<f64> {
        let [(sx, cx), (sy, cy)] = tilt_rad.map(f64::sin_cos);
        let turn = Matrix3::new(cy, 0.0, -sy, 0.0, 1.0, 0.0, sy, 0.0, cy)
            * Matrix3::new(1.0, 0.0, 0.0, 0.0, cx, sx, 0.0, -sx, cx);
        let along = turn[(2, 2)];
        let onto = Matrix3::new(
            along,
            0.0,
            -turn[(0, 2)],
            0.0,
            along,
            -turn[(1, 2)],
            0.0,
            0.0,
            1.0,
        );
        onto * turn
    }

    /// The distorted place before the tilt; `None` beyond a pole of the rational form.
    fn distorted(&self, ideal: &Vector2<f64>) -> Option<Vector2<f64>> {
        let [s1, s2, s3, s4] = self.prism;
        let brown = distort(ideal.x, ideal.y, &self.coefficients);
        let s = ideal.norm_squared();
        let prism = Vector2::new(s * (s1 + s * s2), s * (s3 + s * s4));
        (brown.under > 0.0).then_some(brown.at + prism)
    }

    /// Whether the formula has not folded back at an ideal place.
    fn is_before_fold(&self, ideal: &Vector2<f64>) -> bool {
        let [s1, s2, s3, s4] = self.prism;
        let brown = distort(ideal.x, ideal.y, &self.coefficients);
        let s = ideal.norm_squared();
        let by_s = Vector2::new(s1 + 2.0 * s * s2, s3 + 2.0 * s * s4);
        let slope = brown.slope + by_s * (2.0 * ideal).transpose();
        brown.under > 0.0 && brown.gain > 0.0 && slope.determinant() > 0.0
    }
}

/// A place under a homography; `None` behind it.
fn tilted(place: Vector2<f64>, by: &Matrix3<f64>) -> Option<Vector2<f64>> {
    let at = by * place.push(1.0);
    (at.z > 0.0).then(|| at.xy() / at.z)
}

impl CameraModel for Pinhole {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        if !(point.z > 0.0) {
            return None;
        }
        let ideal = point.xy() / point.z;
        if !self.is_before_fold(&ideal) {
            return None;
        }
        let place = self.distorted(&ideal)?;
        let place = match self.tilt_rad {
            [0.0, 0.0] => place,
            _ => tilted(place, &self.tilt())?,
        };
        self.plane.pixel(&place)
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let place = self.plane.place(pixel);
        let place = match self.tilt_rad {
            [0.0, 0.0] => place,
            _ => tilted(place, &self.tilt().try_inverse()?)?,
        };
        let ideal = followed(|at| self.distorted(at), Vector2::zeros(), place)?;
        central(ideal.push(1.0))
    }
}
