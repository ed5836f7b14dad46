//! What the views contribute to the normal equations.
//!
//! A field enters a residual through `by_s ds + by_m dm`, and `ds`, `dm` are sums of fixed
//! functions of the pixel times coefficients. So a camera's field has up to four components (s1,
//! s2, m1, m2), component a has the 2-vector `j_a` (a column of `by_s` or `by_m`), and its block
//! with component b is `sum w (j_a . j_b) f g^T` over the functions f of a and g of b: products of
//! tall matrices per view for the polynomials, a band for the spline.

use super::banded::BandedMatrix;
use super::knots::KnotOrder;
use super::model::{CameraModel, Model};
use super::observations::{Observations, ViewBasis, ViewBlock};
use super::residual::{Linearization, linearize};
use crate::geometry::so3::skew;
use nalgebra::{DMatrix, Vector2, Vector3};

/// Columns of the pose and of the extrinsics among a view's small columns; the board's terms and
/// the gradient follow.
pub const POSE: usize = 0;
pub const EXTRINSICS: usize = 6;
pub const BOARD: usize = 12;

/// A corner as the model sees it.
pub struct Seen {
    /// `None` behind the camera.
    pub linearization: Option<Linearization>,
    /// The corner turned into the rig's axes about the board's origin, mm.
    turned_in_board: Vector3<f64>,
    /// The corner turned into the camera's axes about the rig's origin, mm.
    turned_in_rig: Vector3<f64>,
}

/// The corners of a view as the model sees them.
pub fn predict<'a>(
    model: &'a Model,
    observations: &'a Observations,
    view: &'a ViewBlock,
    basis: &'a ViewBasis,
) -> impl Iterator<Item = Seen> + 'a {
    let camera = &model.cameras[view.camera_idx];
    let pose = &model.rig_from_board[view.pose_idx];
    view.corners.iter().enumerate().map(move |(idx, corner)| {
        let mut point = corner.point_in_board;
        point.z += model.board_shape.height_mm(&observations.board, &point);
        let turned_in_board = pose.rotation * point;
        let turned_in_rig =
            camera.camera_from_rig.rotation * (turned_in_board + pose.translation_mm);
        let point_in_camera = turned_in_rig + camera.camera_from_rig.translation_mm;
        Seen {
            linearization: linearize(&basis.sample(&camera.field, idx), &point_in_camera),
            turned_in_board,
            turned_in_rig,
        }
    })
}

/// The fixed functions behind each component of a camera's field, polynomials only.
#[derive(Debug, Clone, Copy)]
pub struct Components {
    direction_terms: usize,
    offset_terms: usize,
}

impl Components {
    /// Those of a camera.
    pub fn of(camera: &CameraModel) -> Self {
        Self {
            direction_terms: camera.field.direction.polynomial.coefficients.len(),
            offset_terms: camera
                .field
                .offset
                .as_ref()
                .map_or(0, |offset| offset.polynomial.coefficients.len()),
        }
    }

    /// Number of components: 2 for a central camera, else 4.
    pub fn count(&self) -> usize {
        if self.offset_terms > 0 { 4 } else { 2 }
    }

    /// Number of functions of a component: the first so many Legendre products.
    pub fn terms(&self, component: usize) -> usize {
        if component < 2 {
            self.direction_terms
        } else {
            self.offset_terms
        }
    }

    /// First column of a component.
    pub fn start(&self, component: usize) -> usize {
        (0..component).map(|c| self.terms(c)).sum()
    }

    /// Number of columns.
    pub fn len(&self) -> usize {
        self.start(self.count())
    }
}

/// What one view contributes.
pub struct ViewSums {
    /// Field by field: columns by component, see [`Components`].
    pub field: DMatrix<f64>,
    /// Field by the small columns: pose 6, extrinsics 6, board, gradient.
    pub field_small: DMatrix<f64>,
    /// The small columns by themselves.
    pub small: DMatrix<f64>,
    /// Per corner and pair of components (a <= b, row by row): `w j_a . j_b`.
    pairs: DMatrix<f64>,
    /// Per component, corner and small column: `w j_a . column`.
    crossed: Vec<DMatrix<f64>>,
}

/// Number of the pair (a, b), a <= b, of `count` components.
fn pair(count: usize, a: usize, b: usize) -> usize {
    let (a, b) = (a.min(b), a.max(b));
    a * count - a * (a + 1) / 2 + b
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
    let mut pairs = DMatrix::zeros(n, count * (count + 1) / 2);
    let mut crossed = vec![DMatrix::zeros(n, small_len); count];
    let mut small = DMatrix::zeros(small_len, small_len);
    for (idx, seen) in predict(model, observations, view, basis).enumerate() {
        let weight = weights[idx];
        let Some(l) = seen.linearization.as_ref().filter(|_| weight > 0.0) else {
            continue;
        };
        let row = small_columns(model, observations, view, idx, &seen, l);
        let j: [Vector2<f64>; 4] = [
            l.by_s.column(0).into(),
            l.by_s.column(1).into(),
            l.by_m.column(0).into(),
            l.by_m.column(1).into(),
        ];
        for a in 0..count {
            for b in a..count {
                pairs[(idx, pair(count, a, b))] = weight * j[a].dot(&j[b]);
            }
            for (column, value) in row.iter().enumerate() {
                crossed[a][(idx, column)] = weight * j[a].dot(value);
            }
        }
        for (column, value) in row.iter().enumerate() {
            for (other, other_value) in row[..=column].iter().enumerate() {
                small[(other, column)] += weight * value.dot(other_value);
            }
        }
    }
    small.fill_lower_triangle_with_upper_triangle();
    let mut field = DMatrix::zeros(components.len(), components.len());
    let mut field_small = DMatrix::zeros(components.len(), small_len);
    for (a, crossed_a) in crossed.iter().enumerate() {
        let products_a = basis.products.columns(0, components.terms(a));
        let rows = (components.start(a), components.terms(a));
        field_small
            .rows_mut(rows.0, rows.1)
            .gemm_tr(1.0, &products_a, crossed_a, 0.0);
        for b in a..count {
            let mut scaled = basis.products.columns(0, components.terms(b)).into_owned();
            let weights = pairs.column(pair(count, a, b));
            for mut column in scaled.column_iter_mut() {
                column.component_mul_assign(&weights);
            }
            field
                .view_mut((rows.0, components.start(b)), (rows.1, components.terms(b)))
                .gemm_tr(1.0, &products_a, &scaled, 0.0);
        }
    }
    field.fill_lower_triangle_with_upper_triangle();
    ViewSums {
        field,
        field_small,
        small,
        pairs,
        crossed,
    }
}

/// Derivatives of a corner's residual by pose, extrinsics and board shape, and the residual.
fn small_columns(
    model: &Model,
    observations: &Observations,
    view: &ViewBlock,
    corner_idx: usize,
    seen: &Seen,
    l: &Linearization,
) -> Vec<Vector2<f64>> {
    let camera = &model.cameras[view.camera_idx];
    let pose = &model.rig_from_board[view.pose_idx];
    let by_rig = l.by_point * camera.camera_from_rig.rotation;
    let by_height = by_rig * pose.rotation.column(2);
    let by_pose_turn = -by_rig * skew(&seen.turned_in_board);
    let by_camera_turn = -l.by_point * skew(&seen.turned_in_rig);
    let corner = &view.corners[corner_idx].point_in_board;
    [by_pose_turn, by_rig, by_camera_turn, l.by_point]
        .iter()
        .flat_map(|block| block.column_iter().map(Into::into).collect::<Vec<_>>())
        .chain(
            model
                .board_shape
                .products(&observations.board, corner)
                .map(|product| by_height * product),
        )
        .chain([l.residual_px])
        .collect()
}

/// What all views of one camera contribute to the equations of its spline.
pub struct SplineSums {
    /// Knot by knot, in knot order.
    pub band: BandedMatrix,
    /// Knots (rows, row-major) by all columns that they are coupled to: the field's polynomials,
    /// extrinsics 6, board, then 6 for each of the camera's views in order, then the gradient.
    pub border: Vec<f64>,
    /// Number of those columns.
    pub border_len: usize,
}

/// Sums over the views of one camera, given in order with their [`ViewSums`].
///
/// Cost per corner: `32 (2 F + 20) + 3 * 136` multiplications, F the number of polynomial columns.
pub fn spline_sums(
    camera: &CameraModel,
    order: &KnotOrder,
    views: &[(&ViewBasis, &ViewSums)],
) -> SplineSums {
    let components = Components::of(camera);
    let count = components.count();
    let field_len = components.len();
    let fixed_small = views
        .first()
        .map_or(0, |(_, sums)| sums.small.ncols() - EXTRINSICS - 1);
    let border_len = field_len + fixed_small + 6 * views.len() + 1;
    let rows = 2 * order.knot_count();
    let mut band = BandedMatrix::zeros(rows, order.half_bandwidth());
    let mut border = vec![0.0; rows * border_len];
    // The part of a row that every view of the camera shares, for each of the two components.
    let mut shared = [
        vec![0.0; field_len + fixed_small],
        vec![0.0; field_len + fixed_small],
    ];
    for (view_idx, (basis, sums)) in views.iter().enumerate() {
        let pose_start = field_len + fixed_small + 6 * view_idx;
        let gradient = sums.small.ncols() - 1;
        for (corner_idx, (u, v)) in basis.knots.iter().enumerate() {
            if sums.pairs[(corner_idx, 0)] == 0.0 {
                continue;
            }
            for (a, shared) in shared.iter_mut().enumerate() {
                for c in 0..count {
                    let weight = sums.pairs[(corner_idx, pair(count, a, c))];
                    let start = components.start(c);
                    for k in 0..components.terms(c) {
                        shared[start + k] = weight * basis.products[(corner_idx, k)];
                    }
                }
                for k in 0..fixed_small {
                    shared[field_len + k] = sums.crossed[a][(corner_idx, EXTRINSICS + k)];
                }
            }
            let mut places = [(0, 0.0); 16];
            for j in 0..4 {
                for i in 0..4 {
                    places[4 * j + i] = (
                        order.place(u.first + i, v.first + j),
                        u.value[i] * v.value[j],
                    );
                }
            }
            for (place, value) in places {
                for (a, shared) in shared.iter().enumerate() {
                    let row = &mut border[(2 * place + a) * border_len..][..border_len];
                    for (entry, shared) in row.iter_mut().zip(shared) {
                        *entry += value * shared;
                    }
                    for k in 0..6 {
                        row[pose_start + k] += value * sums.crossed[a][(corner_idx, POSE + k)];
                    }
                    row[border_len - 1] += value * sums.crossed[a][(corner_idx, gradient)];
                }
                for (other, other_value) in places {
                    if other > place {
                        continue;
                    }
                    let both = value * other_value;
                    for a in 0..2 {
                        for b in 0..2 {
                            if other == place && b > a {
                                continue;
                            }
                            let weight = sums.pairs[(corner_idx, pair(count, a, b))];
                            band.add(2 * place + a, 2 * other + b, both * weight);
                        }
                    }
                }
            }
        }
    }
    SplineSums {
        band,
        border,
        border_len,
    }
}
