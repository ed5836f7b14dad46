//! The lens that sees points nearest to their pixels, and the turn of the frame that goes with it.

use super::distortion::{Distortion, MOST_COEFFICIENTS};
use super::lens::{Lens, NUMBERS};
use super::line;
use calib_rays::geometry::so3::{self, skew};
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::numerics::levenberg::{self, Problem, Tried};
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

/// Numbers of a lens, and the turn.
const PARAMETERS: usize = NUMBERS + 3;
type Parameters = SVector<f64, PARAMETERS>;

const SEARCH: levenberg::Settings = levenberg::Settings {
    max_linearizations: 100,
    max_steps: 200,
    first_damping: 1e-4,
    least_damping: 1e-15,
    most_damping: 1e3,
    growth: 10.0,
    growth_from: 1e-8,
    singular_damping: 1.0,
    least_after_singular: 1e-12,
    accepts_equal: false,
};
/// A step that moves no pixel by more, RMS, is the last, px.
const STILL_PX: f64 = 1e-9;

/// A pixel and the point that it sees, from the center of projection, mm.
pub(super) type Sample = (PixelPoint, Vector3<f64>);

/// A lens and `new_from_old`, the turn into its frame.
pub(super) type Turned = (Lens, Matrix3<f64>);

/// The lens without distortion that comes nearest, as it stands: a fisheye or a pinhole. `None` where a pinhole has points beside or
/// behind it, or the image is mirrored.
pub(super) fn ideal(sensor: SensorSize, is_fisheye: bool, samples: &[Sample]) -> Option<Turned> {
    let place = |point: &Vector3<f64>| {
        if is_fisheye {
            let across = point.xy().norm();
            point.xy()
                * if across > 0.0 {
                    across.atan2(point.z) / across
                } else {
                    0.0
                }
        } else {
            point.xy() / point.z
        }
    };
    let places: Vec<Vector2<f64>> = samples.iter().map(|(_, point)| place(point)).collect();
    let along = |axis: usize, px: fn(&PixelPoint) -> f64| {
        let both = places.iter().zip(samples);
        line::rising(both.map(|(place, (pixel, _))| (place[axis], px(pixel))))
    };
    let (fx, cx) = along(0, |pixel| pixel.u)?;
    let (fy, cy) = along(1, |pixel| pixel.v)?;
    let is_seen = is_fisheye || samples.iter().all(|(_, point)| point.z > 0.0);
    is_seen.then(|| {
        let distortion = if is_fisheye {
            Distortion::Equidistant
        } else {
            Distortion::Four
        };
        let lens = Lens {
            sensor,
            focal_px: [fx, fy],
            center_px: [cx, cy],
            coefficients: [0.0; MOST_COEFFICIENTS],
            distortion,
        };
        (lens, Matrix3::identity())
    })
}

/// The nearest lens of a form from a start on.
pub(super) fn nearest((lens, turn): Turned, form: Distortion, samples: &[Sample]) -> Turned {
    let start = Lens {
        distortion: form,
        ..lens
    };
    // Whatever ends the search, what it reached is judged by its loss.
    levenberg::minimize(&LensFit { samples }, (start, turn), &SEARCH).state
}

struct LensFit<'a> {
    samples: &'a [Sample],
}

impl Problem for LensFit<'_> {
    type State = Turned;
    /// The normal matrix and the gradient.
    type Equations = (SMatrix<f64, PARAMETERS, PARAMETERS>, Parameters);
    type Step = Parameters;

    fn cost(&self, (lens, turn): &Self::State) -> f64 {
        let mut sum = 0.0;
        for (pixel, point) in self.samples {
            let Some(seen) = lens.see(&(turn * point)) else {
                return f64::INFINITY;
            };
            sum += seen.pixel.distance_px(*pixel).powi(2);
        }
        sum
    }

    fn linearize(&self, (lens, turn): &Self::State) -> Option<Self::Equations> {
        let mut normal = SMatrix::zeros();
        let mut gradient = Parameters::zeros();
        let own = 4 + lens.distortion.count();
        for (pixel, point) in self.samples {
            let point = turn * point;
            let seen = lens.see(&point)?;
            let mut by = SMatrix::<f64, 2, PARAMETERS>::zeros();
            by.columns_mut(0, own)
                .copy_from(&seen.by_numbers.columns(0, own));
            by.fixed_columns_mut::<3>(NUMBERS)
                .copy_from(&(-seen.by_point * skew(&point)));
            let residual = Vector2::new(seen.pixel.u - pixel.u, seen.pixel.v - pixel.v);
            normal += by.tr_mul(&by);
            gradient += by.tr_mul(&residual);
        }
        // What the form does not have stays where it is.
        for k in own..NUMBERS {
            normal[(k, k)] = 1.0;
        }
        Some((normal, gradient))
    }

    fn step(&self, (normal, gradient): &Self::Equations, damping: f64) -> Option<Parameters> {
        let damped = normal + SMatrix::from_diagonal(&(normal.diagonal() * damping));
        Some(-damped.cholesky()?.solve(gradient))
    }

    fn moved(&self, (lens, turn): &Self::State, step: &Parameters) -> Option<Self::State> {
        let by = step.fixed_rows::<3>(NUMBERS).into_owned();
        Some((
            lens.stepped(&step.as_slice()[..NUMBERS]),
            so3::exp(&by) * turn,
        ))
    }

    fn is_settled(&self, tried: &Tried<Self>) -> bool {
        let (normal, _) = tried.equations;
        let squared = tried.step.dot(&(normal * tried.step));
        squared <= STILL_PX * STILL_PX * self.samples.len() as f64
    }
}
