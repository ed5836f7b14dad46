//! The singular value decomposition, right for matrices whose columns depend on each other.
//!
//! A Householder decomposition with column pivoting ends where the rank does; the columns of its
//! transposed triangle are then made orthogonal by plane rotations from one side (Hestenes 1958; the
//! order of the two is that of Drmač and Veselić 2008). Every step multiplies by something orthogonal,
//! and nothing is dropped but what lies below round-off of the whole.
//!
//! The decomposition of `nalgebra` 0.35 goes wrong for (nearly) dependent columns
//! (`findings/nalgebra-svd-deficient.sh`); its eigenvectors of symmetric matrices do not.

use super::pivoted_qr::PivotedQr;
use super::product::dot;
use nalgebra::allocator::Allocator;
use nalgebra::{DefaultAllocator, Dim, DimMin, DimMinimum, OMatrix, OVector, U1};

/// Sweeps over all pairs of columns before the decomposition is given up; four to eight are usual.
const MOST_SWEEPS: usize = 60;

/// `A = U S V^T`: U and V with orthonormal columns, as many as the shorter side of A has; S diagonal.
#[derive(Debug, Clone)]
pub struct SingularValues<R: DimMin<C>, C: Dim>
where
    DefaultAllocator: Allocator<R, C>
        + Allocator<C>
        + Allocator<DimMinimum<R, C>>
        + Allocator<C, DimMinimum<R, C>>
        + Allocator<DimMinimum<R, C>, DimMinimum<R, C>>,
{
    /// Descending; beyond the rank 0 or round-off of the largest.
    pub values: OVector<f64, DimMinimum<R, C>>,
    /// V.
    pub right: OMatrix<f64, C, DimMinimum<R, C>>,
    qr: PivotedQr<R, C>,
    /// `Q^T U`, in its first rows.
    turn: OMatrix<f64, DimMinimum<R, C>, DimMinimum<R, C>>,
}

impl<R: DimMin<C>, C: Dim> SingularValues<R, C>
where
    DefaultAllocator: Allocator<R, C>
        + Allocator<C>
        + Allocator<DimMinimum<R, C>>
        + Allocator<R, DimMinimum<R, C>>
        + Allocator<C, DimMinimum<R, C>>
        + Allocator<DimMinimum<R, C>, DimMinimum<R, C>>
        + Allocator<C, R>,
{
    /// The decomposition of a matrix of any shape; `None` if it is not finite.
    pub fn new(matrix: OMatrix<f64, R, C>) -> Option<Self> {
        Self::down_to(matrix, f64::EPSILON)
    }

    /// [`Self::new`] for whom small values do not matter: what is left below `share` of the longest
    /// column's length is taken for zero, which saves its cost.
    pub fn down_to(mut matrix: OMatrix<f64, R, C>, share: f64) -> Option<Self> {
        if !matrix.iter().all(|x| x.is_finite()) {
            return None;
        }
        let scale = power_of_two(matrix.amax());
        matrix /= scale;
        let (rows, columns) = matrix.shape_generic();
        let shorter = rows.min(columns);
        let qr = PivotedQr::new(matrix, share.max(f64::EPSILON));
        let mut right = OMatrix::from_fn_generic(columns, shorter, |column, row| {
            if row < qr.rank() {
                qr.triangle(row, column)
            } else {
                0.0
            }
        });
        let mut turn = OMatrix::identity_generic(shorter, shorter);
        let mut values = orthogonalize(&mut right, &mut turn, qr.rank())?;
        let rank = values.iter().filter(|value| **value > 0.0).count();
        for k in 0..rank {
            right.column_mut(k).unscale_mut(values[k]);
        }
        for k in rank..values.len() {
            let free = free_direction(&right, k);
            right.set_column(k, &free);
        }
        let in_order = right.clone();
        for (place, column) in qr.order().iter().enumerate() {
            right.set_row(*column, &in_order.row(place));
        }
        values *= scale;
        Some(Self {
            values,
            right,
            qr,
            turn,
        })
    }

    /// U.
    pub fn left(&self) -> OMatrix<f64, R, DimMinimum<R, C>> {
        let rows = self.qr.rows();
        let shorter = self.turn.shape_generic().0;
        let mut left = OMatrix::zeros_generic(rows, shorter);
        left.rows_generic_mut(0, shorter).copy_from(&self.turn);
        self.qr.apply(&mut left);
        left
    }

    /// How many values are not 0 and at least `share` of the largest.
    pub fn rank(&self, share: f64) -> usize {
        let least = share * self.values.iter().next().copied().unwrap_or(0.0);
        self.values
            .iter()
            .take_while(|value| **value > 0.0 && **value >= least)
            .count()
    }

    /// The shortest of all x that minimize `|A x - b|`, for each column of b; what goes with values
    /// below `share` of the largest counts as undetermined ([`Self::rank`]).
    pub fn solve<K: Dim>(&self, mut b: OMatrix<f64, R, K>, share: f64) -> OMatrix<f64, C, K>
    where
        DefaultAllocator: Allocator<R, K> + Allocator<C, K>,
    {
        self.qr.apply_transposed(&mut b);
        let (shorter, rank) = (self.turn.shape_generic().0, self.rank(share));
        let mut solution =
            OMatrix::zeros_generic(self.right.shape_generic().0, b.shape_generic().1);
        for (b, mut x) in b.column_iter().zip(solution.column_iter_mut()) {
            for k in 0..rank {
                let amount = self.turn.column(k).dot(&b.rows_generic(0, shorter)) / self.values[k];
                x.axpy(amount, &self.right.column(k), 1.0);
            }
        }
        solution
    }

    /// `A^+`, values below `share` of the largest taken for zero.
    pub fn pseudo_inverse(&self, share: f64) -> OMatrix<f64, C, R> {
        let left = self.left();
        let mut inverse = OMatrix::zeros_generic(self.right.shape_generic().0, self.qr.rows());
        for k in 0..self.rank(share) {
            inverse.ger(
                1.0 / self.values[k],
                &self.right.column(k),
                &left.column(k),
                1.0,
            );
        }
        inverse
    }

    /// The unit vector x with the shortest `A x`; `None` if A has no columns.
    pub fn null_direction(&self) -> Option<OVector<f64, C>> {
        let (columns, shorter) = self.right.shape();
        match shorter {
            _ if columns > shorter => Some(free_direction(&self.right, shorter)),
            0 => None,
            _ => Some(self.right.column(shorter - 1).into_owned()),
        }
    }
}

/// The power of two at or below a length: by it, division is exact. Bounded so that its inverse is
/// finite.
fn power_of_two(length: f64) -> f64 {
    if length > 0.0 {
        2f64.powi((length.log2().floor() as i32).clamp(-1000, 1000))
    } else {
        1.0
    }
}

/// Turns the first `count` columns until each pair is orthogonal, the longest in front, and those of
/// `turn` with them. Returns their lengths, 0 beyond `count`; `None` if they come to no rest.
fn orthogonalize<C: Dim, K: Dim>(
    columns: &mut OMatrix<f64, C, K>,
    turn: &mut OMatrix<f64, K, K>,
    count: usize,
) -> Option<OVector<f64, K>>
where
    DefaultAllocator: Allocator<C, K> + Allocator<K, K> + Allocator<K>,
{
    // Of the cosine between two columns.
    let round_off = f64::EPSILON * columns.nrows() as f64;
    let mut squares = OVector::zeros_generic(turn.shape_generic().0, U1);
    for _ in 0..MOST_SWEEPS {
        let mut at_rest = true;
        // Exact where nothing turns any more; while columns turn, they only have to be near.
        for k in 0..count {
            squares[k] = columns.column(k).norm_squared();
        }
        for p in 0..count {
            for q in p + 1..count {
                if squares[p] < squares[q] {
                    columns.swap_columns(p, q);
                    turn.swap_columns(p, q);
                    squares.swap_rows(p, q);
                }
                let (a, b) = pair(columns, p, q);
                let product = dot(a, b);
                if !(product.abs() > round_off * (squares[p] * squares[q]).sqrt()) {
                    continue;
                }
                at_rest = false;
                // The smaller of the two turns that leave no product.
                let cotangent = (squares[q] - squares[p]) / (2.0 * product);
                let tangent = 1f64.copysign(cotangent)
                    / (cotangent.abs() + (1.0 + cotangent * cotangent).sqrt());
                rotate(a, b, tangent);
                squares[p] -= tangent * product;
                squares[q] += tangent * product;
                let (a, b) = pair(turn, p, q);
                rotate(a, b, tangent);
            }
        }
        if at_rest {
            return Some(squares.map(f64::sqrt));
        }
    }
    None
}

/// Two columns, p before q.
fn pair<C: Dim, K: Dim>(
    matrix: &mut OMatrix<f64, C, K>,
    p: usize,
    q: usize,
) -> (&mut [f64], &mut [f64])
where
    DefaultAllocator: Allocator<C, K>,
{
    let rows = matrix.nrows();
    let (before, from_q) = matrix.as_mut_slice().split_at_mut(q * rows);
    (&mut before[p * rows..(p + 1) * rows], &mut from_q[..rows])
}

/// Turns two columns into one another, the first away from the second for a positive tangent.
fn rotate(a: &mut [f64], b: &mut [f64], tangent: f64) {
    let cos = 1.0 / (1.0 + tangent * tangent).sqrt();
    let sin = cos * tangent;
    for (a, b) in a.iter_mut().zip(b) {
        (*a, *b) = (cos * *a - sin * *b, sin * *a + cos * *b);
    }
}

/// A unit vector orthogonal to the first `count` columns, which are orthonormal and fewer than the
/// rows: what they leave of the axis that they hold least of.
fn free_direction<C: Dim, K: Dim>(columns: &OMatrix<f64, C, K>, count: usize) -> OVector<f64, C>
where
    DefaultAllocator: Allocator<C, K> + Allocator<C>,
{
    let held = |axis: usize| columns.row(axis).columns(0, count).norm_squared();
    let mut direction = OVector::zeros_generic(columns.shape_generic().0, U1);
    if let Some(axis) = (0..columns.nrows()).min_by(|a, b| held(*a).total_cmp(&held(*b))) {
        direction[axis] = 1.0;
    }
    // Once leaves round-off of the length taken off; twice is enough (Kahan; Parlett 1980, 6-9).
    for _ in 0..2 {
        for k in 0..count {
            let along = columns.column(k).dot(&direction);
            direction.axpy(-along, &columns.column(k), 1.0);
        }
        direction.normalize_mut();
    }
    direction
}

#[cfg(test)]
mod tests;
