//! The pinhole with 4, 5 or 8 coefficients of distortion, as `OpenCV`, ROS and Kalibr write it.

use calib_rays::geometry::{PixelPoint, SensorSize};
use nalgebra::{Matrix2, Matrix2x3, SMatrix, Vector2, Vector3};

/// Numbers of a lens, those that a form does not have included.
pub(super) const NUMBERS: usize = 12;

/// Which coefficients a lens has: the first ones of `k1, k2, p1, p2, k3, k4, k5, k6`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Distortion {
    /// `k1, k2, p1, p2`: Kalibr's `radtan`.
    Four,
    /// And `k3`: Brown's, ROS' `plumb_bob`.
    Five,
    /// And `k4, k5, k6`: the rational one.
    Eight,
}

impl Distortion {
    /// Number of coefficients.
    pub const fn count(self) -> usize {
        match self {
            Self::Four => 4,
            Self::Five => 5,
            Self::Eight => 8,
        }
    }
}

/// A pinhole with distortion.
///
/// With `x = X/Z`, `y = Y/Z`, `s = x^2 + y^2`, `g = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)`:
///
/// ```text
/// u = cx + fx (g x + 2 p1 x y + p2 (s + 2 x^2))
/// v = cy + fy (g y + p1 (s + 2 y^2) + 2 p2 x y)
/// ```
///
/// Source: `OpenCV`'s documentation of `calib3d`. Frame: origin at the center of projection, z along the axis, x right, y
/// down. The center of the top-left pixel is (0, 0), there as here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// The sensor.
    pub sensor: SensorSize,
    /// `[fx, fy]`, px.
    pub focal_px: [f64; 2],
    /// Principal point `[cx, cy]`, px.
    pub center_px: [f64; 2],
    /// `k1, k2, p1, p2, k3, k4, k5, k6`, without unit; zero where the form has none.
    pub coefficients: [f64; 8],
    /// How many of them it has.
    pub distortion: Distortion,
}

/// Where a point is seen, and how that changes.
pub(super) struct Seen {
    pub pixel: PixelPoint,
    /// By the direction's `x/z` and `y/z`, px.
    pub by_ideal: Matrix2<f64>,
    /// By the point, px/mm.
    pub by_point: Matrix2x3<f64>,
    /// By `fx, fy, cx, cy` and the coefficients.
    pub by_numbers: SMatrix<f64, 2, NUMBERS>,
}

impl Lens {
    /// The coefficients that the form has.
    pub fn own_coefficients(&self) -> &[f64] {
        &self.coefficients[..self.distortion.count()]
    }

    /// The pixel that sees a point in front of the lens, and how it moves. `None` behind it, and where the distortion
    /// has folded back.
    pub(super) fn see(&self, point: &Vector3<f64>) -> Option<Seen> {
        let z = point.z;
        if !(z > 0.0) {
            return None;
        }
        let (x, y) = (point.x / z, point.y / z);
        let [k1, k2, p1, p2, k3, k4, k5, k6] = self.coefficients;
        let s = x * x + y * y;
        let over = 1.0 + s * (k1 + s * (k2 + s * k3));
        let under = 1.0 + s * (k4 + s * (k5 + s * k6));
        let gain = over / under;
        // By s.
        let gain_slope = (k1 + s * (2.0 * k2 + s * 3.0 * k3)
            - gain * (k4 + s * (2.0 * k5 + s * 3.0 * k6)))
            / under;
        let distorted = Vector2::new(
            gain * x + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
            gain * y + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let mixed = 2.0 * (gain_slope * x * y + p1 * x + p2 * y);
        let slope = Matrix2::new(
            gain + 2.0 * gain_slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            gain + 2.0 * gain_slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
        );
        // Written so that NaN is refused.
        if !(under > 0.0 && gain > 0.0 && slope.determinant() > 0.0) {
            return None;
        }
        let [fx, fy] = self.focal_px;
        let by_ideal = Matrix2::from_diagonal(&Vector2::new(fx, fy)) * slope;
        let along = |f: f64, at: f64, p: [f64; 2]| {
            let (over, under) = (f * at / under, -f * at * gain / under);
            let (s2, s3) = (s * s, s * s * s);
            [
                over * s,
                over * s2,
                f * p[0],
                f * p[1],
                over * s3,
                under * s,
                under * s2,
                under * s3,
            ]
        };
        let of_u = along(fx, x, [2.0 * x * y, s + 2.0 * x * x]);
        let of_v = along(fy, y, [s + 2.0 * y * y, 2.0 * x * y]);
        let first = [[distorted.x, 0.0, 1.0, 0.0], [0.0, distorted.y, 0.0, 1.0]];
        let by_numbers = SMatrix::from_fn(|row, k| match (k.checked_sub(4), row) {
            (None, _) => first[row][k],
            (Some(k), 0) => of_u[k],
            (Some(k), _) => of_v[k],
        });
        Some(Seen {
            pixel: PixelPoint::new(
                self.center_px[0] + fx * distorted.x,
                self.center_px[1] + fy * distorted.y,
            ),
            by_ideal,
            by_point: by_ideal * Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / z,
            by_numbers,
        })
    }

    /// The lens with a step added to its numbers.
    pub(super) fn stepped(&self, step: &[f64]) -> Self {
        let mut next = *self;
        let numbers = next.focal_px.iter_mut().chain(&mut next.center_px);
        for (number, change) in numbers.chain(&mut next.coefficients).zip(step) {
            *number += change;
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_estimate::pinhole::BrownCamera;

    const LENS: Lens = Lens {
        sensor: SensorSize::new(1280, 1024),
        focal_px: [1200.0, 1190.0],
        center_px: [651.0, 498.0],
        coefficients: [-0.28, 0.12, 6e-4, -4e-4, -0.03, 0.05, -0.02, 0.01],
        distortion: Distortion::Eight,
    };

    #[test]
    fn without_a_denominator_it_is_browns() {
        let mut lens = LENS;
        lens.coefficients[5..].fill(0.0);
        let brown = BrownCamera {
            sensor: lens.sensor,
            focal_px: lens.focal_px,
            center_px: lens.center_px,
            distortion: [-0.28, 0.12, 6e-4, -4e-4, -0.03],
        };
        for point in [[0.0, 0.0, 1.0], [120.0, -70.0, 400.0], [-0.5, 0.3, 1.0]] {
            let point = Vector3::from(point);
            let seen = lens.see(&point).unwrap().pixel;
            assert!(seen.distance_px(brown.project(&point).unwrap()) < 1e-9);
        }
        assert!(lens.see(&Vector3::new(0.1, 0.1, -1.0)).is_none());
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let point = Vector3::new(130.0, -90.0, 400.0);
        let seen = LENS.see(&point).unwrap();
        let difference = |more: PixelPoint, less: PixelPoint, step: f64| {
            Vector2::new(more.u - less.u, more.v - less.v) / (2.0 * step)
        };
        for k in 0..NUMBERS {
            let at = |size: f64| {
                let mut step = [0.0; NUMBERS];
                step[k] = size;
                LENS.stepped(&step).see(&point).unwrap().pixel
            };
            let expected = difference(at(1e-5), at(-1e-5), 1e-5);
            // Round-off of 1e-13 px over 2e-5, and the third derivative.
            assert!((seen.by_numbers.column(k) - expected).norm() < 1e-6, "{k}");
        }
        for k in 0..3 {
            let at = |size: f64| LENS.see(&(point + Vector3::ith(k, size))).unwrap().pixel;
            let expected = difference(at(1e-3), at(-1e-3), 1e-3);
            assert!((seen.by_point.column(k) - expected).norm() < 1e-6, "{k}");
        }
    }
}
