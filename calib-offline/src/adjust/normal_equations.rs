//! The normal equations in blocks: global parameters, poses, and their coupling.
//!
//! The objective is `sum w |r|^2 + sum prior a^2` (residuals in px, `w` in 1/px^2). A pose is
//! coupled to the global parameters only, never to another pose, so poses are eliminated first:
//! the work is linear in their number and nothing larger than the global block is factorised
//! (METHOD 2.5, 2.6).
//!
//! A field's direction enters a residual through `M ds`, `ds = sum_k L_k(x) da_k`, so its block is
//! `sum w (M^T M) (x) (L L^T)`: three symmetric products per view, formed in Legendre coefficients
//! and carried over to the structured directions once per camera.

use super::model::{Layout, Model, Step};
use super::observations::{Observations, ViewBasis, ViewBlock};
use super::residual::{Linearization, linearize};
use crate::field::FieldSample;
use crate::geometry::so3::skew;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix2, Matrix6, Vector2, Vector6};
use rayon::prelude::*;

/// Inverse variances of the parameters that smoothness or plausibility holds back.
#[derive(Debug, Clone)]
pub struct Priors {
    /// Per camera and direction, 1/rad^2; 0 for a free direction.
    pub direction: Vec<DVector<f64>>,
    /// Of each coefficient of the board's shape, 1/mm^2.
    pub board: f64,
}

impl Priors {
    /// What the priors add to the objective.
    pub fn cost(&self, model: &Model) -> f64 {
        let directions: f64 = model
            .cameras
            .iter()
            .zip(&self.direction)
            .map(|(camera, weight)| {
                let amounts = camera.basis.amounts(&camera.field.direction.polynomial);
                amounts
                    .iter()
                    .zip(weight.iter())
                    .map(|(a, w)| w * a * a)
                    .sum::<f64>()
            })
            .sum();
        let board: f64 = model.board_shape.terms.iter().map(|t| t.2 * t.2).sum();
        directions + self.board * board
    }
}

/// Weight per corner, in the order of the views and their corners.
pub type Weights = Vec<Vec<f64>>;

/// The equations `H step = -gradient` of one linearization, priors included.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    global: DMatrix<f64>,
    global_gradient: DVector<f64>,
    poses: Vec<Matrix6<f64>>,
    pose_gradients: Vec<Vector6<f64>>,
    /// Global x 6 per pose.
    coupling: Vec<DMatrix<f64>>,
}

/// The normal equations after the poses are eliminated.
#[derive(Debug, Clone)]
pub struct Reduced {
    factor: Cholesky<f64, nalgebra::Dyn>,
    right: DVector<f64>,
    pose_factors: Vec<Cholesky<f64, nalgebra::Const<6>>>,
}

/// Residual vectors of every corner (observed minus predicted, px), in the order of the views;
/// `None` behind the camera.
pub fn residuals(
    model: &Model,
    observations: &Observations,
    bases: &[ViewBasis],
) -> Vec<Vec<Option<Vector2<f64>>>> {
    observations
        .views
        .par_iter()
        .zip(bases)
        .map(|(view, basis)| {
            Predictor::new(model, observations, view, basis)
                .map(|seen| seen.linearization.map(|l| l.residual_px))
                .collect()
        })
        .collect()
}

/// Walks the corners of a view with their linearizations.
struct Predictor<'a> {
    model: &'a Model,
    observations: &'a Observations,
    view: &'a ViewBlock,
    basis: &'a ViewBasis,
    next: usize,
}

/// A corner as the model sees it.
struct Seen {
    linearization: Option<Linearization>,
    /// The corner turned into the rig's axes about the board's origin, mm.
    turned_in_board: nalgebra::Vector3<f64>,
    /// The corner turned into the camera's axes about the rig's origin, mm.
    turned_in_rig: nalgebra::Vector3<f64>,
}

impl<'a> Predictor<'a> {
    fn new(
        model: &'a Model,
        observations: &'a Observations,
        view: &'a ViewBlock,
        basis: &'a ViewBasis,
    ) -> Self {
        Self {
            model,
            observations,
            view,
            basis,
            next: 0,
        }
    }

    fn sample(&self, idx: usize) -> FieldSample {
        let field = &self.model.cameras[self.view.camera_idx].field;
        let (mut s, mut ds) = self.basis.base[idx];
        for (k, c) in field.direction.polynomial.coefficients.iter().enumerate() {
            s += c * self.basis.products[(idx, k)];
            ds += c * nalgebra::RowVector2::new(
                self.basis.products_du[(idx, k)],
                self.basis.products_dv[(idx, k)],
            );
        }
        FieldSample {
            s,
            ds,
            m_mm: Vector2::zeros(),
            dm: Matrix2::zeros(),
        }
    }
}

impl Iterator for Predictor<'_> {
    type Item = Seen;

    fn next(&mut self) -> Option<Seen> {
        let idx = self.next;
        let corner = self.view.corners.get(idx)?;
        self.next += 1;
        let camera = &self.model.cameras[self.view.camera_idx];
        let pose = &self.model.rig_from_board[self.view.pose_idx];
        let mut point = corner.point_in_board;
        point.z += self
            .model
            .board_shape
            .height_mm(&self.observations.board, &point);
        let turned_in_board = pose.rotation * point;
        let turned_in_rig =
            camera.camera_from_rig.rotation * (turned_in_board + pose.translation_mm);
        let point_in_camera = turned_in_rig + camera.camera_from_rig.translation_mm;
        Some(Seen {
            linearization: linearize(&self.sample(idx), &point_in_camera),
            turned_in_board,
            turned_in_rig,
        })
    }
}

/// Sum of `w |r|^2` and of the priors. A corner behind its camera counts as one a sensor's width
/// away, so that no step gains by turning a board over.
pub fn cost(
    model: &Model,
    observations: &Observations,
    bases: &[ViewBasis],
    weights: &Weights,
    priors: &Priors,
) -> f64 {
    let per_view: Vec<f64> = observations
        .views
        .par_iter()
        .zip(bases)
        .zip(weights)
        .map(|((view, basis), weights)| {
            let lost_px = f64::from(observations.sensors[view.camera_idx].width);
            Predictor::new(model, observations, view, basis)
                .zip(weights)
                .map(|(seen, w)| {
                    w * seen.linearization.map_or(lost_px * lost_px, |l| {
                        let squared = l.residual_px.norm_squared();
                        if squared.is_finite() {
                            squared
                        } else {
                            lost_px * lost_px
                        }
                    })
                })
                .sum()
        })
        .collect();
    per_view.iter().sum::<f64>() + priors.cost(model)
}

/// What one view contributes, in Legendre coefficients.
struct ViewSums {
    /// `sum w (M^T M)_ab L L^T` for (a, b) = (0, 0), (0, 1), (1, 1).
    direction: [DMatrix<f64>; 3],
    /// Direction (`2 k + component`) by pose 6, extrinsics 6, board, gradient.
    direction_small: DMatrix<f64>,
    /// The same columns by themselves.
    small: DMatrix<f64>,
}

fn view_sums(
    model: &Model,
    observations: &Observations,
    view: &ViewBlock,
    basis: &ViewBasis,
    weights: &[f64],
) -> ViewSums {
    let camera = &model.cameras[view.camera_idx];
    let pose = &model.rig_from_board[view.pose_idx];
    let board_terms = model.board_shape.terms.len();
    let small_len = 12 + board_terms + 1;
    let n = view.corners.len();
    let mut q = DMatrix::zeros(n, 3);
    let mut x = [DMatrix::zeros(n, small_len), DMatrix::zeros(n, small_len)];
    let mut small = DMatrix::zeros(small_len, small_len);
    let mut row = DMatrix::zeros(2, small_len);
    let normal_in_camera = camera.camera_from_rig.rotation * pose.rotation.column(2);
    for (idx, (seen, weight)) in Predictor::new(model, observations, view, basis)
        .zip(weights)
        .enumerate()
    {
        let Some(l) = seen.linearization.filter(|_| *weight > 0.0) else {
            continue;
        };
        let by_rig = l.by_point * camera.camera_from_rig.rotation;
        row.view_mut((0, 0), (2, 3))
            .copy_from(&(-by_rig * skew(&seen.turned_in_board)));
        row.view_mut((0, 3), (2, 3)).copy_from(&by_rig);
        row.view_mut((0, 6), (2, 3))
            .copy_from(&(-l.by_point * skew(&seen.turned_in_rig)));
        row.view_mut((0, 9), (2, 3)).copy_from(&l.by_point);
        let by_height = l.by_point * normal_in_camera;
        let products = model
            .board_shape
            .products(&observations.board, &view.corners[idx].point_in_board);
        for (k, product) in products.enumerate() {
            row.view_mut((0, 12 + k), (2, 1))
                .copy_from(&(by_height * product));
        }
        row.view_mut((0, small_len - 1), (2, 1))
            .copy_from(&l.residual_px);
        let mtm = l.by_s.tr_mul(&l.by_s) * *weight;
        q[(idx, 0)] = mtm[(0, 0)];
        q[(idx, 1)] = mtm[(0, 1)];
        q[(idx, 2)] = mtm[(1, 1)];
        for column in 0..small_len {
            let (r0, r1) = (row[(0, column)] * weight, row[(1, column)] * weight);
            for (component, x) in x.iter_mut().enumerate() {
                x[(idx, column)] = l.by_s[(0, component)] * r0 + l.by_s[(1, component)] * r1;
            }
            for other in 0..=column {
                small[(other, column)] += row[(0, other)] * r0 + row[(1, other)] * r1;
            }
        }
    }
    small.fill_lower_triangle_with_upper_triangle();
    let products = &basis.products;
    let direction = [0, 1, 2].map(|pair| {
        let mut scaled = products.clone();
        for mut column in scaled.column_iter_mut() {
            column.component_mul_assign(&q.column(pair));
        }
        products.tr_mul(&scaled)
    });
    let terms = products.ncols();
    let mut direction_small = DMatrix::zeros(2 * terms, small_len);
    for (component, x) in x.iter().enumerate() {
        let block = products.tr_mul(x);
        for k in 0..terms {
            direction_small
                .row_mut(2 * k + component)
                .copy_from(&block.row(k));
        }
    }
    ViewSums {
        direction,
        direction_small,
        small,
    }
}

impl NormalEquations {
    /// Linearizes at a model.
    pub fn assemble(
        model: &Model,
        layout: &Layout,
        observations: &Observations,
        bases: &[ViewBasis],
        weights: &Weights,
        priors: &Priors,
    ) -> Self {
        let pose_count = observations.poses.len();
        let mut equations = Self {
            global: DMatrix::zeros(layout.global_len, layout.global_len),
            global_gradient: DVector::zeros(layout.global_len),
            poses: vec![Matrix6::zeros(); pose_count],
            pose_gradients: vec![Vector6::zeros(); pose_count],
            coupling: vec![DMatrix::zeros(layout.global_len, 6); pose_count],
        };
        let sums: Vec<ViewSums> = observations
            .views
            .par_iter()
            .zip(bases)
            .zip(weights)
            .map(|((view, basis), weights)| view_sums(model, observations, view, basis, weights))
            .collect();
        for camera_idx in 0..model.cameras.len() {
            equations.add_direction_block(model, layout, observations, &sums, camera_idx);
        }
        for (view, sums) in observations.views.iter().zip(&sums) {
            equations.add_view(model, layout, view, sums);
        }
        equations.add_priors(model, layout, priors);
        equations
    }

    /// The field-by-field block of a camera, carried over to its structured directions.
    fn add_direction_block(
        &mut self,
        model: &Model,
        layout: &Layout,
        observations: &Observations,
        sums: &[ViewSums],
        camera_idx: usize,
    ) {
        let to_legendre = model.cameras[camera_idx].basis.coefficients();
        let terms = to_legendre.nrows() / 2;
        let mut block = DMatrix::zeros(2 * terms, 2 * terms);
        for (view, sums) in observations.views.iter().zip(sums) {
            if view.camera_idx != camera_idx {
                continue;
            }
            for (pair, (a, b)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
                let source = &sums.direction[pair];
                for k in 0..terms {
                    for l in 0..terms {
                        block[(2 * l + a, 2 * k + b)] += source[(l, k)];
                    }
                }
            }
        }
        for k in 0..terms {
            for l in 0..terms {
                block[(2 * l + 1, 2 * k)] = block[(2 * k, 2 * l + 1)];
            }
        }
        let range = layout.direction[camera_idx].clone();
        let structured = to_legendre.tr_mul(&(block * to_legendre));
        self.global
            .view_mut((range.start, range.start), (range.len(), range.len()))
            .copy_from(&structured);
    }

    /// All that a view adds outside the field-by-field block.
    fn add_view(&mut self, model: &Model, layout: &Layout, view: &ViewBlock, sums: &ViewSums) {
        let direction = layout.direction[view.camera_idx].clone();
        let structured = model.cameras[view.camera_idx]
            .basis
            .coefficients()
            .tr_mul(&sums.direction_small);
        let gradient = sums.small.ncols() - 1;
        let coupling = &mut self.coupling[view.pose_idx];
        for k in 0..6 {
            let mut column = coupling.column_mut(k);
            let mut rows = column.rows_range_mut(direction.clone());
            rows += structured.column(k);
        }
        self.poses[view.pose_idx] += sums.small.fixed_view::<6, 6>(0, 0);
        self.pose_gradients[view.pose_idx] += sums.small.fixed_view::<6, 1>(0, gradient);
        let mut gradient_rows = self.global_gradient.rows_range_mut(direction.clone());
        gradient_rows += structured.column(gradient);
        // Where each small column behind the pose stands among the global parameters.
        let extrinsics = layout.extrinsics[view.camera_idx].clone();
        let targets = extrinsics
            .into_iter()
            .flat_map(|range| range.zip(6..12))
            .chain(layout.board.clone().zip(12..))
            .collect::<Vec<_>>();
        for (global, small) in &targets {
            self.global_gradient[*global] += sums.small[(*small, gradient)];
            for k in 0..6 {
                coupling[(*global, k)] += sums.small[(*small, k)];
            }
            for (other_global, other_small) in &targets {
                self.global[(*global, *other_global)] += sums.small[(*small, *other_small)];
            }
            for (row, value) in direction.clone().zip(structured.column(*small).iter()) {
                self.global[(row, *global)] += value;
                self.global[(*global, row)] += value;
            }
        }
    }

    fn add_priors(&mut self, model: &Model, layout: &Layout, priors: &Priors) {
        for (camera_idx, range) in layout.direction.iter().enumerate() {
            let camera = &model.cameras[camera_idx];
            let amounts = camera.basis.amounts(&camera.field.direction.polynomial);
            for (k, row) in range.clone().enumerate() {
                let weight = priors.direction[camera_idx][k];
                self.global[(row, row)] += weight;
                self.global_gradient[row] += weight * amounts[k];
            }
        }
        for (row, term) in layout.board.clone().zip(&model.board_shape.terms) {
            self.global[(row, row)] += priors.board;
            self.global_gradient[row] += priors.board * term.2;
        }
    }

    /// Eliminates the poses. `damping` scales up the diagonal (Marquardt); 0 leaves the Hessian.
    ///
    /// `None` if a block is not positive definite: something the data do not determine.
    pub fn reduce(&self, damping: f64) -> Option<Reduced> {
        let mut global = self.global.clone();
        for k in 0..global.nrows() {
            global[(k, k)] *= 1.0 + damping;
        }
        let mut right = -&self.global_gradient;
        let mut pose_factors = Vec::with_capacity(self.poses.len());
        for ((block, gradient), coupling) in self
            .poses
            .iter()
            .zip(&self.pose_gradients)
            .zip(&self.coupling)
        {
            let mut damped = *block;
            for k in 0..6 {
                damped[(k, k)] *= 1.0 + damping;
            }
            let factor = damped.cholesky()?;
            // With V = L L^T and Y = W L^-T, the pose takes Y Y^T off the global block.
            let mut y = coupling.transpose();
            factor.l_dirty().solve_lower_triangular_mut(&mut y);
            global.gemm_tr(-1.0, &y, &y, 1.0);
            let solved = factor.solve(gradient);
            right += coupling * solved;
            pose_factors.push(factor);
        }
        Some(Reduced {
            factor: global.cholesky()?,
            right,
            pose_factors,
        })
    }

    /// The step that the (damped) equations ask for.
    pub fn step(&self, reduced: &Reduced) -> Step {
        let global = reduced.factor.solve(&reduced.right);
        let poses = self
            .pose_gradients
            .iter()
            .zip(&self.coupling)
            .zip(&reduced.pose_factors)
            .map(|((gradient, coupling), factor)| {
                let right: Vector6<f64> = -gradient - coupling.tr_mul(&global).fixed_rows::<6>(0);
                factor.solve(&right)
            })
            .collect();
        Step { global, poses }
    }

    /// By how much the linearized objective falls with a step of these equations.
    pub fn predicted_decrease(&self, step: &Step) -> f64 {
        let mut linear = self.global_gradient.dot(&step.global);
        let mut quadratic = (&self.global * &step.global).dot(&step.global);
        for (((block, gradient), coupling), pose) in self
            .poses
            .iter()
            .zip(&self.pose_gradients)
            .zip(&self.coupling)
            .zip(&step.poses)
        {
            linear += gradient.dot(pose);
            quadratic += (block * pose).dot(pose) + 2.0 * (coupling * pose).dot(&step.global);
        }
        -(2.0 * linear + quadratic)
    }
}

impl Reduced {
    /// Covariance of the global parameters (poses marginalized), if the weights are inverse
    /// variances and the damping was 0.
    pub fn global_covariance(&self) -> DMatrix<f64> {
        self.factor.inverse()
    }
}
