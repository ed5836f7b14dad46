//! Fields that are pinholes with Brown's distortion and nothing else (METHOD 2.9): the nearest ones in
//! place of any, and their nine numbers as the directions in which they may move.

use super::rebase::{seen_directions, turn_camera};
use crate::adjust::{Model, Observations};
use crate::pinhole::BrownCamera;
use crate::pinhole::brown::INTRINSICS;
use calib_rays::field::base_lens::RADIAL_TERMS;
use calib_rays::field::lattice::nearest_polynomial;
use calib_rays::field::lens_fit::SeenDirection;
use calib_rays::field::structured::{PLAIN_DEGREE, StructuredBasis};
use calib_rays::field::{BaseLens, Projection, transport};
use calib_rays::geometry::so3::{self, skew};
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::numerics::levenberg::{self, Problem, StopReason, Tried};
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

/// Numbers of a camera, and the turn of its frame.
const PARAMETERS: usize = INTRINSICS + 3;
type Parameters = SVector<f64, PARAMETERS>;

/// The start is the base lens, and the field is near a pinhole or none.
const SEARCH: levenberg::Settings = levenberg::Settings {
    max_linearizations: 50,
    max_steps: 100,
    first_damping: 1e-6,
    least_damping: 1e-15,
    most_damping: 1e3,
    growth: 10.0,
    growth_from: 1e-8,
    singular_damping: 1.0,
    least_after_singular: 1e-8,
    accepts_equal: false,
};
/// Places out to the sensor's farthest corner at which radial coefficients are fitted, and at most: so much
/// farther off axis as without distortion may that corner see.
const RADIAL_STEPS: f64 = 100.0;
const MOST_STEPS: u32 = 400;
/// A step that moves no corner by more, RMS, is the last, px.
const STILL_PX: f64 = 1e-9;

/// A model with pinholes for fields.
#[derive(Debug, Clone)]
pub struct Pinholes {
    /// The model.
    pub model: Model,
    /// Mean square by which the fields miss their pinholes at corners, px^2, the worst camera's.
    pub missed_px2: f64,
}

/// Puts the nearest pinhole in place of every camera's directions; from then on its numbers alone may
/// move. Radial distortion, focal length and center are free, aspect and decentering have their prior.
///
/// `None` if a lens sees what no pinhole can see.
pub fn as_pinholes(model: &Model, observations: &Observations) -> Option<Pinholes> {
    let mut next = model.clone();
    let mut missed_px2 = 0.0_f64;
    for camera_idx in 0..next.cameras.len() {
        let (seen, _) = seen_directions(&next, observations, camera_idx);
        let field = &next.cameras[camera_idx].field;
        let sensor = field.sensor;
        let middle = sensor.center();
        let start = BrownCamera::ideal(
            sensor,
            [field.base.focal_px; 2],
            PixelPoint::new(
                middle.u + field.base.center_px[0],
                middle.v + field.base.center_px[1],
            ),
        );
        let (pinhole, turn) = nearest_pinhole(start, &seen)?;
        // Round the pinhole's own center; what that leaves is the polynomial's.
        let base = base_of(&pinhole)?;
        let degree = field.direction.polynomial.degree;
        let beyond = nearest_polynomial(sensor, degree, |pixel| {
            let offset = Vector2::new(pixel.u - middle.u, pixel.v - middle.v);
            let s = transport::half_angle(&pinhole.ray(pixel)?.direction)?;
            Some(s - base.evaluate(&offset).0)
        })?;
        let basis = basis_of(&pinhole, sensor, degree)?;
        let mut sum_px2 = 0.0;
        for (offset, _) in &seen {
            let pixel = PixelPoint::new(middle.u + offset.x, middle.v + offset.y);
            let s = transport::half_angle(&pinhole.ray(pixel)?.direction)?;
            let field = base.evaluate(offset).0 + beyond.evaluate(sensor, pixel).0;
            sum_px2 += (s - field).norm_squared() * base.focal_px * base.focal_px;
        }
        missed_px2 = missed_px2.max(sum_px2 / seen.len().max(1) as f64);
        let camera = &mut next.cameras[camera_idx];
        camera.field.base = base;
        camera.field.direction.polynomial = beyond;
        camera.field.direction.spline = None;
        camera.basis = basis;
        turn_camera(&mut next, camera_idx, &turn);
    }
    Some(Pinholes {
        model: next,
        missed_px2,
    })
}

/// Whether all fields of a model are such pinholes.
pub fn are_pinholes(model: &Model) -> bool {
    let mut cameras = model.cameras.iter();
    cameras.all(|camera| camera.basis.is_lens_alone() && camera.field.direction.spline.is_none())
}

/// The rotationally symmetric part of a pinhole, turned around: the radial coefficients that come
/// nearest to it, as far as the sensor reaches or the distortion does not fold.
fn base_of(pinhole: &BrownCamera) -> Option<BaseLens> {
    let [k1, k2, _, _, k3] = pinhole.distortion;
    let focal_px = (pinhole.focal_px[0] + pinhole.focal_px[1]) / 2.0;
    let middle = pinhole.sensor.center();
    let [u, v] = [
        pinhole.center_px[0] - middle.u,
        pinhole.center_px[1] - middle.v,
    ];
    let reach = (middle.u + 0.5 + u.abs()).hypot(middle.v + 0.5 + v.abs()) / focal_px;
    let mut normal = SMatrix::<f64, RADIAL_TERMS, RADIAL_TERMS>::zeros();
    let mut right = SVector::<f64, RADIAL_TERMS>::zeros();
    let mut farthest = 0.0;
    for step in 1..=MOST_STEPS {
        // The angle's tangent, and where it is seen.
        let rho = f64::from(step) / RADIAL_STEPS * reach;
        let r2 = rho * rho;
        let r = rho * (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)));
        let is_folded = 1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3)) <= 0.0;
        if !(r <= reach) || is_folded {
            break;
        }
        farthest = r;
        let share = (r / reach).powi(2);
        let terms = SVector::<f64, RADIAL_TERMS>::from_fn(|k, _| r * share.powi(k as i32 + 1));
        normal += terms * terms.transpose();
        right += terms * (rho - r);
    }
    let scaled = normal.cholesky()?.solve(&right);
    Some(BaseLens {
        projection: Projection::Perspective,
        focal_px,
        center_px: [u, v],
        radial: std::array::from_fn(|k| scaled[k] / reach.powi(2 * k as i32 + 2)),
        reach: farthest,
    })
}

fn basis_of(pinhole: &BrownCamera, sensor: SensorSize, degree: usize) -> Option<StructuredBasis> {
    // Focal length, k1, k2, k3, center; aspect, p1, p2.
    let tags = std::array::from_fn::<_, INTRINSICS, _>(|k| (k >= 6).then_some(PLAIN_DEGREE));
    StructuredBasis::of_lens(sensor, degree, tags, |pixel| {
        let ideal = pinhole.ray(pixel)?.direction;
        let seen = pinhole.linearize(&ideal)?;
        let by_pixel: Matrix2<f64> = seen.by_point.fixed_columns::<2>(0).into_owned();
        let by_pixel = by_pixel.try_inverse()?;
        let x = ideal.xy();
        let length = ideal.norm();
        let s = x * (2.0 / (1.0 + length));
        let s_by_x = Matrix2::identity() * (2.0 / (1.0 + length))
            - x * x.transpose() * (2.0 / (length * (1.0 + length).powi(2)));
        let by = -(s_by_x * by_pixel * seen.by_intrinsics);
        let [fx, fy, cx, cy, k1, k2, p1, p2, k3] =
            std::array::from_fn(|k| by.column(k).into_owned());
        Some((s, [fx + fy, k1, k2, k3, cx, cy, fx - fy, p1, p2]))
    })
}

/// The pinhole that sees the corners nearest to their pixels, and the turn of the camera's frame that
/// goes with it (`new_from_old`).
fn nearest_pinhole(
    start: BrownCamera,
    seen: &[SeenDirection],
) -> Option<(BrownCamera, Matrix3<f64>)> {
    let fit = PinholeFit { start, seen };
    let state = (start, Matrix3::identity());
    if !fit.cost(&state).is_finite() {
        return None;
    }
    let outcome = levenberg::minimize(&fit, state, &SEARCH);
    let failed = matches!(outcome.stop, StopReason::Singular | StopReason::Undefined);
    (!failed).then_some(outcome.state)
}

struct PinholeFit<'a> {
    start: BrownCamera,
    seen: &'a [SeenDirection],
}

impl PinholeFit<'_> {
    fn pixel(&self, offset: &Vector2<f64>) -> PixelPoint {
        let middle = self.start.sensor.center();
        PixelPoint::new(middle.u + offset.x, middle.v + offset.y)
    }
}

impl Problem for PinholeFit<'_> {
    type State = (BrownCamera, Matrix3<f64>);
    /// The normal matrix and the gradient.
    type Equations = (SMatrix<f64, PARAMETERS, PARAMETERS>, Parameters);
    type Step = Parameters;

    fn cost(&self, (camera, turn): &Self::State) -> f64 {
        let mut sum = 0.0;
        for (offset, direction) in self.seen {
            let Some(seen) = camera.unfolded(&(turn * direction)) else {
                return f64::INFINITY;
            };
            sum += seen.distance_px(self.pixel(offset)).powi(2);
        }
        sum
    }

    fn linearize(&self, (camera, turn): &Self::State) -> Option<Self::Equations> {
        let mut normal = SMatrix::zeros();
        let mut gradient = Parameters::zeros();
        for (offset, direction) in self.seen {
            let point = turn * direction;
            let seen = camera.linearize(&point)?;
            let mut by = SMatrix::<f64, 2, PARAMETERS>::zeros();
            by.fixed_columns_mut::<INTRINSICS>(0)
                .copy_from(&seen.by_intrinsics);
            by.fixed_columns_mut::<3>(INTRINSICS)
                .copy_from(&(-seen.by_point * skew(&point)));
            let at = self.pixel(offset);
            let residual = Vector2::new(seen.pixel.u - at.u, seen.pixel.v - at.v);
            normal += by.tr_mul(&by);
            gradient += by.tr_mul(&residual);
        }
        Some((normal, gradient))
    }

    fn step(&self, (normal, gradient): &Self::Equations, damping: f64) -> Option<Parameters> {
        let damped = normal + SMatrix::from_diagonal(&(normal.diagonal() * damping));
        Some(-damped.cholesky()?.solve(gradient))
    }

    fn moved(&self, (camera, turn): &Self::State, step: &Parameters) -> Option<Self::State> {
        let mut numbers = camera.intrinsics();
        for (number, change) in numbers.iter_mut().zip(step.iter()) {
            *number += change;
        }
        let by = Vector3::new(step[INTRINSICS], step[INTRINSICS + 1], step[INTRINSICS + 2]);
        Some((camera.with_intrinsics(numbers), so3::exp(&by) * turn))
    }

    fn is_settled(&self, tried: &Tried<Self>) -> bool {
        let (normal, _) = tried.equations;
        let squared = tried.step.dot(&(normal * tried.step));
        squared <= STILL_PX * STILL_PX * self.seen.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENSOR: SensorSize = SensorSize::new(1280, 1024);
    const PINHOLE: BrownCamera = BrownCamera {
        sensor: SENSOR,
        focal_px: [1745.0, 1746.2],
        center_px: [652.5, 500.5],
        distortion: [-0.18, 0.12, 6e-4, -4e-4, -0.04],
    };

    fn s_of(pinhole: &BrownCamera, pixel: PixelPoint) -> Vector2<f64> {
        transport::half_angle(&pinhole.ray(pixel).unwrap().direction).unwrap()
    }

    fn field_of(pinhole: &BrownCamera) -> (BaseLens, calib_rays::field::polynomial::Polynomial) {
        let base = base_of(pinhole).unwrap();
        let middle = SENSOR.center();
        let beyond = nearest_polynomial(SENSOR, 7, |pixel| {
            let offset = Vector2::new(pixel.u - middle.u, pixel.v - middle.v);
            Some(s_of(pinhole, pixel) - base.evaluate(&offset).0)
        });
        (base, beyond.unwrap())
    }

    fn pixels() -> impl Iterator<Item = PixelPoint> {
        (0..20).flat_map(|j| {
            (0..25)
                .map(move |i| PixelPoint::new(f64::from(i) * 53.0 + 3.0, f64::from(j) * 53.0 + 7.0))
        })
    }

    #[test]
    fn base_and_polynomial_are_the_pinhole() {
        let (base, beyond) = field_of(&PINHOLE);
        let middle = SENSOR.center();
        for pixel in pixels() {
            let offset = Vector2::new(pixel.u - middle.u, pixel.v - middle.v);
            let s = base.evaluate(&offset).0 + beyond.evaluate(SENSOR, pixel).0;
            // A hundredth of what weak data feel, which is a thousandth of a pixel.
            assert!((s - s_of(&PINHOLE, pixel)).norm() * 1745.0 < 1e-3);
        }
    }

    #[test]
    fn the_nearest_pinhole_to_a_turned_pinhole_is_that() {
        let turn = so3::exp(&Vector3::new(0.01, -0.02, 0.004));
        let middle = SENSOR.center();
        let seen: Vec<SeenDirection> = pixels()
            .map(|pixel| {
                let direction = PINHOLE.ray(pixel).unwrap().direction.normalize();
                let offset = Vector2::new(pixel.u - middle.u, pixel.v - middle.v);
                (offset, turn.tr_mul(&direction))
            })
            .collect();
        let start = BrownCamera::ideal(SENSOR, [1800.0; 2], SENSOR.center());
        let (found, back) = nearest_pinhole(start, &seen).unwrap();
        let numbers = found.intrinsics().into_iter().zip(PINHOLE.intrinsics());
        for (found, truth) in numbers {
            assert!((found - truth).abs() < 1e-6 * truth.abs().max(1.0));
        }
        assert!((back - turn).norm() < 1e-8);
    }

    #[test]
    fn a_change_of_any_number_is_one_of_the_directions_and_a_turn() {
        let basis = basis_of(&PINHOLE, SENSOR, 7).unwrap();
        assert_eq!(basis.len(), INTRINSICS);
        assert!(basis.is_lens_alone());
        // Standard deviations where boards are frontal at one distance.
        let steps = [10.0, 10.0, 1.0, 1.0, 2e-3, 3e-2, 1e-4, 1e-4, 0.15];
        for (k, step) in steps.into_iter().enumerate() {
            let at = |sign: f64| {
                let mut numbers = PINHOLE.intrinsics();
                numbers[k] += sign * step * 1e-3;
                PINHOLE.with_intrinsics(numbers)
            };
            let (more, less) = (at(1.0), at(-1.0));
            let change = |pixel: PixelPoint| (s_of(&more, pixel) - s_of(&less, pixel)) * 500.0;
            let pixels: Vec<_> = pixels().collect();
            let mut columns: Vec<Vec<Vector2<f64>>> = (0..INTRINSICS)
                .map(|direction| {
                    let mut amounts = nalgebra::DVector::zeros(INTRINSICS);
                    amounts[direction] = 1.0;
                    let mut polynomial = calib_rays::field::polynomial::Polynomial::zero(7);
                    basis.add_to(&amounts, &mut polynomial);
                    let values = pixels.iter();
                    values.map(|p| polynomial.evaluate(SENSOR, *p).0).collect()
                })
                .collect();
            for axis in 0..3 {
                let mut by = Vector3::zeros();
                by[axis] = 1e-6;
                let turned = |pixel: &PixelPoint| {
                    let direction = PINHOLE.ray(*pixel).unwrap().direction;
                    let moved =
                        |by: Vector3<f64>| transport::half_angle(&(so3::exp(&by) * direction));
                    (moved(by).unwrap() - moved(-by).unwrap()) / 2e-6
                };
                columns.push(pixels.iter().map(turned).collect());
            }
            let matrix =
                nalgebra::DMatrix::from_fn(2 * pixels.len(), columns.len(), |row, column| {
                    columns[column][row / 2][row % 2]
                });
            let wanted = nalgebra::DVector::from_fn(2 * pixels.len(), |row, _| {
                change(pixels[row / 2])[row % 2]
            });
            let normal = matrix.tr_mul(&matrix).cholesky().unwrap();
            let found = normal.solve(&matrix.tr_mul(&wanted));
            let rest = matrix * found - &wanted;
            let rms_px = 1745.0 * rest.norm() / (pixels.len() as f64).sqrt();
            // What is beyond the polynomial's degree: no more than such data feel (METHOD 2.9).
            assert!(rms_px < 1e-3, "{k}: {rms_px}");
        }
    }
}
