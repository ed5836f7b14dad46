//! The normal equations in blocks, and their solution.
//!
//! The objective is `sum w |r|^2 + sum prior a^2` (residuals in px, `w` in 1/px^2). Unknowns fall
//! into three kinds: global ones (the fields' polynomials, extrinsics, board shape), poses, and
//! the knots of each camera's spline. A pose is coupled to another pose only through the other
//! kinds, so without splines poses are eliminated first and the work is linear in their number.
//! With splines these are eliminated first: each is banded and coupled to everything else (the
//! border), METHOD 2.5. Nothing is ever formed that couples knots densely.

use super::assembly::{self, Components, EXTRINSICS, SplineSums, ViewSums, predict};
use super::banded::{BandedCholesky, BandedMatrix};
use super::model::{CameraModel, Layout, Model, Step};
use super::observations::{Observations, ViewBasis};
use crate::field::polynomial::legendre_norms;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix6, Vector2, Vector6};
use rayon::prelude::*;

/// Inverse variances of the parameters that smoothness or plausibility holds back.
#[derive(Debug, Clone)]
pub struct Priors {
    /// Per camera.
    pub cameras: Vec<CameraPriors>,
    /// Of each coefficient of the board's shape, 1/mm^2.
    pub board: f64,
}

/// Priors of one camera.
#[derive(Debug, Clone)]
pub struct CameraPriors {
    /// Per amount of the direction's polynomial, 1/rad^2; 0 for a free direction.
    pub direction: DVector<f64>,
    /// Per amount of the offset's polynomial, 1/mm^2; empty for a central camera.
    pub offset: DVector<f64>,
    /// Weight of the spline's thin-plate energy, 1/rad^2.
    pub spline: f64,
    /// That energy; `None` without a spline.
    pub thin_plate: Option<BandedMatrix>,
}

impl CameraPriors {
    /// No prior on the polynomials, nothing for the spline yet.
    pub fn free(camera: &CameraModel) -> Self {
        Self {
            direction: DVector::zeros(camera.basis.len()),
            offset: DVector::zeros(camera.offset_amounts().len()),
            spline: 0.0,
            thin_plate: camera.knot_order().map(|order| order.thin_plate()),
        }
    }

    fn cost(&self, camera: &CameraModel) -> f64 {
        let weighted = |amounts: &DVector<f64>, weights: &DVector<f64>| -> f64 {
            amounts
                .iter()
                .zip(weights.iter())
                .map(|(a, w)| w * a * a)
                .sum()
        };
        let amounts = camera.basis.amounts(&camera.field.direction.polynomial);
        let spline = self.thin_plate.as_ref().map_or(0.0, |energy| {
            let amounts = camera.spline_amounts();
            self.spline * energy.times(&amounts).dot(&amounts)
        });
        weighted(&amounts, &self.direction)
            + weighted(&camera.offset_amounts(), &self.offset)
            + spline
    }
}

impl Priors {
    /// What the priors add to the objective.
    pub fn cost(&self, model: &Model) -> f64 {
        let cameras: f64 = model
            .cameras
            .iter()
            .zip(&self.cameras)
            .map(|(camera, priors)| priors.cost(camera))
            .sum();
        let board: f64 = model.board_shape.terms.iter().map(|t| t.2 * t.2).sum();
        cameras + self.board * board
    }
}

/// Weight per corner, in the order of the views and their corners.
pub type Weights = Vec<Vec<f64>>;

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
            predict(model, observations, view, basis)
                .map(|seen| seen.linearization.map(|l| l.residual_px))
                .collect()
        })
        .collect()
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
            predict(model, observations, view, basis)
                .zip(weights)
                .map(|(seen, w)| {
                    let squared = seen
                        .linearization
                        .map(|l| l.residual_px.norm_squared())
                        .filter(|squared| squared.is_finite());
                    w * squared.unwrap_or(lost_px * lost_px)
                })
                .sum()
        })
        .collect();
    per_view.iter().sum::<f64>() + priors.cost(model)
}

/// The equations `H step = -gradient` of one linearization, priors included.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    global: DMatrix<f64>,
    global_gradient: DVector<f64>,
    poses: Vec<Matrix6<f64>>,
    pose_gradients: Vec<Vector6<f64>>,
    /// Global x 6 per pose.
    pub(super) coupling: Vec<DMatrix<f64>>,
    splines: Vec<Option<SplineBlock>>,
}

/// The equations of one camera's spline.
#[derive(Debug, Clone)]
struct SplineBlock {
    band: BandedMatrix,
    gradient: DVector<f64>,
    /// Knots (rows, row-major) by border columns.
    border: Vec<f64>,
    /// Where each border column stands among global parameters and poses.
    columns: Vec<usize>,
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
            splines: Vec::new(),
        };
        let sums: Vec<ViewSums> = observations
            .views
            .par_iter()
            .zip(bases)
            .zip(weights)
            .map(|((view, basis), weights)| {
                assembly::view_sums(model, observations, view, basis, weights)
            })
            .collect();
        let to_columns: Vec<DMatrix<f64>> =
            model.cameras.iter().map(parameters_to_columns).collect();
        for camera_idx in 0..model.cameras.len() {
            equations.add_field_block(layout, observations, &sums, &to_columns, camera_idx);
        }
        for (view, sums) in observations.views.iter().zip(&sums) {
            equations.add_view(layout, view, sums, &to_columns[view.camera_idx]);
        }
        equations.splines = model
            .cameras
            .par_iter()
            .enumerate()
            .map(|(camera_idx, camera)| {
                let order = camera.knot_order()?;
                let own: Vec<usize> = (0..observations.views.len())
                    .filter(|k| observations.views[*k].camera_idx == camera_idx)
                    .collect();
                let views: Vec<_> = own.iter().map(|k| (&bases[*k], &sums[*k])).collect();
                let poses: Vec<usize> = own
                    .iter()
                    .map(|k| observations.views[*k].pose_idx)
                    .collect();
                let sums = assembly::spline_sums(camera, &order, &views);
                Some(SplineBlock::new(
                    &sums,
                    layout,
                    camera_idx,
                    &poses,
                    &to_columns[camera_idx],
                ))
            })
            .collect();
        equations.add_priors(model, layout, priors);
        equations
    }

    /// The block of a camera's polynomials, carried over from their coefficients to parameters.
    fn add_field_block(
        &mut self,
        layout: &Layout,
        observations: &Observations,
        sums: &[ViewSums],
        to_columns: &[DMatrix<f64>],
        camera_idx: usize,
    ) {
        let to_columns = &to_columns[camera_idx];
        let mut block = DMatrix::zeros(to_columns.nrows(), to_columns.nrows());
        for (view, sums) in observations.views.iter().zip(sums) {
            if view.camera_idx == camera_idx {
                block += &sums.field;
            }
        }
        let carried = to_columns.tr_mul(&(block * to_columns));
        let start = layout.cameras[camera_idx].direction.start;
        self.global
            .view_mut((start, start), carried.shape())
            .copy_from(&carried);
    }

    /// All that a view adds outside the block of its camera's polynomials.
    fn add_view(
        &mut self,
        layout: &Layout,
        view: &super::observations::ViewBlock,
        sums: &ViewSums,
        to_columns: &DMatrix<f64>,
    ) {
        let carried = to_columns.tr_mul(&sums.field_small);
        let start = layout.cameras[view.camera_idx].direction.start;
        let field = start..start + carried.nrows();
        let gradient = sums.small.ncols() - 1;
        let coupling = &mut self.coupling[view.pose_idx];
        for k in 0..6 {
            let mut column = coupling.column_mut(k);
            let mut rows = column.rows_range_mut(field.clone());
            rows += carried.column(k);
        }
        self.poses[view.pose_idx] += sums.small.fixed_view::<6, 6>(0, 0);
        self.pose_gradients[view.pose_idx] += sums.small.fixed_view::<6, 1>(0, gradient);
        let mut gradient_rows = self.global_gradient.rows_range_mut(field.clone());
        gradient_rows += carried.column(gradient);
        let targets: Vec<(usize, usize)> = fixed_columns(layout, view.camera_idx)
            .enumerate()
            .filter_map(|(k, global)| Some((global?, EXTRINSICS + k)))
            .collect();
        for (global, small) in &targets {
            self.global_gradient[*global] += sums.small[(*small, gradient)];
            for k in 0..6 {
                coupling[(*global, k)] += sums.small[(*small, k)];
            }
            for (other_global, other_small) in &targets {
                self.global[(*global, *other_global)] += sums.small[(*small, *other_small)];
            }
            for (row, value) in field.clone().zip(carried.column(*small).iter()) {
                self.global[(row, *global)] += value;
                self.global[(*global, row)] += value;
            }
        }
    }

    fn add_priors(&mut self, model: &Model, layout: &Layout, priors: &Priors) {
        for ((camera, ranges), (priors, spline)) in model
            .cameras
            .iter()
            .zip(&layout.cameras)
            .zip(priors.cameras.iter().zip(&mut self.splines))
        {
            let amounts = camera.basis.amounts(&camera.field.direction.polynomial);
            let offset = camera.offset_amounts();
            let direction = ranges
                .direction
                .clone()
                .zip(amounts.iter().zip(&priors.direction));
            let offset = ranges.offset.clone().zip(offset.iter().zip(&priors.offset));
            for (row, (amount, weight)) in direction.chain(offset) {
                self.global[(row, row)] += weight;
                self.global_gradient[row] += weight * amount;
            }
            if let (Some(block), Some(energy)) = (spline, &priors.thin_plate) {
                block.band.add_scaled(priors.spline, energy);
                block.gradient += energy.times(&camera.spline_amounts()) * priors.spline;
            }
        }
        for (row, term) in layout.board.clone().zip(&model.board_shape.terms) {
            self.global[(row, row)] += priors.board;
            self.global_gradient[row] += priors.board * term.2;
        }
    }

    /// Factorizes. `damping` scales up the diagonal (Marquardt); 0 leaves the Hessian.
    ///
    /// `None` if a block is not positive definite: something the data do not determine.
    pub fn reduce(&self, damping: f64) -> Option<Reduced> {
        let mut global = self.global.clone();
        scale_diagonal(&mut global, damping);
        let poses: Vec<Matrix6<f64>> = self
            .poses
            .iter()
            .map(|block| {
                let mut damped = *block;
                for k in 0..6 {
                    damped[(k, k)] *= 1.0 + damping;
                }
                damped
            })
            .collect();
        if self.splines.iter().all(Option::is_none) {
            self.reduce_poses(global, &poses)
        } else {
            self.reduce_splines(&global, &poses, damping)
        }
    }

    /// Without splines: the poses go first.
    fn reduce_poses(&self, mut global: DMatrix<f64>, poses: &[Matrix6<f64>]) -> Option<Reduced> {
        let mut right = -&self.global_gradient;
        let mut factors = Vec::with_capacity(poses.len());
        for ((block, gradient), coupling) in
            poses.iter().zip(&self.pose_gradients).zip(&self.coupling)
        {
            let factor = block.cholesky()?;
            // With V = L L^T and Y = W L^-T, the pose takes Y Y^T off the global block.
            let mut y = coupling.transpose();
            factor.l_dirty().solve_lower_triangular_mut(&mut y);
            global.gemm_tr(-1.0, &y, &y, 1.0);
            right += coupling * factor.solve(gradient);
            factors.push(factor);
        }
        Some(Reduced {
            border: global.cholesky()?,
            right,
            global_len: self.global_gradient.len(),
            eliminated: Eliminated::Poses(factors),
        })
    }

    /// With splines: they go first, each from its band.
    fn reduce_splines(
        &self,
        global: &DMatrix<f64>,
        poses: &[Matrix6<f64>],
        damping: f64,
    ) -> Option<Reduced> {
        let global_len = global.nrows();
        let size = global_len + 6 * poses.len();
        let mut border = DMatrix::zeros(size, size);
        let mut right = DVector::zeros(size);
        border
            .view_mut((0, 0), (global_len, global_len))
            .copy_from(global);
        right
            .rows_mut(0, global_len)
            .copy_from(&-&self.global_gradient);
        for (pose_idx, block) in poses.iter().enumerate() {
            let at = global_len + 6 * pose_idx;
            border.view_mut((at, at), (6, 6)).copy_from(block);
            border
                .view_mut((0, at), (global_len, 6))
                .copy_from(&self.coupling[pose_idx]);
            right
                .rows_mut(at, 6)
                .copy_from(&-self.pose_gradients[pose_idx]);
        }
        let eliminated: Vec<Option<EliminatedSpline>> = self
            .splines
            .par_iter()
            .map(|block| match block {
                None => Some(None),
                Some(block) => block.eliminate(damping).map(Some),
            })
            .collect::<Option<_>>()?;
        for (block, spline) in self.splines.iter().zip(&eliminated) {
            if let (Some(block), Some(spline)) = (block, spline) {
                // Y^T Y, the share of this spline in the border.
                let share = &spline.y_transposed * spline.y_transposed.transpose();
                let pulled = &spline.y_transposed * &spline.solved_gradient;
                for (b, column) in block.columns.iter().enumerate() {
                    right[*column] += pulled[b];
                    for (a, row) in block.columns.iter().enumerate() {
                        if row <= column {
                            border[(*row, *column)] -= share[(a, b)];
                        }
                    }
                }
            }
        }
        border.fill_lower_triangle_with_upper_triangle();
        Some(Reduced {
            border: border.cholesky()?,
            right,
            global_len,
            eliminated: Eliminated::Splines(
                self.splines
                    .iter()
                    .zip(eliminated)
                    .map(|(block, spline)| Some((block.as_ref()?.columns.clone(), spline?)))
                    .collect(),
            ),
        })
    }

    /// The step that the (damped) equations ask for.
    pub fn step(&self, reduced: &Reduced) -> Step {
        let border = reduced.border.solve(&reduced.right);
        match &reduced.eliminated {
            Eliminated::Poses(factors) => {
                let poses = self
                    .pose_gradients
                    .iter()
                    .zip(&self.coupling)
                    .zip(factors)
                    .map(|((gradient, coupling), factor)| {
                        let pulled = coupling.tr_mul(&border);
                        factor.solve(&(-gradient - pulled.fixed_rows::<6>(0)))
                    })
                    .collect();
                Step {
                    splines: vec![DVector::zeros(0); self.splines.len()],
                    global: border,
                    poses,
                }
            }
            Eliminated::Splines(splines) => {
                let splines = splines
                    .iter()
                    .map(|spline| {
                        spline.as_ref().map_or_else(
                            || DVector::zeros(0),
                            |(columns, spline)| {
                                spline.back_substitute(&-&spline.solved_gradient, columns, &border)
                            },
                        )
                    })
                    .collect();
                let global_len = reduced.global_len;
                let poses = (0..self.poses.len())
                    .map(|idx| border.fixed_rows::<6>(global_len + 6 * idx).into_owned())
                    .collect();
                Step {
                    global: border.rows(0, global_len).into_owned(),
                    poses,
                    splines,
                }
            }
        }
    }

    /// By how much the linearized objective falls with a step of the equations damped so.
    ///
    /// The step solves `(H + mu D) x = -g`, so `-(2 g.x + x.H x) = -g.x + mu x.D x`.
    pub fn predicted_decrease(&self, step: &Step, damping: f64) -> f64 {
        let mut linear = self.global_gradient.dot(&step.global);
        let mut diagonal: f64 = (0..step.global.len())
            .map(|k| self.global[(k, k)] * step.global[k].powi(2))
            .sum();
        for ((block, gradient), pose) in
            self.poses.iter().zip(&self.pose_gradients).zip(&step.poses)
        {
            linear += gradient.dot(pose);
            diagonal += (0..6).map(|k| block[(k, k)] * pose[k].powi(2)).sum::<f64>();
        }
        for (block, change) in self.splines.iter().zip(&step.splines) {
            if let Some(block) = block {
                linear += block.gradient.dot(change);
                diagonal += (0..change.len())
                    .map(|k| block.band.get(k, k) * change[k].powi(2))
                    .sum::<f64>();
            }
        }
        -linear + damping * diagonal
    }
}

impl SplineBlock {
    fn new(
        sums: &SplineSums,
        layout: &Layout,
        camera_idx: usize,
        poses: &[usize],
        to_columns: &DMatrix<f64>,
    ) -> Self {
        let (rows, field_len) = (sums.band.size(), to_columns.nrows());
        // Border columns that exist as parameters: a camera without extrinsics has none of them.
        let fixed: Vec<(usize, usize)> = fixed_columns(layout, camera_idx)
            .enumerate()
            .filter_map(|(k, global)| Some((field_len + k, global?)))
            .collect();
        let fixed_len = fixed_columns(layout, camera_idx).count();
        let pose_columns = poses.iter().enumerate().flat_map(|(k, pose_idx)| {
            (0..6).map(move |c| {
                (
                    field_len + fixed_len + 6 * k + c,
                    layout.global_len + 6 * pose_idx + c,
                )
            })
        });
        let kept: Vec<(usize, usize)> = fixed.into_iter().chain(pose_columns).collect();
        let start = layout.cameras[camera_idx].direction.start;
        let parameters = to_columns.ncols();
        let columns: Vec<usize> = (start..start + parameters)
            .chain(kept.iter().map(|(_, global)| *global))
            .collect();
        let mut border = vec![0.0; rows * columns.len()];
        let source = nalgebra::DMatrixView::from_slice_with_strides(
            &sums.border,
            field_len,
            rows,
            1,
            sums.border_len,
        );
        let carried = to_columns.tr_mul(&source);
        for row in 0..rows {
            let target = &mut border[row * columns.len()..][..columns.len()];
            target[..parameters].copy_from_slice(carried.column(row).as_slice());
            let source = &sums.border[row * sums.border_len..][..sums.border_len];
            for (entry, (from, _)) in target[parameters..].iter_mut().zip(&kept) {
                *entry = source[*from];
            }
        }
        Self {
            band: sums.band.clone(),
            gradient: DVector::from_fn(rows, |row, _| sums.border[(row + 1) * sums.border_len - 1]),
            border,
            columns,
        }
    }

    fn eliminate(&self, damping: f64) -> Option<EliminatedSpline> {
        let mut band = self.band.clone();
        band.scale_diagonal(1.0 + damping);
        let factor = band.cholesky()?;
        let mut y = self.border.clone();
        factor.solve_lower(&mut y, self.columns.len());
        let mut solved_gradient = self.gradient.clone();
        factor.solve_lower_vector(&mut solved_gradient);
        Some(EliminatedSpline {
            // Row-major y is its transpose in column-major storage.
            y_transposed: DMatrix::from_vec(self.columns.len(), self.band.size(), y),
            solved_gradient,
            factor,
        })
    }
}

/// The factorized equations.
#[derive(Debug, Clone)]
pub struct Reduced {
    /// Of the global parameters, and of the poses behind them if splines were eliminated.
    pub(super) border: Cholesky<f64, Dyn>,
    right: DVector<f64>,
    pub(super) global_len: usize,
    pub(super) eliminated: Eliminated,
}

#[derive(Debug, Clone)]
pub(super) enum Eliminated {
    Poses(Vec<Cholesky<f64, nalgebra::Const<6>>>),
    /// Border columns and factor per camera with a spline.
    Splines(Vec<Option<(Vec<usize>, EliminatedSpline)>>),
}

/// `F = L L^T`, `Y = L^-1 E`, `L^-1 gradient`.
#[derive(Debug, Clone)]
pub(super) struct EliminatedSpline {
    pub(super) factor: BandedCholesky,
    pub(super) y_transposed: DMatrix<f64>,
    solved_gradient: DVector<f64>,
}

impl EliminatedSpline {
    /// The knots' part of a solution: `L^-T (solved - Y border)`.
    fn back_substitute(
        &self,
        solved: &DVector<f64>,
        columns: &[usize],
        border: &DVector<f64>,
    ) -> DVector<f64> {
        let own = DVector::from_iterator(columns.len(), columns.iter().map(|c| border[*c]));
        let mut knots = solved - self.y_transposed.tr_mul(&own);
        self.factor.solve_upper_vector(&mut knots);
        knots
    }
}

impl Reduced {
    /// Covariance of the global parameters (everything else marginalized), if the weights are
    /// inverse variances and the damping was 0.
    pub fn global_covariance(&self) -> DMatrix<f64> {
        let n = self.global_len;
        let size = self.border.l_dirty().nrows();
        let mut units = DMatrix::zeros(size, n);
        units.fill_with_identity();
        self.border.solve_mut(&mut units);
        units.rows(0, n).into_owned()
    }

    /// Natural logarithm of the determinant of the whole Hessian.
    pub fn ln_determinant(&self) -> f64 {
        let l = self.border.l_dirty();
        let border = 2.0 * (0..l.nrows()).map(|k| l[(k, k)].ln()).sum::<f64>();
        let eliminated: f64 = match &self.eliminated {
            Eliminated::Poses(factors) => factors
                .iter()
                .map(|f| 2.0 * (0..6).map(|k| f.l_dirty()[(k, k)].ln()).sum::<f64>())
                .sum(),
            Eliminated::Splines(splines) => splines
                .iter()
                .flatten()
                .map(|(_, spline)| spline.factor.ln_determinant())
                .sum(),
        };
        border + eliminated
    }

    /// `tr(matrix covariance)` over the knots of one camera's spline, by Hutchinson's estimator
    /// with the given probes (entries +1 and -1). 0 without a spline.
    pub fn spline_trace(
        &self,
        camera_idx: usize,
        matrix: &BandedMatrix,
        probes: &[DVector<f64>],
    ) -> f64 {
        let Eliminated::Splines(splines) = &self.eliminated else {
            return 0.0;
        };
        let Some(Some((columns, spline))) = splines.get(camera_idx) else {
            return 0.0;
        };
        let sum: f64 = probes
            .par_iter()
            .map(|probe| {
                let mut solved = probe.clone();
                spline.factor.solve_lower_vector(&mut solved);
                let pulled = &spline.y_transposed * &solved;
                let mut border = DVector::zeros(self.right.len());
                for (column, value) in columns.iter().zip(pulled.iter()) {
                    border[*column] = -value;
                }
                self.border.solve_mut(&mut border);
                let knots = spline.back_substitute(&solved, columns, &border);
                matrix.times(probe).dot(&knots)
            })
            .collect::<Vec<f64>>()
            .iter()
            .sum();
        sum / probes.len() as f64
    }
}

/// Where extrinsics and board shape stand among the global parameters, in the order of a view's
/// small columns behind the pose; `None` for extrinsics that are held.
fn fixed_columns(layout: &Layout, camera_idx: usize) -> impl Iterator<Item = Option<usize>> + '_ {
    let extrinsics = layout.cameras[camera_idx].extrinsics.as_ref();
    (0..6)
        .map(move |k| extrinsics.map(|range| range.start + k))
        .chain(layout.board.clone().map(Some))
}

/// What a unit of each of a camera's polynomial parameters (columns: direction, then offset) does
/// to the coefficients of its components (rows, see [`Components`]).
pub(super) fn parameters_to_columns(camera: &CameraModel) -> DMatrix<f64> {
    let components = Components::of(camera);
    let direction = camera.basis.coefficients();
    let offset_len = camera.offset_amounts().len();
    let mut map = DMatrix::zeros(components.len(), direction.ncols() + offset_len);
    for component in 0..2 {
        for k in 0..components.terms(component) {
            let source = direction.row(2 * k + component);
            map.view_mut((components.start(component) + k, 0), (1, direction.ncols()))
                .copy_from(&source);
        }
    }
    if let Some(offset) = &camera.field.offset {
        let norms = legendre_norms(offset.polynomial.degree);
        for component in 2..4 {
            let terms = components.terms(component);
            for k in 0..terms {
                let column = direction.ncols() + (component - 2) * terms + k;
                map[(components.start(component) + k, column)] = 1.0 / norms[k];
            }
        }
    }
    map
}

fn scale_diagonal(matrix: &mut DMatrix<f64>, damping: f64) {
    for k in 0..matrix.nrows() {
        matrix[(k, k)] *= 1.0 + damping;
    }
}
