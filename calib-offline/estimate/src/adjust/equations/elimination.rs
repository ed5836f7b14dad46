//! What the moving parts of a model leave of any other columns: products of arbitrary columns with the
//! inverse of the normal equations, poses eliminated first. Splines are held.

use super::components::Components;
use super::normal_equations::{NormalEquations, fixed_columns, parameters_to_columns};
use crate::adjust::model::{Layout, Model};
use crate::adjust::objective::Weights;
use crate::adjust::observations::{Observations, ViewBasis};
use crate::adjust::prediction::predict;
use crate::adjust::priors::Priors;
use calib_rays::geometry::RigidTransform;
use calib_rays::numerics::arrowhead::PosesEliminated;
use calib_rays::numerics::cholesky::BandedCholesky;
use nalgebra::{DMatrix, DVector, Vector2, Vector6};

/// The equations of a model, factorized.
pub struct Elimination<'a> {
    model: &'a Model,
    observations: &'a Observations,
    bases: &'a [ViewBasis],
    weights: &'a Weights,
    layout: Layout,
    equations: NormalEquations,
    eliminated: PosesEliminated,
    shared: BandedCholesky,
    to_columns: Vec<DMatrix<f64>>,
}

impl<'a> Elimination<'a> {
    /// Linearizes and factorizes.
    ///
    /// `None` if the data leave something open.
    pub fn new(
        model: &'a Model,
        observations: &'a Observations,
        bases: &'a [ViewBasis],
        weights: &'a Weights,
        priors: &Priors,
    ) -> Option<Self> {
        let layout = model.layout();
        let equations =
            NormalEquations::assemble(model, &layout, observations, bases, weights, priors);
        let eliminated = equations.arrow.eliminate_poses(0.0)?;
        let shared = BandedCholesky::of_dense(&eliminated.shared)?;
        Some(Self {
            model,
            observations,
            bases,
            weights,
            layout,
            equations,
            eliminated,
            shared,
            to_columns: model.cameras.iter().map(parameters_to_columns).collect(),
        })
    }

    /// Number of shared unknowns.
    pub fn shared_len(&self) -> usize {
        self.layout.global_len
    }

    /// With J the derivatives of a view's residuals by all that moves, and B `count` columns of its
    /// corners' residuals: `L^-1 J_pose^T W B` of the pose, and `J_shared^T W B` with the pose
    /// eliminated. To the first belongs an inner product of each pose's own; the second is to go
    /// through [`Self::whiten_shared`].
    pub fn whitened<const N: usize>(
        &self,
        view_idx: usize,
        count: usize,
        columns: &dyn Fn(usize) -> Option<[Vector2<f64>; N]>,
    ) -> (DMatrix<f64>, DMatrix<f64>) {
        let view = &self.observations.views[view_idx];
        let camera = &self.model.cameras[view.camera_idx];
        let pose = &self.model.rig_from_board[view.pose_idx];
        let components = Components::of(camera);
        let fixed: Vec<Option<usize>> = fixed_columns(&self.layout, view.camera_idx).collect();
        let mut by_component =
            vec![DMatrix::<f64>::zeros(view.corners.len(), count); components.count()];
        let mut by_pose = DMatrix::<f64>::zeros(6, count);
        let mut by_fixed = DMatrix::<f64>::zeros(fixed.len(), count);
        let seen = predict(self.model, self.observations, view, &self.bases[view_idx]);
        for (corner, seen) in seen.enumerate() {
            let weight = self.weights[view_idx][corner];
            let (Some(l), Some(columns)) = (seen.linearization, columns(corner)) else {
                continue;
            };
            let by_rig = l.by_point * camera.camera_from_rig.rotation;
            let of_pose = RigidTransform::by_step(&by_rig, &seen.turned_in_board);
            let of_camera = RigidTransform::by_step(&l.by_point, &seen.turned_in_rig);
            let by_height = by_rig * pose.rotation.column(2);
            let point = &view.corners[corner].point_in_board;
            let products = self
                .model
                .board_shape
                .products(&self.observations.board, point);
            let of_board: Vec<f64> = products.collect();
            for (k, column) in columns.iter().enumerate() {
                let b = column * weight;
                for (a, target) in by_component.iter_mut().enumerate() {
                    let j: Vector2<f64> = if a < 2 {
                        l.by_s.column(a).into()
                    } else {
                        l.by_m.column(a - 2).into()
                    };
                    target[(corner, k)] = j.dot(&b);
                }
                for row in 0..6 {
                    by_pose[(row, k)] += of_pose.column(row).dot(&b);
                    by_fixed[(row, k)] += of_camera.column(row).dot(&b);
                }
                for (row, product) in of_board.iter().enumerate() {
                    by_fixed[(6 + row, k)] += product * by_height.dot(&b);
                }
            }
        }
        let mut field = DMatrix::zeros(components.len(), count);
        for (a, own) in by_component.iter().enumerate() {
            let products = self.bases[view_idx].products().rows(0, components.terms(a));
            field
                .rows_mut(components.start(a), components.terms(a))
                .gemm(1.0, &products, own, 0.0);
        }
        let carried = self.to_columns[view.camera_idx].tr_mul(&field);
        let mut shared = DMatrix::zeros(self.shared_len(), count);
        let start = self.layout.cameras[view.camera_idx].direction.start;
        shared.rows_mut(start, carried.nrows()).copy_from(&carried);
        for (row, global) in fixed.iter().enumerate() {
            if let Some(global) = global {
                shared.row_mut(*global).copy_from(&by_fixed.row(row));
            }
        }
        let factor = &self.eliminated.factors[view.pose_idx];
        let block = &self.equations.arrow.poses[view.pose_idx];
        shared -= &block.cross * factor.solve(&by_pose);
        factor.l_dirty().solve_lower_triangular_mut(&mut by_pose);
        (by_pose, shared)
    }

    /// The gradient of what is made least, by a pose and whitened: 0 at a minimum.
    pub fn pose_gradient(&self, pose_idx: usize) -> Vector6<f64> {
        let mut gradient = self.equations.arrow.poses[pose_idx].gradient;
        let factor = &self.eliminated.factors[pose_idx];
        factor.l_dirty().solve_lower_triangular_mut(&mut gradient);
        gradient
    }

    /// The same by what is shared, the poses eliminated.
    pub fn shared_gradient(&self) -> DVector<f64> {
        let mut gradient = -&self.eliminated.right;
        self.shared.solve_lower_vector(&mut gradient);
        gradient
    }

    /// `L^-1` of what is left of the shared equations times columns.
    pub fn whiten_shared(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let begins = vec![0; columns.ncols()];
        // Column-major storage of the transpose is row-major storage.
        let mut rows = columns.transpose();
        self.shared.solve_lower(rows.as_mut_slice(), &begins);
        rows.transpose()
    }
}
