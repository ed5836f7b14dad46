//! Bundle adjustment of Brown cameras: intrinsics, extrinsics and poses moved until the sum of
//! squared reprojection errors is least. One camera and a whole rig are the same problem.

use super::PinholeError;
use super::brown::INTRINSICS;
use super::reprojection::{
    assemble, check_start, columns, cost, residuals, shared_count, stepped, taking_part,
};
use crate::adjust::objective::Weights;
use crate::adjust::robust::{StudentT, reweight};
use crate::adjust::{Observations, StopReason};
use serde::{Deserialize, Serialize};

pub use super::reprojection::{Free, State};

/// Damping of the first step, the least there is, and the most before giving up.
const FIRST_DAMPING: f64 = 1e-3;
const LEAST_DAMPING: f64 = 1e-14;
const MOST_DAMPING: f64 = 1e12;
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
    mut state: State,
    observations: &Observations,
    free: Free,
    settings: &Settings,
) -> Result<Outcome, PinholeError> {
    check_start(&state, observations)?;
    let plain: Weights = observations
        .views
        .iter()
        .map(|view| view.corners.iter().map(|c| c.relative_weight).collect())
        .collect();
    let mut run = descend(&mut state, observations, &plain, free, settings);
    let mut weights = plain;
    let mut noise_found = None;
    if settings.loss == Loss::StudentT {
        for _ in 0..ROBUST_ROUNDS {
            let residuals = residuals(&state, observations);
            let (noise, next) = reweight(&residuals, observations, 1.0, noise_found.as_ref());
            let change = noise_found.map_or(f64::INFINITY, |known: StudentT| {
                (noise.variance_px2 / known.variance_px2).ln().abs()
            });
            weights = next;
            let again = descend(&mut state, observations, &weights, free, settings);
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

/// Levenberg-Marquardt with weights held fixed.
fn descend(
    state: &mut State,
    observations: &Observations,
    weights: &Weights,
    free: Free,
    settings: &Settings,
) -> Run {
    let mut current = cost(state, observations, weights);
    let mut damping = FIRST_DAMPING;
    for iteration in 0..settings.max_iterations {
        let stopped = |stop| Run {
            iterations: iteration + 1,
            stop,
        };
        let equations = assemble(state, observations, weights, free);
        loop {
            if damping > MOST_DAMPING {
                return stopped(StopReason::NoFurtherDecrease);
            }
            let Some(step) = equations.step(damping) else {
                if damping >= 1.0 {
                    return stopped(StopReason::Singular);
                }
                damping = (damping * 100.0).max(1e-8);
                continue;
            };
            let stepped = stepped(state, free, &step);
            let reached = cost(&stepped, observations, weights);
            let is_settled = step.promised <= settings.relative_decrease * current;
            let is_lower = reached < current;
            if is_lower {
                *state = stepped;
                current = reached;
                damping = (damping / 10.0).max(LEAST_DAMPING);
            }
            if is_settled {
                return stopped(StopReason::Converged);
            }
            if is_lower {
                break;
            }
            damping = damping.max(1e-8) * 10.0;
        }
    }
    Run {
        iterations: settings.max_iterations,
        stop: StopReason::IterationLimit,
    }
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
