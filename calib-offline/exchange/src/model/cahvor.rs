//! JPL's CAHVOR and CAHVORE, with mrcal's numbers.
//!
//! Both bend rays about an axis `o` that need not be that of the image: `alpha` and `beta` turn it. With a point's part `omega`
//! along `o` and `l` across it, CAHVOR looks for the pixel of `omega` along and `l (1 + r0 + r1 t^2 + r2 t^4)` across, `t = l / omega`.
//! CAHVORE takes `t = chi`, a function of the angle `theta` of the ray, and its rays do not meet in a point: a ray at `theta` crosses
//! the axis at `(theta / sin(theta) - 1) (e0 + e1 theta^2 + e2 theta^4)`, mm.

use super::inverse::rising;
use super::{CameraModel, ImagePlane, central};
use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::{Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// CAHVOR, or CAHVORE.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cahvor {
    /// Focal lengths and principal point.
    pub plane: ImagePlane,
    /// `[alpha, beta]`: where the axis of distortion points, rad.
    pub axis_rad: [f64; 2],
    /// `r0, r1, r2`.
    pub radial: [f64; 3],
    /// For CAHVORE.
    pub entrance: Option<Entrance>,
}

/// What CAHVORE has beside CAHVOR.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entrance {
    /// `e0, e1, e2`, mm: how the entrance pupil wanders.
    pub shift_mm: [f64; 3],
    /// 1 for a perspective lens, 0 for a fisheye.
    pub linearity: f64,
}

/// The widest `t` that CAHVOR is turned around for: 89.9 degrees.
const WIDEST: f64 = 573.0;
/// Angles below which a ray counts as the axis, rad.
const ON_AXIS_RAD: f64 = 1e-12;

impl Entrance {
    /// The largest angle, rad.
    fn most_rad(&self) -> f64 {
        let linearity = self.linearity.abs();
        if linearity * PI > FRAC_PI_2 {
            FRAC_PI_2 / linearity
        } else {
            PI
        }
    }

    fn chi(&self, theta: f64) -> f64 {
        let linearity = self.linearity;
        if linearity < -1e-15 {
            (theta * linearity).sin() / linearity
        } else if linearity > 1e-15 {
            (theta * linearity).tan() / linearity
        } else {
            theta
        }
    }

    fn wandering(&self, theta: f64) -> f64 {
        let [e0, e1, e2] = self.shift_mm;
        let squared = theta * theta;
        e0 + squared * (e1 + squared * e2)
    }

    /// Where a ray crosses the axis, mm.
    fn crossing_mm(&self, theta: f64) -> f64 {
        // theta / sin(theta) - 1, by its series where that loses digits.
        let share = if theta < 1e-3 {
            theta * theta / 6.0
        } else {
            theta / theta.sin() - 1.0
        };
        share * self.wandering(theta)
    }

    /// The angle of the ray that passes through a point.
    fn theta(&self, along: f64, across: f64) -> Option<f64> {
        let start = across.atan2(along);
        // How far the point is off the ray, which falls with theta: halved between bounds, as its slope may vanish.
        let off = |theta: f64| {
            let (sin, cos) = theta.sin_cos();
            across * cos - along * sin + (theta - sin) * self.wandering(theta)
        };
        if off(start) == 0.0 {
            return Some(start);
        }
        let toward = off(start).signum();
        let mut width = 1e-6;
        while width < 4.0 {
            let other = (start + toward * width).clamp(0.0, self.most_rad());
            if off(other) * off(start) <= 0.0 {
                let (mut inner, mut outer) = (start, other);
                for _ in 0..200 {
                    let middle = (inner + outer) / 2.0;
                    if middle == inner || middle == outer {
                        break;
                    }
                    if off(middle) * off(start) > 0.0 {
                        inner = middle;
                    } else {
                        outer = middle;
                    }
                }
                return Some((inner + outer) / 2.0);
            }
            width *= 2.0;
        }
        None
    }
}

impl Cahvor {
    fn axis(&self) -> Vector3<f64> {
        let [(sin_a, cos_a), (sin_b, cos_b)] = self.axis_rad.map(f64::sin_cos);
        Vector3::new(cos_b * sin_a, sin_b, cos_b * cos_a)
    }

    /// How far across the axis, a unit along it, the pixel of a ray is looked for.
    fn bent(&self, t: f64) -> f64 {
        let [r0, r1, r2] = self.radial;
        let squared = t * t;
        t * (1.0 + r0 + squared * (r1 + squared * r2))
    }

    fn is_rising(&self, t: f64) -> bool {
        let [r0, r1, r2] = self.radial;
        let squared = t * t;
        1.0 + r0 + squared * (3.0 * r1 + squared * 5.0 * r2) > 0.0
    }
}

impl CameraModel for Cahvor {
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint> {
        let axis = self.axis();
        let along = point.dot(&axis);
        let sideways = point - axis * along;
        let across = sideways.norm();
        let t = match &self.entrance {
            None if along > 0.0 => across / along,
            None => return None,
            Some(entrance) => {
                let theta = entrance.theta(along, across)?;
                if !(theta < entrance.most_rad()) {
                    return None;
                }
                entrance.chi(theta)
            }
        };
        if !self.is_rising(t) {
            return None;
        }
        let bent = if across > 0.0 {
            axis + sideways * (self.bent(t) / across)
        } else {
            axis
        };
        if !(bent.z > 0.0) {
            return None;
        }
        self.plane.pixel(&(bent.xy() / bent.z))
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let axis = self.axis();
        let seen: Vector3<f64> = Vector2::push(&self.plane.place(pixel), 1.0);
        let along = seen.dot(&axis);
        let sideways = seen - axis * along;
        let across = sideways.norm();
        if !(along > 0.0) {
            return None;
        }
        if across <= ON_AXIS_RAD * along {
            return central(axis);
        }
        let sideways = sideways / across;
        let wanted = across / along;
        let Some(entrance) = &self.entrance else {
            // Never much wider than the bent ray itself: parts then resolve where it would fall.
            let most = (4.0 * wanted).clamp(1.0, WIDEST);
            let t = rising(|t| self.bent(t), wanted, most)?;
            return central(axis + sideways * t);
        };
        let most = entrance.most_rad() * (1.0 - 1e-9);
        let theta = rising(|theta| self.bent(entrance.chi(theta)), wanted, most)?;
        let (sin, cos) = theta.sin_cos();
        let ray = central(axis * cos + sideways * sin)?;
        Some(Ray {
            origin_mm: axis * entrance.crossing_mm(theta),
            ..ray
        })
    }

    fn is_central(&self) -> bool {
        let shift = self.entrance.map(|entrance| entrance.shift_mm);
        shift.is_none_or(|mm| mm == [0.0; 3])
    }
}
