//! The rotationally symmetric lens that is nearest to a field.
//!
//! A field's smoothness weights judge its deviation from the base lens. A lens whose center or
//! radial mapping is off leaves a deviation of high degree, most of all a wide one, and makes the
//! weights believe that the lens is rough. So the base is fitted anew once the field is known
//! roughly; the camera frame turns with it, so that the axis of the lens becomes its z axis.

use super::base_lens::{BaseLens, RADIAL_TERMS};
use super::transport;
use crate::geometry::so3;
use crate::numerics::levenberg::{self, Problem, StopReason, Tried};
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

/// Focal length, center, radial coefficients, turn.
const PARAMETERS: usize = 3 + RADIAL_TERMS + 3;
type Parameters = SVector<f64, PARAMETERS>;

/// At most 20 steps; the start is near and the priors hold what the data leave open, so that
/// singular equations are no use.
const SEARCH: levenberg::Settings = levenberg::Settings {
    max_linearizations: usize::MAX,
    max_steps: 20,
    first_damping: 1e-6,
    least_damping: 0.0,
    most_damping: f64::INFINITY,
    growth: 100.0,
    growth_from: 0.0,
    singular_damping: 0.0,
    least_after_singular: 0.0,
    accepts_equal: false,
};
/// A step that lowers the objective by a smaller share ends the fit.
const LEAST_GAIN: f64 = 1e-6;
/// Standard deviations of the parameters' changes before anything is seen: logarithm of the focal
/// length, center in shares of the reach, coefficients as what they do to the radius there in
/// shares of it, turn in rad. They keep apart what narrow lenses cannot tell apart, and the high
/// coefficients from following, with large values that cancel, what is not of the lens.
const PRIOR_SD: [f64; PARAMETERS] = [1.0, 0.1, 0.1, 0.3, 0.3, 0.01, 0.01, 0.5, 0.5, 0.5];
/// How much farther the mapping holds than to the farthest corner.
const REACH_MARGIN: f64 = 1.1;
/// A change by that much costs as much as a residual of so many px at one pixel.
const PRIOR_SHARE: f64 = 1.0;

/// Offset of a pixel from the middle of the sensor, px, and the unit direction that it sees, camera
/// frame.
pub type SeenDirection = (Vector2<f64>, Vector3<f64>);

/// The lens that comes nearest to what was seen, and the turn of the camera frame that goes with it
/// (`new_from_old`). `None` if no step makes it better than `start`.
///
/// `reach_px` is how far from the middle of the sensor the lens must hold; there its mapping has a
/// kink in the second derivative, which no corner may lie beyond.
///
/// Cost: 11 evaluations of the lens per direction and step, at most 20 steps.
pub fn nearest_lens(
    start: &BaseLens,
    seen: &[SeenDirection],
    reach_px: f64,
) -> Option<(BaseLens, Matrix3<f64>)> {
    if !(reach_px > 0.0) {
        return None;
    }
    let fit = LensFit {
        start: *start,
        reach_px,
        seen,
    };
    let start = Parameters::zeros();
    fit.cost_of(&start)?;
    let outcome = levenberg::minimize(&fit, start, &SEARCH);
    if matches!(outcome.stop, StopReason::Singular | StopReason::Undefined) {
        return None;
    }
    let at = outcome.state;
    let is_better = outcome.costs.len() > 1;
    is_better.then(|| (fit.lens(&at), turn(&at)))
}

/// The turn of the camera frame.
fn turn(at: &Parameters) -> Matrix3<f64> {
    so3::exp(&Vector3::new(at[7], at[8], at[9]))
}

struct LensFit<'a> {
    start: BaseLens,
    /// Distance of the farthest pixel from the middle of the sensor.
    reach_px: f64,
    seen: &'a [SeenDirection],
}

impl LensFit<'_> {
    fn lens(&self, at: &Parameters) -> BaseLens {
        let focal_px = self.start.focal_px * at[0].exp();
        // The center may move by so much.
        let reach = REACH_MARGIN * self.reach_px / focal_px;
        let mut radial = self.start.radial;
        for (k, coefficient) in radial.iter_mut().enumerate() {
            *coefficient += at[3 + k] / reach.powi(2 * k as i32 + 2);
        }
        let [u, v] = self.start.center_px;
        BaseLens {
            projection: self.start.projection,
            focal_px,
            center_px: [u + at[1] * self.reach_px, v + at[2] * self.reach_px],
            radial,
            reach,
        }
    }

    /// Differences of angle, in px at the middle of the image.
    fn residuals(&self, at: &Parameters) -> Option<Vec<Vector2<f64>>> {
        let (lens, turn) = (self.lens(at), turn(at));
        self.seen
            .iter()
            .map(|(offset, direction)| {
                let s = transport::half_angle(&(turn * direction))?;
                let (base, _) = lens.evaluate(offset);
                // The chart stretches angles by 1 + |s|^2 / 4.
                let scale = self.start.focal_px / (1.0 + s.norm_squared() / 4.0);
                Some((base - s) * scale)
            })
            .collect()
    }

    /// `None` where a direction cannot be seen or the cost has no bounds.
    fn cost_of(&self, at: &Parameters) -> Option<f64> {
        let sum: f64 = self.residuals(at)?.iter().map(Vector2::norm_squared).sum();
        let prior: f64 = (0..PARAMETERS)
            .map(|k| PRIOR_SHARE * (at[k] / PRIOR_SD[k]).powi(2))
            .sum();
        (sum + prior).is_finite().then_some(sum + prior)
    }
}

impl Problem for LensFit<'_> {
    type State = Parameters;
    /// The normal matrix and the gradient.
    type Equations = (SMatrix<f64, PARAMETERS, PARAMETERS>, Parameters);
    type Step = Parameters;

    fn cost(&self, at: &Parameters) -> f64 {
        self.cost_of(at).unwrap_or(f64::INFINITY)
    }

    fn linearize(&self, at: &Parameters) -> Option<Self::Equations> {
        const STEP: f64 = 1e-6;
        let here = self.residuals(at)?;
        let columns: Vec<Vec<Vector2<f64>>> = (0..PARAMETERS)
            .map(|k| {
                let mut moved = *at;
                moved[k] += STEP;
                self.residuals(&moved)
            })
            .collect::<Option<_>>()?;
        let mut normal = SMatrix::zeros();
        let mut gradient = Parameters::zeros();
        for (n, residual) in here.iter().enumerate() {
            let row = |k: usize| (columns[k][n] - residual) / STEP;
            let rows: [Vector2<f64>; PARAMETERS] = std::array::from_fn(row);
            for (i, a) in rows.iter().enumerate() {
                gradient[i] += a.dot(residual);
                for (j, b) in rows.iter().enumerate() {
                    normal[(i, j)] += a.dot(b);
                }
            }
        }
        for (k, sd) in PRIOR_SD.iter().enumerate() {
            normal[(k, k)] += PRIOR_SHARE / (sd * sd);
            gradient[k] += PRIOR_SHARE * at[k] / (sd * sd);
        }
        Some((normal, gradient))
    }

    fn step(&self, (normal, gradient): &Self::Equations, damping: f64) -> Option<Parameters> {
        let damped = normal + SMatrix::from_diagonal(&(normal.diagonal() * damping));
        Some(-damped.cholesky()?.solve(gradient))
    }

    fn moved(&self, at: &Parameters, step: &Parameters) -> Option<Parameters> {
        Some(at + step)
    }

    fn is_settled(&self, tried: &Tried<Self>) -> bool {
        let gain = (tried.cost - tried.reached) / tried.cost;
        tried.reached < tried.cost && gain < LEAST_GAIN
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Projection;

    #[test]
    fn a_wide_lens_off_center_is_found_with_its_turn() {
        let truth = BaseLens {
            center_px: [9.0, -6.0],
            radial: [-0.02, 0.002, 0.0, 0.0],
            reach: 2.5,
            ..BaseLens::ideal(Projection::Equidistant, 210.0)
        };
        let turn = so3::exp(&Vector3::new(0.02, -0.01, 0.005));
        let seen: Vec<_> = (-15..15)
            .flat_map(|j| (-20..20).map(move |i| (f64::from(i), f64::from(j))))
            .map(|(i, j)| {
                let offset = Vector2::new(16.0 * i, 16.0 * j);
                let direction = transport::direction(&truth.evaluate(&offset).0);
                (offset, turn.tr_mul(&direction.normalize()))
            })
            .collect();
        let start = BaseLens::ideal(Projection::Equidistant, 200.0);
        let (lens, found) = nearest_lens(&start, &seen, 420.0).unwrap();
        let squared: f64 = seen
            .iter()
            .map(|(offset, direction)| {
                let s = transport::half_angle(&(found * direction)).unwrap();
                ((lens.evaluate(offset).0 - s).norm() * 210.0).powi(2)
            })
            .sum();
        // The truth itself fits exactly and costs 0.2 of priors, so that no minimum leaves more;
        // twice that for the stretched chart.
        assert!(squared < 0.4, "{squared}");
        assert!((found - turn).norm() < 1e-3, "{found}");
        assert!((Vector2::from(lens.center_px) - Vector2::new(9.0, -6.0)).norm() < 0.2);
    }

    #[test]
    fn without_a_better_lens_there_is_none() {
        let start = BaseLens::ideal(Projection::Perspective, 200.0);
        let axis = (Vector2::zeros(), Vector3::z());
        assert_eq!(nearest_lens(&start, &[axis], 300.0), None);
        assert_eq!(nearest_lens(&start, &[], 300.0), None);
    }
}
