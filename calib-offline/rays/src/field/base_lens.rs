//! The lens underneath a ray field: what the field's polynomial and spline deviate from.

use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the base lens maps the angle off axis to a radius on the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Projection {
    /// `radius = f tan(theta)`.
    Perspective,
    /// `radius = f theta`.
    Equidistant,
}

/// Number of radial coefficients.
pub const RADIAL_TERMS: usize = 4;
/// Radii (in focal lengths) below which the quotients of the radial mapping are taken from its
/// series: there they lose digits, and what the series leaves out is below round-off.
const SERIES_BELOW: f64 = 1e-3;
/// Largest angle off axis, rad; what a mapping makes larger is held here, short of straight back.
const LARGEST_ANGLE_RAD: f64 = 3.0;

/// The rotationally symmetric lens from which the field's direction deviates.
///
/// `rho = r (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8)`, `r` = distance from the center in focal
/// lengths; then `tan(theta) = rho` (perspective, Brown's radial distortion turned around) or
/// `theta = rho` (equidistant, likewise Kannala and Brandt's). Beyond `reach` the mapping goes on
/// straight, so that it stays tame where nothing was seen.
///
/// It has no say in what a field can follow: it only leaves the polynomial a small smooth
/// difference, which the smoothness weights judge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BaseLens {
    /// Kind of lens.
    pub projection: Projection,
    /// Focal length, px.
    pub focal_px: f64,
    /// Center of symmetry, px from the middle of the sensor.
    pub center_px: [f64; 2],
    /// `k1` to `k4`.
    pub radial: [f64; RADIAL_TERMS],
    /// Radius up to which the coefficients hold, focal lengths.
    pub reach: f64,
}

impl BaseLens {
    /// A lens without distortion about the middle of the sensor.
    pub fn ideal(projection: Projection, focal_px: f64) -> Self {
        Self {
            projection,
            focal_px,
            center_px: [0.0; 2],
            radial: [0.0; RADIAL_TERMS],
            reach: 1.0,
        }
    }

    /// Half-angle vector of the direction at an offset from the middle of the sensor, px, and its
    /// derivative per px.
    pub fn evaluate(&self, offset_px: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let x = (offset_px - Vector2::from(self.center_px)) / self.focal_px;
        let r2 = x.norm_squared();
        let r = r2.sqrt();
        // s = g x with g(r) = 2 tan(theta/2) / r, and h = g'(r) / r.
        let (g, h) = if r < SERIES_BELOW {
            let cubic = self.radial[0]
                + match self.projection {
                    Projection::Perspective => -0.25,
                    Projection::Equidistant => 1.0 / 12.0,
                };
            (1.0 + cubic * r2, 2.0 * cubic)
        } else {
            let (rho, rho_slope) = self.radius(r);
            let (length, slope) = match self.projection {
                Projection::Perspective => {
                    let root = rho.hypot(1.0);
                    (2.0 * rho / (1.0 + root), 2.0 / (root * (1.0 + root)))
                }
                Projection::Equidistant => {
                    let t = (rho.min(LARGEST_ANGLE_RAD) / 2.0).tan();
                    (2.0 * t, 1.0 + t * t)
                }
            };
            let g = length / r;
            (g, (slope * rho_slope - g) / r2)
        };
        let derivative = (Matrix2::identity() * g + x * x.transpose() * h) / self.focal_px;
        (x * g, derivative)
    }

    /// `rho` and its slope.
    fn radius(&self, r: f64) -> (f64, f64) {
        let inside = r.min(self.reach);
        let r2 = inside * inside;
        let (mut value, mut slope) = (0.0, 0.0);
        for (power, k) in self.radial.iter().enumerate().rev() {
            value = value * r2 + k;
            slope = slope * r2 + (2 * power + 3) as f64 * k;
        }
        let (value, slope) = (1.0 + value * r2, 1.0 + slope * r2);
        (inside * value + (r - inside) * slope, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::transport;
    use nalgebra::Vector3;

    #[test]
    fn perspective_lens_is_the_pinhole() {
        let base = BaseLens::ideal(Projection::Perspective, 500.0);
        let (s, _) = base.evaluate(&Vector2::new(300.0, -200.0));
        let expected = Vector3::new(300.0, -200.0, 500.0).normalize();
        assert!((transport::direction(&s).normalize() - expected).norm() < 1e-15);
    }

    #[test]
    fn equidistant_lens_reaches_ninety_degrees_at_its_radius() {
        let base = BaseLens::ideal(Projection::Equidistant, 100.0);
        let (s, _) = base.evaluate(&Vector2::new(50.0 * std::f64::consts::PI, 0.0));
        assert!((s - Vector2::new(2.0, 0.0)).norm() < 1e-14);
    }

    #[test]
    fn a_distorted_lens_sees_its_angle_at_its_radius() {
        let base = BaseLens {
            center_px: [7.0, -4.0],
            radial: [-0.1, 0.02, 0.0, 0.0],
            reach: 1.0,
            ..BaseLens::ideal(Projection::Equidistant, 100.0)
        };
        let (s, _) = base.evaluate(&Vector2::new(57.0, -4.0));
        let theta: f64 = 0.5 * (1.0 - 0.1 * 0.25 + 0.02 * 0.0625);
        assert!((s - Vector2::new(2.0 * (theta / 2.0).tan(), 0.0)).norm() < 1e-14);
    }

    #[test]
    fn derivative_matches_differences() {
        for projection in [Projection::Perspective, Projection::Equidistant] {
            let base = BaseLens {
                center_px: [12.0, -5.0],
                radial: [-0.1, 0.05, -0.01, 0.002],
                reach: 1.2,
                ..BaseLens::ideal(projection, 400.0)
            };
            // The center, near it, and outside of the reach.
            for offset in [[12.0, -5.0], [12.3, -5.1], [350.0, -120.0], [10.0, 600.0]] {
                let offset = Vector2::from(offset);
                let (_, derivative) = base.evaluate(&offset);
                for k in 0..2 {
                    let mut step = Vector2::zeros();
                    step[k] = 1e-4;
                    let difference = (base.evaluate(&(offset + step)).0
                        - base.evaluate(&(offset - step)).0)
                        / 2e-4;
                    assert!((difference - derivative.column(k)).norm() < 1e-10);
                }
            }
        }
    }
}
