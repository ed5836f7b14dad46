//! The normal equations in blocks, and their solution.
//!
//! The objective is `sum w |r|^2 + sum prior a^2` (residuals in px, `w` in 1/px^2). Unknowns fall
//! into three kinds: global ones (the fields' polynomials, extrinsics, board shape), poses, and
//! the knots of each camera's spline. A pose is coupled to another pose only through the other
//! kinds, so without splines poses are eliminated first and the work is linear in their number.
//! With splines these are eliminated first: each is banded and coupled to everything else (the
//! border). What is left either way is a Schur complement; METHOD 2.5 has a picture of both orders.
//! Nothing is ever formed that couples knots densely.

use super::assembly::{self, EXTRINSICS, ViewSums};
use super::components::Components;
use super::schur_complement::{Eliminated, SchurComplement};
use super::spline_block::{BorderColumns, EliminatedSpline, SplineBlock};
use crate::adjust::model::{CameraModel, Layout, Model, Step};
use crate::adjust::objective::Weights;
use crate::adjust::observations::{Observations, ViewBasis};
use crate::adjust::priors::{Priors, known_poses};
use calib_rays::field::structured::StructuredBasis;
use calib_rays::numerics::arrowhead::{Arrowhead, PosesEliminated, damped, damped_own};
use calib_rays::numerics::cholesky::BandedCholesky;
use nalgebra::{DMatrix, DVector, Matrix6};
use rayon::prelude::*;

/// The equations `H step = -gradient` of one linearization, priors included.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// Of the global parameters and the poses.
    pub(super) arrow: Arrowhead,
    splines: Vec<Option<SplineBlock>>,
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
        let mut equations = Self {
            arrow: Arrowhead::new(layout.global_len, observations.poses.len()),
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
            let components = Components::of(&model.cameras[camera_idx]);
            equations.add_field_block(
                layout,
                observations,
                &sums,
                &to_columns,
                camera_idx,
                &components,
            );
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
                // Views by the first knot that they touch: zeros above it cost nothing then.
                let mut own: Vec<usize> = (0..observations.views.len())
                    .filter(|k| observations.views[*k].camera_idx == camera_idx)
                    .collect();
                own.sort_by_key(|k| assembly::first_row(&order, &bases[*k]));
                let views: Vec<_> = own.iter().map(|k| (&bases[*k], &sums[*k])).collect();
                let poses = own.iter().map(|k| observations.views[*k].pose_idx);
                Some(SplineBlock::new(
                    assembly::spline_sums(camera, &order, &views),
                    border_columns(layout, camera_idx, poses, to_columns[camera_idx].clone()),
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
        components: &Components,
    ) {
        let to_columns = &to_columns[camera_idx];
        let mut own = observations
            .views
            .iter()
            .zip(sums)
            .filter(|(view, _)| view.camera_idx == camera_idx)
            .map(|(_, sums)| &sums.field);
        let Some(first) = own.next() else {
            return;
        };
        let mut moments = first.clone();
        own.for_each(|other| moments.merge(other));
        let mut block = moments.block(components);
        block.fill_upper_triangle_with_lower_triangle();
        let carried = to_columns.transpose() * (block * to_columns);
        let start = layout.cameras[camera_idx].direction.start;
        self.arrow
            .shared
            .view_mut((start, start), carried.shape())
            .copy_from(&carried);
    }

    /// All that a view adds outside the block of its camera's polynomials.
    fn add_view(
        &mut self,
        layout: &Layout,
        view: &crate::adjust::observations::ViewBlock,
        sums: &ViewSums,
        to_columns: &DMatrix<f64>,
    ) {
        let carried = to_columns.transpose() * &sums.field_small;
        let start = layout.cameras[view.camera_idx].direction.start;
        let field = start..start + carried.nrows();
        let gradient = sums.small.ncols() - 1;
        let Arrowhead {
            shared,
            shared_gradient,
            poses,
        } = &mut self.arrow;
        let pose = &mut poses[view.pose_idx];
        for k in 0..6 {
            let mut column = pose.cross.column_mut(k);
            let mut rows = column.rows_range_mut(field.clone());
            rows += carried.column(k);
        }
        pose.own += sums.small.fixed_view::<6, 6>(0, 0);
        pose.gradient += sums.small.fixed_view::<6, 1>(0, gradient);
        let mut gradient_rows = shared_gradient.rows_range_mut(field.clone());
        gradient_rows += carried.column(gradient);
        let targets: Vec<(usize, usize)> = fixed_columns(layout, view.camera_idx)
            .enumerate()
            .filter_map(|(k, global)| Some((global?, EXTRINSICS + k)))
            .collect();
        for (global, small) in &targets {
            shared_gradient[*global] += sums.small[(*small, gradient)];
            for k in 0..6 {
                pose.cross[(*global, k)] += sums.small[(*small, k)];
            }
            for (other_global, other_small) in &targets {
                shared[(*global, *other_global)] += sums.small[(*small, *other_small)];
            }
            for (row, value) in field.clone().zip(carried.column(*small).iter()) {
                shared[(row, *global)] += value;
                shared[(*global, row)] += value;
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
                self.arrow.shared[(row, row)] += weight;
                self.arrow.shared_gradient[row] += weight * amount;
            }
            if let (Some(block), Some(energy)) = (spline, &priors.thin_plate) {
                block.add_prior(priors.spline, energy, &camera.spline_amounts());
            }
        }
        for (pose_idx, known) in known_poses(model) {
            let pose = &mut self.arrow.poses[pose_idx];
            pose.own += Matrix6::from_diagonal(&known.weight);
            pose.gradient += known.weight.component_mul(&known.change);
        }
        for (row, term) in layout.board.clone().zip(&model.board_shape.terms) {
            self.arrow.shared[(row, row)] += priors.board;
            self.arrow.shared_gradient[row] += priors.board * term.2;
        }
    }

    /// Factorizes. `damping` scales up the diagonal (Marquardt); 0 leaves the Hessian.
    ///
    /// `None` if a block is not positive definite: something the data do not determine.
    pub fn reduce(&self, damping: f64) -> Option<SchurComplement> {
        if self.splines.iter().any(Option::is_some) {
            return self.reduce_splines(damping);
        }
        let PosesEliminated {
            shared,
            right,
            factors,
        } = self.arrow.eliminate_poses(damping)?;
        Some(SchurComplement {
            border: BandedCholesky::of_dense(&shared)?,
            right,
            global_len: shared.nrows(),
            eliminated: Eliminated::Poses(factors),
        })
    }

    /// With splines: they go first, each from its band.
    fn reduce_splines(&self, damping: f64) -> Option<SchurComplement> {
        let arrow = &self.arrow;
        let global_len = arrow.shared.nrows();
        let size = global_len + 6 * arrow.poses.len();
        // The lower triangle.
        let mut border = DMatrix::zeros(size, size);
        let mut right = DVector::zeros(size);
        border
            .view_mut((0, 0), (global_len, global_len))
            .copy_from(&damped(&arrow.shared, damping));
        right
            .rows_mut(0, global_len)
            .copy_from(&-&arrow.shared_gradient);
        for (pose_idx, pose) in arrow.poses.iter().enumerate() {
            let at = global_len + 6 * pose_idx;
            border
                .view_mut((at, at), (6, 6))
                .copy_from(&damped_own(pose, damping));
            border
                .view_mut((at, 0), (6, global_len))
                .copy_from(&pose.cross.transpose());
            right.rows_mut(at, 6).copy_from(&-pose.gradient);
        }
        let eliminated: Vec<Option<EliminatedSpline>> = self
            .splines
            .par_iter()
            .map(|block| match block {
                None => Some(None),
                Some(block) => block.eliminate(damping).map(Some),
            })
            .collect::<Option<_>>()?;
        for spline in eliminated.iter().flatten() {
            spline.subtract_from(&mut border, &mut right);
        }
        Some(SchurComplement {
            border: BandedCholesky::of_dense(&border)?,
            right,
            global_len,
            eliminated: Eliminated::Splines(eliminated),
        })
    }

    /// The step that the (damped) equations ask for.
    pub fn step(&self, reduced: &SchurComplement) -> Step {
        let mut border = reduced.right.clone();
        reduced.border.solve_vector(&mut border);
        match &reduced.eliminated {
            Eliminated::Poses(factors) => Step {
                splines: vec![DVector::zeros(0); self.splines.len()],
                poses: self.arrow.pose_steps(factors, &border),
                global: border,
            },
            Eliminated::Splines(splines) => {
                let splines = splines
                    .iter()
                    .map(|spline| {
                        spline
                            .as_ref()
                            .map_or_else(|| DVector::zeros(0), |spline| spline.step(&border))
                    })
                    .collect();
                let global_len = reduced.global_len;
                let poses = (0..self.arrow.poses.len())
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
        let (mut linear, mut diagonal) = self.arrow.along(&step.global, &step.poses);
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

/// What the border columns of a camera's spline stand for, see [`assembly::SplineSums::border`].
fn border_columns(
    layout: &Layout,
    camera_idx: usize,
    poses: impl Iterator<Item = usize>,
    field: DMatrix<f64>,
) -> BorderColumns {
    let mut others: Vec<Option<usize>> = fixed_columns(layout, camera_idx).collect();
    let gradient = others.len();
    others.push(None);
    others
        .extend(poses.flat_map(|pose| (0..6).map(move |k| Some(layout.global_len + 6 * pose + k))));
    BorderColumns {
        field,
        field_start: layout.cameras[camera_idx].direction.start,
        others,
        gradient,
    }
}

/// Where extrinsics and board shape stand among the global parameters, in the order of a view's
/// small columns behind the pose; `None` for extrinsics that are held.
pub(super) fn fixed_columns(
    layout: &Layout,
    camera_idx: usize,
) -> impl Iterator<Item = Option<usize>> + '_ {
    let extrinsics = layout.cameras[camera_idx].extrinsics.as_ref();
    (0..6)
        .map(move |k| extrinsics.map(|range| range.start + k))
        .chain(layout.board.clone().map(Some))
}

/// What a unit of each of a camera's polynomial parameters (columns: direction, then offset) does
/// to the coefficients of its components (rows, see [`Components`]).
pub(super) fn parameters_to_columns(camera: &CameraModel) -> DMatrix<f64> {
    let components = Components::of(camera);
    let bases = [Some(&camera.basis), camera.offset().map(|(_, basis)| basis)];
    let parameters = bases.iter().flatten().map(|basis| basis.len()).sum();
    let mut map = DMatrix::zeros(components.len(), parameters);
    let mut first = 0;
    for (part, basis) in bases.into_iter().enumerate() {
        let Some(coefficients) = basis.map(StructuredBasis::coefficients) else {
            continue;
        };
        for component in 0..2 {
            let start = components.start(2 * part + component);
            for k in 0..components.terms(2 * part + component) {
                map.view_mut((start + k, first), (1, coefficients.ncols()))
                    .copy_from(&coefficients.row(2 * k + component));
            }
        }
        first += coefficients.ncols();
    }
    map
}
