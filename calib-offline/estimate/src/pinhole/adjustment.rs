//! Bundle adjustment of Brown cameras: intrinsics, extrinsics and poses moved until the sum of
//! squared reprojection errors is least. One camera and a whole rig are the same problem.

use super::PinholeError;
use super::brown::INTRINSICS;
use super::reprojection::{
    assemble, check_start, columns, cost, residuals, shared_count, stepped, taking_part,
};
use crate::adjust::Observations;
use crate::adjust::objective::Weights;
use crate::adjust::robust::{StudentT, reweight};
use calib_rays::numerics::arrowhead::{Arrowhead, Step};
use calib_rays::numerics::levenberg::{self, Problem, StopReason, Tried};
use serde::{Deserialize, Serialize};

pub use super::reprojection::{Free, State};

/// Rounds of re-weighting.
const ROBUST_ROUNDS: usize = 10;
/// A change of the residuals' variance by less than this share ends them.
const SETTLED_VARIANCE: f64 = 1e-6;

/// How much a residual counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    /// By its square and its corner's relative weight: what `OpenCV` does.
    #[default]
    LeastSquares,
    /// By a Student-t distribution fitted to the residuals, as in the joint estimate.
    StudentT,
}

/// When to stop, and how residuals count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How residuals count.
    pub loss: Loss,
    /// Most linearizations per minimization.
    pub max_iterations: usize,
    /// Stop when a step promises to lower the cost by less than this share of it.
    pub relative_decrease: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            loss: Loss::LeastSquares,
            max_iterations: 200,
            relative_decrease: 1e-12,
        }
    }
}

impl Settings {
    fn of_search(&self) -> levenberg::Settings {
        levenberg::Settings {
            max_linearizations: self.max_iterations,
            max_steps: usize::MAX,
            first_damping: 1e-3,
            least_damping: 1e-14,
            most_damping: 1e12,
            growth: 10.0,
            growth_from: 1e-8,
            singular_damping: 1.0,
            least_after_singular: 1e-8,
            accepts_equal: false,
        }
    }
}

/// The state reached, and how.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Best state found.
    pub state: State,
    /// What minima are compared by, the less the better: with least squares the cost, with robust
    /// weights the inverse of the geometric mean of the residuals' densities.
    pub misfit: f64,
    /// Sum of squared residuals, each with its corner's relative weight, px^2.
    pub cost_px2: f64,
    /// Root mean square length of the residual vectors of all corners used, px.
    pub rms_px: f64,
    /// Corners used; with robust weights, those of weight zero are not.
    pub corner_count: usize,
    /// Which, per view and corner.
    pub is_used: Vec<Vec<bool>>,
    /// Linearizations.
    pub iterations: usize,
    /// Why it ended.
    pub stop: StopReason,
    /// Per camera, from the residuals' own variance. `None` if the data leave something open.
    pub deviations: Option<Vec<CameraDeviations>>,
}

/// Standard deviations of a camera's numbers; 0 for what was held.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CameraDeviations {
    /// Of `fx, fy, cx, cy, k1, k2, p1, p2, k3`.
    pub intrinsics: [f64; INTRINSICS],
    /// Of its place in the first camera's frame, by the perturbation of
    /// [`calib_rays::geometry::RigidTransform::perturbed`]: rotation in rad, translation in mm.
    pub place: [f64; 6],
}

/// Moves what is free from a state to the nearest minimum.
///
/// # Errors
/// [`PinholeError::BehindCamera`] if the start has boards behind a camera.
pub fn minimize(
    start: State,
    observations: &Observations,
    free: Free,
    settings: &Settings,
) -> Result<Outcome, PinholeError> {
    check_start(&start, observations)?;
    let plain: Weights = observations
        .views
        .iter()
        .map(|view| view.corners.iter().map(|c| c.relative_weight).collect())
        .collect();
    let (mut state, mut run) = descend(start, observations, &plain, free, settings);
    let mut weights = plain;
    let mut noise_found = None;
    if settings.loss == Loss::StudentT {
        for _ in 0..ROBUST_ROUNDS {
            let residuals = residuals(&state, observations);
            let (noise, next) =
                reweight(&residuals, observations, 1.0, noise_found.as_ref(), false);
            let change = noise_found.map_or(f64::INFINITY, |known: StudentT| {
                (noise.variance_px2 / known.variance_px2).ln().abs()
            });
            weights = next;
            let (next, again) = descend(state, observations, &weights, free, settings);
            state = next;
            run = Run {
                iterations: run.iterations + again.iterations,
                ..again
            };
            noise_found = Some(noise);
            if change < SETTLED_VARIANCE {
                break;
            }
        }
    }
    orthonormalize(&mut state);
    let mut outcome = summarize(state, observations, &weights, free, &run);
    if let Some(noise) = noise_found {
        outcome.misfit = inverse_density(&outcome.state, observations, &noise);
    }
    Ok(outcome)
}

struct Run {
    iterations: usize,
    stop: StopReason,
}

/// The cameras as a problem of Levenberg-Marquardt, weights held fixed.
struct Reprojection<'a> {
    observations: &'a Observations,
    weights: &'a Weights,
    free: Free,
    relative_decrease: f64,
}

impl Problem for Reprojection<'_> {
    type State = State;
    type Equations = Arrowhead;
    type Step = Step;

    fn cost(&self, state: &State) -> f64 {
        cost(state, self.observations, self.weights)
    }

    fn linearize(&self, state: &State) -> Option<Arrowhead> {
        Some(assemble(state, self.observations, self.weights, self.free))
    }

    fn step(&self, equations: &Arrowhead, damping: f64) -> Option<Step> {
        equations.step(damping)
    }

    fn moved(&self, state: &State, step: &Step) -> Option<State> {
        Some(stepped(state, self.free, step))
    }

    fn is_settled(&self, tried: &Tried<Self>) -> bool {
        tried.step.promised <= self.relative_decrease * tried.cost
    }
}

/// Lowers the cost with weights held fixed.
fn descend(
    state: State,
    observations: &Observations,
    weights: &Weights,
    free: Free,
    settings: &Settings,
) -> (State, Run) {
    let problem = Reprojection {
        observations,
        weights,
        free,
        relative_decrease: settings.relative_decrease,
    };
    let outcome = levenberg::minimize(&problem, state, &settings.of_search());
    let run = Run {
        iterations: outcome.linearizations,
        stop: outcome.stop,
    };
    (outcome.state, run)
}

fn orthonormalize(state: &mut State) {
    for camera in &mut state.camera_from_first {
        *camera = camera.orthonormalized();
    }
    for pose in state.first_from_board.iter_mut().flatten() {
        *pose = pose.orthonormalized();
    }
}

fn summarize(
    state: State,
    observations: &Observations,
    weights: &Weights,
    free: Free,
    run: &Run,
) -> Outcome {
    let (mut cost_px2, mut squared_px2, mut weighted, mut count) = (0.0, 0.0, 0.0, 0);
    let mut is_used = Vec::with_capacity(weights.len());
    for ((residuals, weights), view) in residuals(&state, observations)
        .iter()
        .zip(weights)
        .zip(&observations.views)
    {
        let used = residuals.iter().zip(weights);
        is_used.push(
            used.map(|(r, weight)| r.is_some() && *weight > 0.0)
                .collect(),
        );
        for ((residual, weight), corner) in residuals.iter().zip(weights).zip(&view.corners) {
            let Some(squared) = residual.filter(|_| *weight > 0.0).map(|r| r.norm_squared()) else {
                continue;
            };
            cost_px2 += corner.relative_weight * squared;
            squared_px2 += squared;
            weighted += weight * squared;
            count += 1;
        }
    }
    let pose_count = state.first_from_board.iter().flatten().count();
    let unknowns = shared_count(free, state.cameras.len()) + 6 * pose_count;
    let deviations = (2 * count > unknowns)
        .then(|| assemble(&state, observations, weights, free).shared_covariance())
        .flatten()
        .map(|covariance| {
            let variance = weighted / (2 * count - unknowns) as f64;
            let camera_deviations = |camera_idx: usize| {
                let mut deviations = CameraDeviations::default();
                for (own, at) in columns(free, camera_idx) {
                    let deviation = (variance * covariance[(at, at)]).sqrt();
                    match own.checked_sub(INTRINSICS) {
                        None => deviations.intrinsics[own] = deviation,
                        Some(place) => deviations.place[place] = deviation,
                    }
                }
                deviations
            };
            (0..state.cameras.len()).map(camera_deviations).collect()
        });
    Outcome {
        misfit: cost_px2,
        cost_px2,
        rms_px: (squared_px2 / count.max(1) as f64).sqrt(),
        corner_count: count,
        is_used,
        iterations: run.iterations,
        stop: run.stop,
        deviations,
        state,
    }
}

/// Inverse of the geometric mean of the densities of all residuals.
fn inverse_density(state: &State, observations: &Observations, noise: &StudentT) -> f64 {
    let residuals = residuals(state, observations);
    let (mut sum, mut count) = (0.0, 0);
    for (idx, view, _) in taking_part(state, observations) {
        for (residual, corner) in residuals[idx].iter().zip(&view.corners) {
            let squared = residual.map_or(f64::INFINITY, |r| r.norm_squared());
            sum += noise.log_density(corner.relative_weight * squared);
            count += 1;
        }
    }
    (-sum / f64::from(count.max(1))).exp()
}
