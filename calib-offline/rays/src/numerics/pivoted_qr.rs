//! The Householder decomposition with column pivoting: which columns a matrix depends on.
//!
//! Golub and Van Loan, Matrix Computations, 4th edition, 5.4.2.

use super::product::dot;
use nalgebra::allocator::Allocator;
use nalgebra::{DefaultAllocator, Dim, OMatrix, OVector};

/// `A P = Q R`: each column of R is chosen, among those not yet used, as the one that has most left
/// over what the earlier ones span.
#[derive(Debug, Clone)]
pub struct PivotedQr<R: Dim, C: Dim>
where
    DefaultAllocator: Allocator<R, C> + Allocator<C>,
{
    /// R on and above the diagonal of its first `rank` rows; below the diagonal of column k the k-th
    /// reflection's vector, whose leading 1 is not stored.
    packed: OMatrix<f64, R, C>,
    /// Each reflection is `1 - factor v v^T`.
    factors: OVector<f64, C>,
    order: OVector<usize, C>,
    rank: usize,
}

impl<R: Dim, C: Dim> PivotedQr<R, C>
where
    DefaultAllocator: Allocator<R, C> + Allocator<C>,
{
    /// Ends where no column has more left than `share` of the longest column's length.
    ///
    /// Squares of the entries must neither overflow nor vanish. Cost: about `3 m n r` for an `m x n`
    /// matrix of rank r.
    pub fn new(matrix: OMatrix<f64, R, C>, share: f64) -> Self {
        let (rows, columns) = matrix.shape();
        let one_per_column = (matrix.shape_generic().1, nalgebra::U1);
        let mut squares = OVector::from_iterator_generic(
            one_per_column.0,
            one_per_column.1,
            matrix.column_iter().map(|column| column.norm_squared()),
        );
        let least = share * squares.iter().copied().fold(0.0, f64::max).sqrt();
        let mut qr = Self {
            packed: matrix,
            factors: OVector::zeros_generic(one_per_column.0, one_per_column.1),
            order: OVector::from_fn_generic(one_per_column.0, one_per_column.1, |k, _| k),
            rank: 0,
        };
        while qr.rank < rows.min(columns) {
            let step = qr.rank;
            let pivot =
                (step..columns).fold(
                    step,
                    |best, k| {
                        if squares[k] > squares[best] { k } else { best }
                    },
                );
            if !(squares[pivot].sqrt() > least) {
                break;
            }
            qr.packed.swap_columns(step, pivot);
            qr.order.swap_rows(step, pivot);
            squares.swap_rows(step, pivot);
            let (done, rest) = qr.packed.as_mut_slice().split_at_mut((step + 1) * rows);
            let vector = &mut done[step * rows + step..];
            let factor = reflection(vector);
            qr.factors[step] = factor;
            for (column, square) in rest
                .chunks_exact_mut(rows)
                .zip(&mut squares.as_mut_slice()[step + 1..])
            {
                reflect(&vector[1..], factor, &mut column[step..]);
                // Taken anew: updated ones lose their digits where ranks end.
                *square = dot(&column[step + 1..], &column[step + 1..]);
            }
            qr.rank += 1;
        }
        qr
    }

    /// The dimension of the columns.
    pub fn rows(&self) -> R {
        self.packed.shape_generic().0
    }

    /// How many columns the others depend on.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Which column of the matrix is in place k.
    pub fn order(&self) -> &OVector<usize, C> {
        &self.order
    }

    /// R: its entry in a row below the rank.
    pub fn triangle(&self, row: usize, column: usize) -> f64 {
        if row <= column {
            self.packed[(row, column)]
        } else {
            0.0
        }
    }

    /// `b <- Q^T b`.
    pub fn apply_transposed<K: Dim>(&self, b: &mut OMatrix<f64, R, K>)
    where
        DefaultAllocator: Allocator<R, K>,
    {
        (0..self.rank).for_each(|step| self.reflect_all(step, b));
    }

    /// `b <- Q b`.
    pub fn apply<K: Dim>(&self, b: &mut OMatrix<f64, R, K>)
    where
        DefaultAllocator: Allocator<R, K>,
    {
        (0..self.rank)
            .rev()
            .for_each(|step| self.reflect_all(step, b));
    }

    fn reflect_all<K: Dim>(&self, step: usize, b: &mut OMatrix<f64, R, K>)
    where
        DefaultAllocator: Allocator<R, K>,
    {
        let rows = self.packed.nrows();
        let tail = &self.packed.as_slice()[step * rows + step + 1..(step + 1) * rows];
        for column in b.as_mut_slice().chunks_exact_mut(rows) {
            reflect(tail, self.factors[step], &mut column[step..]);
        }
    }
}

/// Turns a column into the vector of the reflection that takes it to a multiple of the first axis,
/// scaled to lead with 1, but leaves that multiple in the lead's place; returns its factor.
fn reflection(column: &mut [f64]) -> f64 {
    let (length, lead) = (dot(column, column).sqrt(), column[0]);
    let image = -length.copysign(lead);
    let scale = 1.0 / (lead - image);
    column[1..].iter_mut().for_each(|x| *x *= scale);
    column[0] = image;
    (image - lead) / image
}

/// `x <- x - factor v (v^T x)` with v = (1, tail).
fn reflect(tail: &[f64], factor: f64, x: &mut [f64]) {
    let (lead, rest) = (x[0], &mut x[1..]);
    let along = factor * (lead + dot(tail, rest));
    for (x, v) in rest.iter_mut().zip(tail) {
        *x -= along * v;
    }
    x[0] = lead - along;
}
