//! Lenses in air: the ray of a pixel before anything stands in its way.

use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::{Matrix2, Vector2, Vector3};
use serde::Serialize;

/// A lens; frame as in [`super::CameraOptics`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Lens {
    /// One center of projection.
    Perspective(PerspectiveLens),
    /// Very wide, with a pupil that moves along the axis.
    Fisheye(FisheyeLens),
    /// All rays parallel.
    Telecentric(TelecentricLens),
}

impl Lens {
    /// The ray of a pixel in air, mm; the direction has unit length.
    pub fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        match self {
            Self::Perspective(lens) => lens.ray(pixel),
            Self::Fisheye(lens) => lens.ray(pixel),
            Self::Telecentric(lens) => Some(lens.ray(pixel)),
        }
    }
}

/// A smooth local displacement: the pixel x sees what the undisturbed lens shows at
/// `x + amplitude_px * exp(-|x - center|^2 / (2 width_px^2))`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bump {
    /// Where it is strongest, px.
    pub center: PixelPoint,
    /// Displacement there, (u, v), px.
    pub amplitude_px: [f64; 2],
    /// Standard deviation of the Gaussian, px.
    pub width_px: f64,
}

/// Distortion of normalized image coordinates (x/z, y/z).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Distortion {
    /// None: a pinhole.
    None,
    /// Brown-Conrady with the coefficient order and signs that `OpenCV` made common; it maps ideal to
    /// distorted coordinates, so its inverse is iterated.
    Brown {
        /// Radial, r^2.
        k1: f64,
        /// Radial, r^4.
        k2: f64,
        /// Radial, r^6.
        k3: f64,
        /// Tangential, `2 p1 x y` in x.
        p1: f64,
        /// Tangential, `p2 (r^2 + 2 x^2)` in x.
        p2: f64,
    },
    /// Division model: ideal = distorted / (1 + l1 r^2 + l2 r^4), r of the distorted point.
    /// Follows strong barrel distortion, in closed form.
    Division {
        /// Coefficient of r^2.
        l1: f64,
        /// Coefficient of r^4.
        l2: f64,
    },
}

impl Distortion {
    /// Ideal to distorted coordinates, and the Jacobian. Only for [`Self::Brown`].
    fn brown(k: [f64; 5], ideal: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let [k1, k2, k3, p1, p2] = k;
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        // d radial / d(r^2)
        let slope = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3);
        let distorted = Vector2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let cross = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let jacobian = Matrix2::new(
            radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
            cross,
            cross,
            radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
        );
        (distorted, jacobian)
    }

    /// Distorted coordinates of an ideal point; `None` if the model has only the other direction.
    pub fn distort(&self, ideal: Vector2<f64>) -> Option<Vector2<f64>> {
        match *self {
            Self::None => Some(ideal),
            Self::Brown { k1, k2, k3, p1, p2 } => Some(Self::brown([k1, k2, k3, p1, p2], ideal).0),
            Self::Division { .. } => None,
        }
    }

    /// Ideal coordinates of a distorted point, to round-off.
    ///
    /// `None` where the model folds over: a polynomial is an image of the plane only so far out.
    pub fn undistort(&self, distorted: Vector2<f64>) -> Option<Vector2<f64>> {
        match *self {
            Self::None => Some(distorted),
            Self::Brown { k1, k2, k3, p1, p2 } => {
                let k = [k1, k2, k3, p1, p2];
                let mut ideal = distorted;
                for _ in 0..50 {
                    let (image, jacobian) = Self::brown(k, ideal);
                    if !(jacobian.determinant() > 0.0 && jacobian.trace() > 0.0) {
                        return None;
                    }
                    let step = jacobian.try_inverse()? * (distorted - image);
                    ideal += step;
                    if step.norm() < 1e-15 * (1.0 + ideal.norm()) {
                        return Some(ideal);
                    }
                }
                // Newton may go on trembling in the last bit.
                let (image, _) = Self::brown(k, ideal);
                ((distorted - image).norm() < 1e-14).then_some(ideal)
            }
            Self::Division { l1, l2 } => {
                let r2 = distorted.norm_squared();
                let divisor = 1.0 + r2 * (l1 + r2 * l2);
                // Monotone where d(r / divisor)/dr > 0.
                (divisor > 0.05 && 1.0 - l1 * r2 - 3.0 * l2 * r2 * r2 > 0.0)
                    .then(|| distorted / divisor)
            }
        }
    }
}

/// Pinhole with distortion and, on top, local bumps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PerspectiveLens {
    /// Focal length in u and v, px.
    pub focal_px: [f64; 2],
    /// Principal point.
    pub principal: PixelPoint,
    /// Smooth distortion.
    pub distortion: Distortion,
    /// Local distortion, added in the image.
    pub bumps: Vec<Bump>,
}

impl PerspectiveLens {
    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let (mut u, mut v) = (pixel.u, pixel.v);
        for bump in &self.bumps {
            let (du, dv) = (pixel.u - bump.center.u, pixel.v - bump.center.v);
            let weight = (-(du * du + dv * dv) / (2.0 * bump.width_px * bump.width_px)).exp();
            u += weight * bump.amplitude_px[0];
            v += weight * bump.amplitude_px[1];
        }
        let distorted = Vector2::new(
            (u - self.principal.u) / self.focal_px[0],
            (v - self.principal.v) / self.focal_px[1],
        );
        let ideal = self.distortion.undistort(distorted)?;
        Some(Ray {
            origin_mm: Vector3::zeros(),
            direction: Vector3::new(ideal.x, ideal.y, 1.0).normalize(),
        })
    }
}

/// Image radius `r = focal_px * theta (1 + k1 theta^2 + k2 theta^4)`; the pupil lies on the axis
/// at `pupil_mm[0] theta^2 + pupil_mm[1] theta^4`, so the rays have no common point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FisheyeLens {
    /// Pixels per radian at the center.
    pub focal_px: f64,
    /// Where the axis meets the sensor.
    pub principal: PixelPoint,
    /// Deviation from the equidistant projection, theta^2.
    pub k1: f64,
    /// The same, theta^4.
    pub k2: f64,
    /// How far the pupil moves towards the scene, mm per rad^2 and per rad^4.
    pub pupil_mm: [f64; 2],
    /// Largest angle to the axis that forms an image, rad.
    pub max_angle_rad: f64,
}

impl FisheyeLens {
    /// Angle to the axis at an image radius (px), to round-off; `None` outside the image circle.
    fn angle_rad(&self, radius_px: f64) -> Option<f64> {
        let target = radius_px / self.focal_px;
        let mut theta = target;
        for _ in 0..50 {
            let t2 = theta * theta;
            let value = theta * (1.0 + t2 * (self.k1 + t2 * self.k2));
            let slope = 1.0 + t2 * (3.0 * self.k1 + 5.0 * t2 * self.k2);
            if slope.is_nan() || slope <= 0.0 {
                return None;
            }
            let step = (target - value) / slope;
            theta += step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        (theta <= self.max_angle_rad).then_some(theta)
    }

    fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let (du, dv) = (pixel.u - self.principal.u, pixel.v - self.principal.v);
        let radius_px = du.hypot(dv);
        let theta = self.angle_rad(radius_px)?;
        let (sin, cos) = theta.sin_cos();
        // sin(theta) / radius, finite on the axis.
        let scale = if radius_px > 0.0 {
            sin / radius_px
        } else {
            0.0
        };
        let t2 = theta * theta;
        Some(Ray {
            origin_mm: Vector3::new(0.0, 0.0, t2 * (self.pupil_mm[0] + t2 * self.pupil_mm[1])),
            direction: Vector3::new(du * scale, dv * scale, cos),
        })
    }
}

/// Every ray parallel to the axis, apart from `skew_rad_per_mm` times its distance from it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TelecentricLens {
    /// Object size of a pixel, mm.
    pub mm_per_px: f64,
    /// Where the axis meets the sensor.
    pub principal: PixelPoint,
    /// Departure from telecentricity: tangent of the ray's angle per mm from the axis.
    pub skew_rad_per_mm: f64,
}

impl TelecentricLens {
    fn ray(&self, pixel: PixelPoint) -> Ray {
        let x = (pixel.u - self.principal.u) * self.mm_per_px;
        let y = (pixel.v - self.principal.v) * self.mm_per_px;
        Ray {
            origin_mm: Vector3::new(x, y, 0.0),
            direction: Vector3::new(x * self.skew_rad_per_mm, y * self.skew_rad_per_mm, 1.0)
                .normalize(),
        }
    }
}
