//! What the views contribute to the normal equations.
//!
//! A field enters a residual through `by_s ds + by_m dm`, and `ds`, `dm` are sums of fixed
//! functions of the pixel times coefficients. So a camera's field has up to four components (s1,
//! s2, m1, m2), component a has the 2-vector `j_a` (a column of `by_s` or `by_m`), and its block
//! with component b is `sum w (j_a . j_b) f g^T` over the functions f of a and g of b: products of
//! tall matrices per view for the polynomials, a band for the spline.

use super::components::{Components, pair};
use super::moments::FieldMoments;
use crate::adjust::model::{CameraModel, Model};
use crate::adjust::observations::{Observations, ViewBasis, ViewBlock};
use crate::adjust::prediction::{Seen, predict};
use crate::adjust::residual::Linearization;
use calib_rays::field::knot_order::KnotOrder;
use calib_rays::field::spline::AxisWeights;
use calib_rays::geometry::RigidTransform;
use calib_rays::numerics::banded::BandedMatrix;
use nalgebra::{DMatrix, DMatrixView, Dyn, Vector2};

/// Columns of the pose and of the extrinsics among a view's small columns; the board's terms and
/// the gradient follow.
pub const POSE: usize = 0;
pub const EXTRINSICS: usize = 6;
pub const BOARD: usize = 12;

/// What one view contributes.
pub struct ViewSums {
    /// Field by field, as sums that give the block of the camera.
    pub field: FieldMoments,
    /// Field by the small columns: pose 6, extrinsics 6, board, gradient.
    pub field_small: DMatrix<f64>,
    /// The small columns by themselves.
    pub small: DMatrix<f64>,
    /// Per pair of components (a <= b, row by row; rows) and corner (columns): `w j_a . j_b`.
    pairs: DMatrix<f64>,
    /// Per component: small column (rows) by corner (columns), `w j_a . column`.
    crossed: Vec<DMatrix<f64>>,
}

/// Sums over the corners of a view. Weights are in 1/px^2.
pub fn view_sums(
    model: &Model,
    observations: &Observations,
    view: &ViewBlock,
    basis: &ViewBasis,
    weights: &[f64],
) -> ViewSums {
    let camera = &model.cameras[view.camera_idx];
    let components = Components::of(camera);
    let count = components.count();
    let small_len = BOARD + model.board_shape.terms.len() + 1;
    let n = view.corners.len();
    let mut pairs = DMatrix::zeros(count * (count + 1) / 2, n);
    let mut crossed = vec![DMatrix::zeros(small_len, n); count];
    let mut small = DMatrix::zeros(small_len, small_len);
    let mut row = vec![Vector2::zeros(); small_len];
    let mut field = FieldMoments::zero(basis.degree(), count);
    for (idx, seen) in predict(model, observations, view, basis).enumerate() {
        let weight = weights[idx];
        let Some(l) = seen.linearization.as_ref().filter(|_| weight > 0.0) else {
            continue;
        };
        fill_small_columns(model, observations, view, idx, &seen, l, &mut row);
        let j: [Vector2<f64>; 4] = [
            l.by_s.column(0).into(),
            l.by_s.column(1).into(),
            l.by_m.column(0).into(),
            l.by_m.column(1).into(),
        ];
        for a in 0..count {
            for b in a..count {
                pairs[(pair(count, a, b), idx)] = weight * j[a].dot(&j[b]);
            }
        }
        field.add(basis.axes(idx), column(&pairs, idx));
        for a in 0..count {
            let weighted = j[a] * weight;
            let target = &mut crossed[a].as_mut_slice()[idx * small_len..][..small_len];
            for (entry, value) in target.iter_mut().zip(&row) {
                *entry = weighted.dot(value);
            }
        }
        for (k, value) in row.iter().enumerate() {
            let weighted = value * weight;
            let target = &mut small.as_mut_slice()[k * small_len..][..=k];
            for (entry, other) in target.iter_mut().zip(&row) {
                *entry += weighted.dot(other);
            }
        }
    }
    small.fill_lower_triangle_with_upper_triangle();
    let mut field_small = DMatrix::zeros(components.len(), small_len);
    for (a, crossed) in crossed.iter().enumerate() {
        let (start, terms) = (components.start(a), components.terms(a));
        let products = basis.products().rows(0, terms);
        field_small.rows_mut(start, terms).gemm(
            1.0,
            &products,
            &transposed(crossed, small_len),
            0.0,
        );
    }
    ViewSums {
        field,
        field_small,
        small,
        pairs,
        crossed,
    }
}

/// The transpose of the first rows, without copying.
fn transposed(matrix: &DMatrix<f64>, rows: usize) -> DMatrixView<'_, f64, Dyn, Dyn> {
    DMatrixView::from_slice_with_strides(matrix.as_slice(), matrix.ncols(), rows, matrix.nrows(), 1)
}

/// Derivatives of a corner's residual by pose, extrinsics and board shape, and the residual.
fn fill_small_columns(
    model: &Model,
    observations: &Observations,
    view: &ViewBlock,
    corner_idx: usize,
    seen: &Seen,
    l: &Linearization,
    row: &mut [Vector2<f64>],
) {
    let camera = &model.cameras[view.camera_idx];
    let pose = &model.rig_from_board[view.pose_idx];
    let by_rig = l.by_point * camera.camera_from_rig.rotation;
    let by_height = by_rig * pose.rotation.column(2);
    let by_pose = RigidTransform::by_step(&by_rig, &seen.turned_in_board);
    let by_camera = RigidTransform::by_step(&l.by_point, &seen.turned_in_rig);
    let corner = &view.corners[corner_idx].point_in_board;
    for (target, block) in row.chunks_exact_mut(6).zip(&[by_pose, by_camera]) {
        for (entry, column) in target.iter_mut().zip(block.column_iter()) {
            *entry = column.into();
        }
    }
    let products = model.board_shape.products(&observations.board, corner);
    for (entry, product) in row[BOARD..].iter_mut().zip(products) {
        *entry = by_height * product;
    }
    if let Some(last) = row.last_mut() {
        *last = l.residual_px;
    }
}

/// What all views of one camera contribute to the equations of its spline.
pub struct SplineSums {
    /// Knot by knot, in knot order.
    pub band: BandedMatrix,
    /// Knots (rows, row-major) by all columns that they are coupled to: the field's polynomials
    /// ([`Components`]), extrinsics 6, board, gradient, then 6 for each of the views in order.
    pub border: Vec<f64>,
    /// Per border column, the number of leading rows that are zero, in rising order.
    pub begins: Vec<usize>,
}

/// The first row of a spline's equations that a view touches.
pub fn first_row(order: &KnotOrder, basis: &ViewBasis) -> usize {
    basis
        .knots
        .iter()
        .map(|(u, v)| 2 * order.place(u.first, v.first))
        .min()
        .unwrap_or(0)
}

/// Sums over the views of one camera, given with their [`ViewSums`] by rising [`first_row`].
///
/// Cost per corner: `32 (F + 20) + 4 * 136` multiplications, F the number of polynomial columns.
pub fn spline_sums(
    camera: &CameraModel,
    order: &KnotOrder,
    views: &[(&ViewBasis, &ViewSums)],
) -> SplineSums {
    let components = Components::of(camera);
    let count = components.count();
    let field_len = components.len();
    let small_len = views
        .first()
        .map_or(EXTRINSICS, |(_, sums)| sums.small.ncols());
    let shared_len = field_len + small_len - EXTRINSICS;
    let mut begins = vec![0; shared_len];
    for (basis, _) in views {
        begins.extend([first_row(order, basis); 6]);
    }
    let border_len = begins.len();
    let rows = 2 * order.knot_count();
    let mut band = BandedMatrix::zeros(rows, order.half_bandwidth(2));
    let mut border = vec![0.0; rows * border_len];
    // The part of a row that every view of the camera shares, for each of the two components.
    let mut shared = [vec![0.0; shared_len], vec![0.0; shared_len]];
    for (view_idx, (basis, sums)) in views.iter().enumerate() {
        let pose_start = shared_len + 6 * view_idx;
        for (corner_idx, (u, v)) in basis.knots.iter().enumerate() {
            let weight = |a: usize, b: usize| sums.pairs[(pair(count, a, b), corner_idx)];
            if weight(0, 0) == 0.0 {
                continue;
            }
            let products = column(basis.products(), corner_idx);
            let crossed = [0, 1].map(|a| column(&sums.crossed[a], corner_idx));
            for (a, shared) in shared.iter_mut().enumerate() {
                for c in 0..count {
                    let weight = weight(a, c);
                    let start = components.start(c);
                    let target = &mut shared[start..start + components.terms(c)];
                    for (entry, product) in target.iter_mut().zip(products) {
                        *entry = weight * product;
                    }
                }
                shared[field_len..].copy_from_slice(&crossed[a][EXTRINSICS..]);
            }
            let touched = Touched::new(order, u, v);
            for (place, value) in touched.knots() {
                for (a, shared) in shared.iter().enumerate() {
                    let row = &mut border[(2 * place + a) * border_len..][..border_len];
                    for (entry, shared) in row.iter_mut().zip(shared) {
                        *entry += value * shared;
                    }
                    for (entry, crossed) in row[pose_start..pose_start + 6]
                        .iter_mut()
                        .zip(&crossed[a][POSE..])
                    {
                        *entry += value * crossed;
                    }
                }
            }
            touched.add_to(
                &mut band,
                [[weight(0, 0), weight(0, 1)], [weight(0, 1), weight(1, 1)]],
            );
        }
    }
    SplineSums {
        band,
        border,
        begins,
    }
}

fn column(matrix: &DMatrix<f64>, idx: usize) -> &[f64] {
    &matrix.as_slice()[idx * matrix.nrows()..][..matrix.nrows()]
}

/// The 16 knots that a pixel touches: 4 runs of 4 knots whose places follow each other.
struct Touched {
    first: [usize; 4],
    value: [[f64; 4]; 4],
}

impl Touched {
    fn new(order: &KnotOrder, u: &AxisWeights, v: &AxisWeights) -> Self {
        let u_is_longer = order.place(u.first, v.first + 1) == order.place(u.first, v.first) + 1;
        let (across, along) = if u_is_longer { (u, v) } else { (v, u) };
        Self {
            first: [0, 1, 2, 3].map(|k| {
                if u_is_longer {
                    order.place(u.first + k, v.first)
                } else {
                    order.place(u.first, v.first + k)
                }
            }),
            value: across.value.map(|a| along.value.map(|b| a * b)),
        }
    }

    /// Places and weights, by rising place.
    fn knots(&self) -> impl Iterator<Item = (usize, f64)> {
        self.first
            .iter()
            .zip(&self.value)
            .flat_map(|(first, values)| (0..4).map(move |k| (first + k, values[k])))
    }

    /// Adds `weight[a][b]` times the product of two knots' weights for each two components a, b of
    /// each two knots.
    fn add_to(&self, band: &mut BandedMatrix, weight: [[f64; 2]; 2]) {
        for (a, weight) in weight.iter().enumerate() {
            // What stands in the columns of each run, but for the weight of the row's knot.
            let runs = self.value.map(|values| {
                let mut run = [0.0; 8];
                for (pair, value) in run.chunks_exact_mut(2).zip(values) {
                    pair[0] = value * weight[0];
                    pair[1] = value * weight[1];
                }
                run
            });
            for (i, values) in self.value.iter().enumerate() {
                for (k, value) in values.iter().enumerate() {
                    let row = 2 * (self.first[i] + k) + a;
                    for (first, run) in self.first[..i].iter().zip(&runs) {
                        let entries = band.row_from_mut(row, 2 * first);
                        for (entry, other) in entries[..8].iter_mut().zip(run) {
                            *entry += value * other;
                        }
                    }
                    // Up to the diagonal.
                    let entries = band.row_from_mut(row, 2 * self.first[i]);
                    for (entry, other) in entries.iter_mut().zip(&runs[i]) {
                        *entry += value * other;
                    }
                }
            }
        }
    }
}
