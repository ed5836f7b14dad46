//! Bundle adjustment of Brown cameras: intrinsics, extrinsics and poses moved until the sum of
//! squared reprojection errors is least. One camera and a whole rig are the same problem.

use super::PinholeError;
use super::arrowhead::{Arrowhead, Step};
use super::brown::{BrownCamera, INTRINSICS};
use crate::adjust::normal_equations::Weights;
use crate::adjust::observations::ViewBlock;
use crate::adjust::robust::{StudentT, reweight};
use crate::adjust::{Observations, StopReason};
use crate::geometry::so3::skew;
use crate::geometry::{PixelPoint, RigidTransform};
use nalgebra::{DMatrix, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Damping of the first step, the least there is, and the most before giving up.
const FIRST_DAMPING: f64 = 1e-3;
const LEAST_DAMPING: f64 = 1e-14;
const MOST_DAMPING: f64 = 1e12;
/// Rounds of re-weighting.
const ROBUST_ROUNDS: usize = 10;
/// A change of the residuals' variance by less than this share ends them.
const SETTLED_VARIANCE: f64 = 1e-6;

/// Cameras, where they stand, and where the boards are.
#[derive(Debug, Clone)]
pub struct State {
    /// Per camera.
    pub cameras: Vec<BrownCamera>,
    /// Per camera; the first stays where it is.
    pub camera_from_first: Vec<RigidTransform>,
    /// Per pose index of the observations. Poses that are `None` take no part, nor do their views.
    pub first_from_board: Vec<Option<RigidTransform>>,
}

/// What may move besides the poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Free {
    /// The intrinsics of all cameras; nothing else is there to move with one camera.
    Intrinsics,
    /// The places of all cameras but the first.
    Extrinsics,
    /// Both.
    Everything,
}

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
    /// [`RigidTransform::perturbed`]: rotation in rad, translation in mm.
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

/// Views that take part, with their index and where their board is.
fn taking_part<'a>(
    state: &'a State,
    observations: &'a Observations,
) -> impl Iterator<Item = (usize, &'a ViewBlock, RigidTransform)> {
    observations
        .views
        .iter()
        .enumerate()
        .filter_map(|(idx, view)| Some((idx, view, state.first_from_board[view.pose_idx]?)))
}

fn check_start(state: &State, observations: &Observations) -> Result<(), PinholeError> {
    for (_, view, first_from_board) in taking_part(state, observations) {
        let camera_from_board = state.camera_from_first[view.camera_idx] * first_from_board;
        let is_behind = view
            .corners
            .iter()
            .any(|c| !(camera_from_board.point(&c.point_in_board).z > 0.0));
        if is_behind {
            return Err(PinholeError::BehindCamera {
                camera_idx: view.camera_idx,
                pose: observations.poses[view.pose_idx],
            });
        }
    }
    Ok(())
}

/// Predicted minus observed, px, per view and corner; views that take no part have `None` only.
fn residuals(state: &State, observations: &Observations) -> Vec<Vec<Option<Vector2<f64>>>> {
    let mut found: Vec<Vec<Option<Vector2<f64>>>> = observations
        .views
        .iter()
        .map(|view| vec![None; view.corners.len()])
        .collect();
    for (idx, view, first_from_board) in taking_part(state, observations) {
        let camera = &state.cameras[view.camera_idx];
        let camera_from_board = state.camera_from_first[view.camera_idx] * first_from_board;
        found[idx] = view
            .corners
            .iter()
            .map(|corner| {
                let seen = camera.unfolded(&camera_from_board.point(&corner.point_in_board))?;
                Some(difference(seen, corner.pixel))
            })
            .collect();
    }
    found
}

fn difference(seen: PixelPoint, observed: PixelPoint) -> Vector2<f64> {
    Vector2::new(seen.u - observed.u, seen.v - observed.v)
}

/// Weighted sum of squares; infinite if a corner that counts is behind its camera or a focal length
/// is not positive.
fn cost(state: &State, observations: &Observations, weights: &Weights) -> f64 {
    let is_camera = |camera: &BrownCamera| camera.focal_px.iter().all(|f| *f > 0.0);
    if !state.cameras.iter().all(is_camera) {
        return f64::INFINITY;
    }
    let mut sum = 0.0;
    for (idx, view, first_from_board) in taking_part(state, observations) {
        let camera = &state.cameras[view.camera_idx];
        let camera_from_board = state.camera_from_first[view.camera_idx] * first_from_board;
        for (corner, weight) in view.corners.iter().zip(&weights[idx]) {
            let seen = camera.unfolded(&camera_from_board.point(&corner.point_in_board));
            sum += match seen {
                Some(seen) => weight * difference(seen, corner.pixel).norm_squared(),
                None if *weight > 0.0 => return f64::INFINITY,
                None => 0.0,
            };
        }
    }
    if sum.is_nan() { f64::INFINITY } else { sum }
}

/// Where the shared parameters of a camera stand among all: (its own number, number in the block).
fn columns(free: Free, camera_idx: usize) -> Vec<(usize, usize)> {
    let intrinsics = match free {
        Free::Intrinsics | Free::Everything => INTRINSICS,
        Free::Extrinsics => 0,
    };
    let place = match free {
        Free::Extrinsics | Free::Everything => 6,
        Free::Intrinsics => 0,
    };
    // The first camera has no place.
    let before = camera_idx * (intrinsics + place) - if camera_idx > 0 { place } else { 0 };
    let own_place = if camera_idx > 0 { place } else { 0 };
    (0..intrinsics)
        .chain(INTRINSICS..INTRINSICS + own_place)
        .enumerate()
        .map(|(k, own)| (own, before + k))
        .collect()
}

fn shared_count(free: Free, camera_count: usize) -> usize {
    (0..camera_count).map(|idx| columns(free, idx).len()).sum()
}

fn assemble(
    state: &State,
    observations: &Observations,
    weights: &Weights,
    free: Free,
) -> Arrowhead {
    let mut equations = Arrowhead::new(
        shared_count(free, state.cameras.len()),
        state.first_from_board.len(),
    );
    for (pose, block) in state.first_from_board.iter().zip(&mut equations.poses) {
        if pose.is_none() {
            // Stays where it is not.
            block.own.fill_with_identity();
        }
    }
    for (idx, view, first_from_board) in taking_part(state, observations) {
        let columns = columns(free, view.camera_idx);
        let products = products(state, view, &first_from_board, &weights[idx], &columns);
        let (shared, last) = (columns.len(), columns.len() + 6);
        let block = &mut equations.poses[view.pose_idx];
        block.own += products.fixed_view::<6, 6>(shared, shared);
        block.gradient += products.fixed_view::<6, 1>(shared, last);
        if block.own.trace() == 0.0 {
            // All of its corners were rejected.
            block.own.fill_with_identity();
        }
        for (row, (_, at)) in columns.iter().enumerate() {
            equations.shared_gradient[*at] += products[(row, last)];
            for (col, (_, other_at)) in columns.iter().enumerate() {
                equations.shared[(*at, *other_at)] += products[(row, col)];
            }
            for k in 0..6 {
                block.cross[(*at, k)] += products[(row, shared + k)];
            }
        }
    }
    equations
}

/// Weighted products of the columns of a view's Jacobian with each other and with the residuals:
/// those of its camera, six of its pose, the residuals last.
fn products(
    state: &State,
    view: &ViewBlock,
    first_from_board: &RigidTransform,
    weights: &[f64],
    columns: &[(usize, usize)],
) -> DMatrix<f64> {
    let camera = &state.cameras[view.camera_idx];
    let camera_from_first = &state.camera_from_first[view.camera_idx];
    let shared = columns.len();
    // One column per number observed, so that they are filled in order.
    let mut transposed = DMatrix::zeros(shared + 7, 2 * view.corners.len());
    for (k, (corner, weight)) in view.corners.iter().zip(weights).enumerate() {
        let turned = first_from_board.rotation * corner.point_in_board;
        let point_in_first = turned + first_from_board.translation_mm;
        let carried = camera_from_first.rotation * point_in_first;
        let seen = camera.linearize(&(carried + camera_from_first.translation_mm));
        // What is behind the camera counts nothing, or the state had no finite cost.
        let Some(seen) = seen.filter(|_| *weight > 0.0) else {
            continue;
        };
        let residual = difference(seen.pixel, corner.pixel);
        let by_turn = -seen.by_point * skew(&carried);
        let by_first = seen.by_point * camera_from_first.rotation;
        let by_first_turn = -by_first * skew(&turned);
        let root = weight.sqrt();
        for axis in 0..2 {
            let mut column = transposed.column_mut(2 * k + axis);
            for (row, (own, _)) in columns.iter().enumerate() {
                column[row] = root
                    * match own.checked_sub(INTRINSICS) {
                        None => seen.by_intrinsics[(axis, *own)],
                        Some(place @ 0..3) => by_turn[(axis, place)],
                        Some(place) => seen.by_point[(axis, place - 3)],
                    };
            }
            for place in 0..3 {
                column[shared + place] = root * by_first_turn[(axis, place)];
                column[shared + 3 + place] = root * by_first[(axis, place)];
            }
            column[shared + 6] = root * residual[axis];
        }
    }
    let jacobian = transposed.transpose();
    transposed * jacobian
}

fn stepped(state: &State, free: Free, step: &Step) -> State {
    let mut next = state.clone();
    for (idx, camera) in next.cameras.iter_mut().enumerate() {
        let mut values = camera.intrinsics();
        let mut place = [0.0; 6];
        for (own, at) in columns(free, idx) {
            if own < INTRINSICS {
                values[own] += step.shared[at];
            } else {
                place[own - INTRINSICS] = step.shared[at];
            }
        }
        *camera = camera.with_intrinsics(values);
        let [a, b, c, x, y, z] = place;
        let moved = &mut next.camera_from_first[idx];
        *moved = moved.perturbed(&Vector3::new(a, b, c), &Vector3::new(x, y, z));
    }
    for (pose, change) in next.first_from_board.iter_mut().zip(&step.poses) {
        if let Some(pose) = pose {
            *pose = pose.perturbed(
                &change.fixed_rows::<3>(0).into_owned(),
                &change.fixed_rows::<3>(3).into_owned(),
            );
        }
    }
    next
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
    for ((residuals, weights), view) in residuals(&state, observations)
        .iter()
        .zip(weights)
        .zip(&observations.views)
    {
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
