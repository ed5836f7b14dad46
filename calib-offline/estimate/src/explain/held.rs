//! New boards through a rig that is held: where each board is, and the numbers of a suspicion, by least
//! squares. A start for what may have changed by much: a fit of old and new together would reject the
//! new corners, or follow them.

use super::effects::shifts;
use super::explained::corrected;
use super::suspicion::Suspicion;
use crate::adjust::observations::ViewBlock;
use crate::adjust::residual::linearize;
use crate::adjust::{Model, Observations};
use crate::init::board_pose::fit_view;
use crate::joint::evidence::Smoothness;
use crate::joint::fit::Fit;
use calib_rays::geometry::RigidTransform;
use calib_rays::numerics::median;
use nalgebra::{DMatrix, DVector, Matrix2xX, Vector6};

/// Gauss-Newton steps: from the pose of one view, and no change, five or six are enough.
const STEPS: usize = 12;
/// A step below this share of a unit, or of a radian or mm, is the last.
const SETTLED: f64 = 1e-7;
/// Degrees of freedom of the weights, as for the pose of a view.
const FREEDOM: f64 = 4.0;
/// Least variance per axis, px^2.
const FLOOR_PX2: f64 = 1e-12;
/// Standard deviation of each number before anything is seen, units: it only keeps the equations regular.
const PRIOR_SD: f64 = 1e3;

/// New boards placed through a held rig.
#[derive(Debug, Clone)]
pub(super) struct Held {
    /// The new boards without what the numbers do to them.
    pub observations: Observations,
    /// Where each is.
    pub rig_from_board: Vec<RigidTransform>,
    /// The numbers, in units.
    pub numbers: DVector<f64>,
}

/// The boards of some observations as the first camera that can places each; `None` for a board that none
/// can place.
pub(super) fn placed(model: &Model, observations: &Observations) -> Vec<Option<RigidTransform>> {
    let place = |view: &ViewBlock| {
        let camera = &model.cameras[view.camera_idx];
        let fit = fit_view(&camera.field, &observations.board, &model.board_shape, view)?;
        Some(camera.camera_from_rig.inverse() * fit.camera_from_board)
    };
    let poses = 0..observations.poses.len();
    poses
        .map(|pose| {
            let views = observations.views.iter();
            let mut views = views.filter(|view| view.pose_idx == pose);
            views.find_map(place)
        })
        .collect()
}

/// Numbers of a suspicion about all of some observations, and poses of their boards, through a held rig.
///
/// `None` if the corners leave something open.
pub(super) fn held(
    model: &Model,
    observations: &Observations,
    rig_from_board: Vec<RigidTransform>,
    suspicion: &Suspicion,
) -> Option<Held> {
    let count = suspicion.numbers.len();
    let mut state = Held {
        observations: observations.clone(),
        rig_from_board,
        numbers: DVector::zeros(count),
    };
    for _ in 0..STEPS {
        let model = Model {
            rig_from_board: state.rig_from_board.clone(),
            ..model.clone()
        };
        let smoothness = Smoothness::new(&model);
        let fit = Fit::new(model, smoothness, &state.observations);
        let (matrix, gradient) = equations(&fit, &state, suspicion)?;
        let step = matrix.cholesky()?.solve(&-gradient);
        let change = step.rows(0, count).into_owned();
        state.observations = corrected(&state.observations, &fit, suspicion, &change);
        state.numbers += change;
        for (k, pose) in state.rig_from_board.iter_mut().enumerate() {
            let own: Vector6<f64> = step.fixed_rows::<6>(count + 6 * k).into_owned();
            *pose = pose.stepped(&own).orthonormalized();
        }
        if step.amax() < SETTLED {
            break;
        }
    }
    let is_finite = state.numbers.iter().all(|x| x.is_finite());
    is_finite.then_some(state)
}

/// Normal equations of the numbers and of the poses behind them.
fn equations(
    fit: &Fit,
    state: &Held,
    suspicion: &Suspicion,
) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let (count, observations) = (suspicion.numbers.len(), &state.observations);
    let all = fit.residuals().iter().flatten().flatten();
    let median_px2 = median(all.map(nalgebra::Matrix::norm_squared))?;
    // The median of the squared length of a bivariate Gaussian is 2 ln 2 times its variance.
    let variance_px2 = (median_px2 / (2.0 * 2f64.ln())).max(FLOOR_PX2);
    let len = count + 6 * state.rig_from_board.len();
    let (mut matrix, mut gradient) = (DMatrix::zeros(len, len), DVector::zeros(len));
    for k in 0..count {
        matrix[(k, k)] = 1.0 / (PRIOR_SD * PRIOR_SD);
        gradient[k] = state.numbers[k] / (PRIOR_SD * PRIOR_SD);
    }
    for (view_idx, view) in observations.views.iter().enumerate() {
        let camera = &fit.model.cameras[view.camera_idx];
        let pose = &state.rig_from_board[view.pose_idx];
        let basis = &fit.bases()[view_idx];
        let by_corner = shifts(&fit.model, observations, view, basis);
        let units: Vec<_> = (0..count)
            .map(|k| {
                let mut one = vec![0.0; count];
                one[k] = 1.0;
                suspicion.sizes(view_idx, &one)
            })
            .collect();
        let at = count + 6 * view.pose_idx;
        for (idx, corner) in view.corners.iter().enumerate() {
            let (Some(by), Some(residual)) = (by_corner[idx], fit.residuals()[view_idx][idx])
            else {
                continue;
            };
            let mut point = corner.point_in_board;
            point.z += fit.model.board_shape.height_mm(&observations.board, &point);
            let turned = pose.rotation * point;
            let in_camera = camera
                .camera_from_rig
                .point(&(turned + pose.translation_mm));
            let Some(l) = linearize(&basis.sample(&camera.field, idx), &in_camera) else {
                continue;
            };
            let by_rig = l.by_point * camera.camera_from_rig.rotation;
            let mut row = Matrix2xX::zeros(count + 6);
            for (k, sizes) in units.iter().enumerate() {
                // What a number does to the pixels is taken off the residual.
                let shift: nalgebra::Vector2<f64> =
                    by.iter().zip(sizes).map(|(by, size)| -by * *size).sum();
                row.set_column(k, &shift);
            }
            row.fixed_columns_mut::<6>(count)
                .copy_from(&RigidTransform::by_step(&by_rig, &turned));
            let squared = residual.norm_squared() * corner.relative_weight;
            let weight = corner.relative_weight * FREEDOM
                / (FREEDOM + squared / variance_px2)
                / variance_px2;
            let place = |k: usize| if k < count { k } else { at + k - count };
            for a in 0..count + 6 {
                gradient[place(a)] += weight * row.column(a).dot(&residual);
                for b in 0..count + 6 {
                    matrix[(place(a), place(b))] += weight * row.column(a).dot(&row.column(b));
                }
            }
        }
    }
    Some((matrix, gradient))
}
