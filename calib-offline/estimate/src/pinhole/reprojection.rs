//! Reprojection errors of Brown cameras, their cost, and the equations for a step.

use super::PinholeError;
use super::brown::{BrownCamera, INTRINSICS};
use crate::adjust::Observations;
use crate::adjust::objective::Weights;
use crate::adjust::observations::ViewBlock;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use calib_rays::numerics::arrowhead::{Arrowhead, Step};
use nalgebra::{DMatrix, Vector2, Vector6};

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

/// Views that take part, with their index and where their board is.
pub(super) fn taking_part<'a>(
    state: &'a State,
    observations: &'a Observations,
) -> impl Iterator<Item = (usize, &'a ViewBlock, RigidTransform)> {
    observations
        .views
        .iter()
        .enumerate()
        .filter_map(|(idx, view)| Some((idx, view, state.first_from_board[view.pose_idx]?)))
}

/// Whether all boards stand before the cameras that see them.
///
/// # Errors
/// [`PinholeError::BehindCamera`].
pub(super) fn check_start(state: &State, observations: &Observations) -> Result<(), PinholeError> {
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
pub(super) fn residuals(
    state: &State,
    observations: &Observations,
) -> Vec<Vec<Option<Vector2<f64>>>> {
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
pub(super) fn cost(state: &State, observations: &Observations, weights: &Weights) -> f64 {
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
pub(super) fn columns(free: Free, camera_idx: usize) -> Vec<(usize, usize)> {
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

/// Parameters besides the poses.
pub(super) fn shared_count(free: Free, camera_count: usize) -> usize {
    (0..camera_count).map(|idx| columns(free, idx).len()).sum()
}

/// The normal equations at a state.
pub(super) fn assemble(
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
        let by_place = RigidTransform::by_step(&seen.by_point, &carried);
        let by_first = seen.by_point * camera_from_first.rotation;
        let by_pose = RigidTransform::by_step(&by_first, &turned);
        let root = weight.sqrt();
        for axis in 0..2 {
            let mut column = transposed.column_mut(2 * k + axis);
            for (row, (own, _)) in columns.iter().enumerate() {
                column[row] = root
                    * match own.checked_sub(INTRINSICS) {
                        None => seen.by_intrinsics[(axis, *own)],
                        Some(place) => by_place[(axis, place)],
                    };
            }
            for place in 0..6 {
                column[shared + place] = root * by_pose[(axis, place)];
            }
            column[shared + 6] = root * residual[axis];
        }
    }
    let jacobian = transposed.transpose();
    transposed * jacobian
}

/// The state after a step.
pub(super) fn stepped(state: &State, free: Free, step: &Step) -> State {
    let mut next = state.clone();
    for (idx, camera) in next.cameras.iter_mut().enumerate() {
        let mut values = camera.intrinsics();
        let mut place = Vector6::zeros();
        for (own, at) in columns(free, idx) {
            if own < INTRINSICS {
                values[own] += step.shared[at];
            } else {
                place[own - INTRINSICS] = step.shared[at];
            }
        }
        *camera = camera.with_intrinsics(values);
        let moved = &mut next.camera_from_first[idx];
        *moved = moved.stepped(&place);
    }
    for (pose, change) in next.first_from_board.iter_mut().zip(&step.poses) {
        if let Some(pose) = pose {
            *pose = pose.stepped(change);
        }
    }
    next
}
