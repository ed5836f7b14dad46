//! The lenses that other tools know: the pinhole with 4 to 14 coefficients of distortion, and the fisheye.

use crate::brown::distort;
use crate::distortion::{Distortion, MOST_COEFFICIENTS};
use crate::model::{CameraModel, Fisheye, ImagePlane, Pinhole};
use calib_rays::geometry::{PixelPoint, SensorSize};
use nalgebra::{Matrix2, Matrix2x3, SMatrix, Vector2, Vector3};

/// Numbers of a lens, those that a form does not have included.
pub(super) const NUMBERS: usize = 4 + MOST_COEFFICIENTS;
/// Half a step of the differences that stand for the derivative by the sensor's tilt, rad.
const TILT_STEP_RAD: f64 = 1e-6;

/// A pinhole with distortion, or a fisheye.
///
/// A pinhole: with `x = X/Z`, `y = Y/Z`, `s = x^2 + y^2`, `g = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)`:
///
/// ```text
/// x' = g x + 2 p1 x y + p2 (s + 2 x^2) + s1 s + s2 s^2
/// y' = g y + p1 (s + 2 y^2) + 2 p2 x y + s3 s + s4 s^2
/// u = cx + fx x'', v = cy + fy y''
/// ```
///
/// where `x'', y''` are `x', y'` but for a tilted sensor, a homography by `tau_x, tau_y`. A fisheye: with `a` the angle off axis and `e` its
/// direction in the image, `(x'', y'') = e a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8)`.
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
    /// In the form's order, without unit (`tau_x`, `tau_y`: rad); zero where the form has none.
    pub coefficients: [f64; 14],
    /// Which of them it has.
    pub distortion: Distortion,
}

/// Where a point is seen, and how that changes.
pub(super) struct Seen {
    pub pixel: PixelPoint,
    /// By the point, px/mm.
    pub by_point: Matrix2x3<f64>,
    /// By `fx, fy, cx, cy` and the coefficients.
    pub by_numbers: SMatrix<f64, 2, NUMBERS>,
}

/// A place in the image plane, before focal lengths, and how it changes.
struct Place {
    at: Vector2<f64>,
    by_point: Matrix2x3<f64>,
    by_coefficients: SMatrix<f64, 2, MOST_COEFFICIENTS>,
}

impl Lens {
    /// The coefficients that the form has.
    pub fn own_coefficients(&self) -> &[f64] {
        &self.coefficients[..self.distortion.count()]
    }

    /// `fx, fy, cx, cy`.
    pub fn core(&self) -> [f64; 4] {
        let ([fx, fy], [cx, cy]) = (self.focal_px, self.center_px);
        [fx, fy, cx, cy]
    }

    /// The camera matrix, row by row.
    pub fn camera_matrix(&self) -> [f64; 9] {
        let [fx, fy, cx, cy] = self.core();
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    }

    /// As a camera that turns pixels into rays too.
    pub fn model(&self) -> Box<dyn CameraModel> {
        let plane = ImagePlane::new(self.core());
        if self.distortion.is_fisheye() {
            return Box::new(Fisheye::radial(plane, self.own_coefficients()));
        }
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tx, ty] = self.coefficients;
        Box::new(Pinhole {
            plane,
            coefficients: [k1, k2, p1, p2, k3, k4, k5, k6],
            prism: [s1, s2, s3, s4],
            tilt_rad: [tx, ty],
        })
    }

    /// The pixel that sees a point in front of the lens, and how it moves. `None` behind a pinhole, and where the distortion
    /// has folded back.
    pub(super) fn see(&self, point: &Vector3<f64>) -> Option<Seen> {
        let place = if self.distortion.is_fisheye() {
            self.fisheye_place(point)?
        } else {
            self.pinhole_place(point)?
        };
        let focal = Matrix2::from_diagonal(&Vector2::from(self.focal_px));
        let mut by_numbers = SMatrix::<f64, 2, NUMBERS>::zeros();
        by_numbers[(0, 0)] = place.at.x;
        by_numbers[(1, 1)] = place.at.y;
        by_numbers[(0, 2)] = 1.0;
        by_numbers[(1, 3)] = 1.0;
        by_numbers
            .fixed_columns_mut::<MOST_COEFFICIENTS>(4)
            .copy_from(&(focal * place.by_coefficients));
        Some(Seen {
            pixel: PixelPoint::new(
                self.center_px[0] + self.focal_px[0] * place.at.x,
                self.center_px[1] + self.focal_px[1] * place.at.y,
            ),
            by_point: focal * place.by_point,
            by_numbers,
        })
    }

    fn pinhole_place(&self, point: &Vector3<f64>) -> Option<Place> {
        let z = point.z;
        if !(z > 0.0) {
            return None;
        }
        let (x, y) = (point.x / z, point.y / z);
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tx, ty] = self.coefficients;
        let brown = distort(x, y, &[k1, k2, p1, p2, k3, k4, k5, k6]);
        let (under, gain) = (brown.under, brown.gain);
        let s = x * x + y * y;
        let prism_by_s = Vector2::new(s1 + 2.0 * s * s2, s3 + 2.0 * s * s4);
        let mut slope = brown.slope + prism_by_s * Vector2::new(2.0 * x, 2.0 * y).transpose();
        // Written so that NaN is refused.
        if !(under > 0.0 && gain > 0.0 && slope.determinant() > 0.0) {
            return None;
        }
        let mut at = brown.at + Vector2::new(s * (s1 + s * s2), s * (s3 + s * s4));
        let radial = |x: f64| {
            let (over, below) = (x / under, -x * gain / under);
            [
                over * s,
                over * s * s,
                over * s * s * s,
                below * s,
                below * s * s,
                below * s * s * s,
            ]
        };
        let (of_x, of_y) = (radial(x), radial(y));
        let mut by = SMatrix::<f64, 2, MOST_COEFFICIENTS>::zeros();
        for (column, k) in [0, 1, 4, 5, 6, 7].into_iter().enumerate() {
            by[(0, k)] = of_x[column];
            by[(1, k)] = of_y[column];
        }
        by.set_column(2, &Vector2::new(2.0 * x * y, s + 2.0 * y * y));
        by.set_column(3, &Vector2::new(s + 2.0 * x * x, 2.0 * x * y));
        for (k, value) in [(8, s), (9, s * s)] {
            by[(0, k)] = value;
            by[(1, k + 2)] = value;
        }
        if self.distortion == Distortion::Fourteen {
            let before = at;
            let (tilted, by_place) = tilted([tx, ty], &before)?;
            by = by_place * by;
            for (axis, column) in [(0, 12), (1, 13)] {
                let moved = |by_rad: f64| {
                    let mut tilt_rad = [tx, ty];
                    tilt_rad[axis] += by_rad;
                    tilted_place(tilt_rad, &before)
                };
                let difference = moved(TILT_STEP_RAD)? - moved(-TILT_STEP_RAD)?;
                by.set_column(column, &(difference / (2.0 * TILT_STEP_RAD)));
            }
            slope = by_place * slope;
            at = tilted;
        }
        Some(Place {
            at,
            by_point: slope * Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / z,
            by_coefficients: by,
        })
    }

    fn fisheye_place(&self, point: &Vector3<f64>) -> Option<Place> {
        let across = point.xy().norm();
        let angle = across.atan2(point.z);
        let [k1, k2, k3, k4, ..] = self.coefficients;
        let s = angle * angle;
        let gain = 1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)));
        let by_angle = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)));
        // Written so that NaN is refused.
        if !(gain > 0.0 && by_angle > 0.0) {
            return None;
        }
        if across == 0.0 {
            return (point.z > 0.0).then(|| Place {
                at: Vector2::zeros(),
                by_point: Matrix2x3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0) / point.z,
                by_coefficients: SMatrix::zeros(),
            });
        }
        let radius = angle * gain;
        let outwards = point.xy() / across;
        let around = Vector2::new(-outwards.y, outwards.x);
        let angle_by_point = Vector3::new(outwards.x * point.z, outwards.y * point.z, -across)
            / point.norm_squared();
        let by_point = outwards * angle_by_point.transpose() * by_angle
            + around * (around.push(0.0) * (radius / across)).transpose();
        let mut by_coefficients = SMatrix::<f64, 2, MOST_COEFFICIENTS>::zeros();
        let mut power = angle;
        for k in 0..4 {
            power *= s;
            by_coefficients.set_column(k, &(outwards * power));
        }
        Some(Place {
            at: outwards * radius,
            by_point,
            by_coefficients,
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

/// Where a tilted sensor has a place, and its derivative by the place; `None` beyond its horizon.
fn tilted(tilt_rad: [f64; 2], place: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let homography = Pinhole::tilt_of(tilt_rad);
    let onto = homography * place.push(1.0);
    if !(onto.z > 0.0) {
        return None;
    }
    let at = onto.xy() / onto.z;
    let upper = homography.fixed_view::<2, 2>(0, 0);
    let lower = homography.fixed_view::<1, 2>(2, 0);
    Some((at, (upper - at * lower) / onto.z))
}

fn tilted_place(tilt_rad: [f64; 2], place: &Vector2<f64>) -> Option<Vector2<f64>> {
    tilted(tilt_rad, place).map(|(at, _)| at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_estimate::pinhole::BrownCamera;

    const LENS: Lens = Lens {
        sensor: SensorSize::new(1280, 1024),
        focal_px: [1200.0, 1190.0],
        center_px: [651.0, 498.0],
        coefficients: [
            -0.28, 0.12, 6e-4, -4e-4, -0.03, 0.05, -0.02, 0.01, 1e-3, -5e-4, -8e-4, 4e-4, 0.02,
            -0.03,
        ],
        distortion: Distortion::Fourteen,
    };

    fn lens(distortion: Distortion) -> Lens {
        let mut lens = Lens { distortion, ..LENS };
        if distortion.is_fisheye() {
            lens.coefficients[..4].copy_from_slice(&[0.03, -0.012, 0.004, -6e-4]);
        }
        lens.coefficients[distortion.count()..].fill(0.0);
        lens
    }

    const FORMS: [Distortion; 6] = [
        Distortion::Four,
        Distortion::Five,
        Distortion::Eight,
        Distortion::Twelve,
        Distortion::Fourteen,
        Distortion::Equidistant,
    ];

    #[test]
    fn without_a_denominator_it_is_browns() {
        let lens = lens(Distortion::Five);
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
    fn every_form_is_the_model_that_is_tested_against_other_tools() {
        for form in FORMS {
            let lens = lens(form);
            let model = lens.model();
            for point in [[0.0, 0.0, 1.0], [120.0, -70.0, 400.0], [-0.5, 0.3, 1.0]] {
                let point = Vector3::from(point);
                let [own, other] = [
                    lens.see(&point).unwrap().pixel,
                    model.project(&point).unwrap(),
                ];
                assert!(own.distance_px(other) < 1e-10, "{form:?}");
            }
        }
        // Beyond 90 degrees there is no pinhole, but a fisheye.
        let behind = Vector3::new(3.0, 1.0, -0.5);
        assert!(lens(Distortion::Four).see(&behind).is_none());
        let fisheye = lens(Distortion::Equidistant);
        let [own, other] = [
            fisheye.see(&behind).unwrap().pixel,
            fisheye.model().project(&behind).unwrap(),
        ];
        assert!(own.distance_px(other) < 1e-10);
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let point = Vector3::new(130.0, -90.0, 400.0);
        let difference = |more: PixelPoint, less: PixelPoint, step: f64| {
            Vector2::new(more.u - less.u, more.v - less.v) / (2.0 * step)
        };
        for form in FORMS {
            let lens = lens(form);
            let seen = lens.see(&point).unwrap();
            for k in 0..4 + form.count() {
                let at = |size: f64| {
                    let mut step = [0.0; NUMBERS];
                    step[k] = size;
                    lens.stepped(&step).see(&point).unwrap().pixel
                };
                let expected = difference(at(1e-5), at(-1e-5), 1e-5);
                // Round-off of 1e-13 px over 2e-5, and the third derivative.
                assert!(
                    (seen.by_numbers.column(k) - expected).norm() < 1e-6,
                    "{form:?} {k}"
                );
            }
            for axis in 0..3 {
                let at = |size: f64| {
                    let mut moved = point;
                    moved[axis] += size;
                    lens.see(&moved).unwrap().pixel
                };
                let expected = difference(at(1e-3), at(-1e-3), 1e-3);
                assert!(
                    (seen.by_point.column(axis) - expected).norm() < 1e-8,
                    "{form:?}"
                );
            }
        }
    }
}
