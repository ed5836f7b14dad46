//! Products of vectors in slices, and of matrices that lie in slices with any strides.
//!
//! `nalgebra` hands a product to its fast kernels (chosen at run time by what the processor can
//! do) only if no side is short; the loops that it falls back to read out of bounds when the
//! columns of a factor are not contiguous (version 0.35). So short ones are done here.

use nalgebra::{DMatrixView, DMatrixViewMut, Dyn};

/// A matrix in a slice.
pub type View<'a> = DMatrixView<'a, f64, Dyn, Dyn>;
/// A matrix in a mutable slice.
pub type ViewMut<'a> = DMatrixViewMut<'a, f64, Dyn, Dyn>;

/// Sides up to this length are short.
const SHORT: usize = 5;

/// `c <- alpha a b + beta c`; with `beta` 0, c is not read.
pub fn multiply(c: &mut ViewMut, alpha: f64, a: &View, b: &View, beta: f64) {
    let (rows, columns, inner) = (a.nrows(), b.ncols(), a.ncols());
    if rows.min(columns).min(inner) > SHORT {
        c.gemm(alpha, a, b, beta);
        return;
    }
    for column in 0..columns {
        for row in 0..rows {
            let sum: f64 = (0..inner).map(|k| a[(row, k)] * b[(k, column)]).sum();
            let entry = &mut c[(row, column)];
            let kept = if beta == 0.0 { 0.0 } else { beta * *entry };
            *entry = kept + alpha * sum;
        }
    }
}

/// A matrix whose rows follow each other in a slice, `stride` apart.
pub fn row_major(data: &[f64], rows: usize, columns: usize, stride: usize) -> View<'_> {
    View::from_slice_with_strides(data, rows, columns, stride, 1)
}

/// A matrix whose columns follow each other in a slice, `stride` apart.
pub fn column_major(data: &[f64], rows: usize, columns: usize, stride: usize) -> View<'_> {
    View::from_slice_with_strides(data, rows, columns, 1, stride)
}

/// [`row_major`], to be written.
pub fn row_major_mut(data: &mut [f64], rows: usize, columns: usize, stride: usize) -> ViewMut<'_> {
    ViewMut::from_slice_with_strides_mut(data, rows, columns, stride, 1)
}

/// [`column_major`], to be written.
pub fn column_major_mut(
    data: &mut [f64],
    rows: usize,
    columns: usize,
    stride: usize,
) -> ViewMut<'_> {
    ViewMut::from_slice_with_strides_mut(data, rows, columns, 1, stride)
}

/// Dot product in eight lanes: a fixed order of additions that vectorizes.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a8
        .remainder()
        .iter()
        .zip(b8.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            lanes[k] += x[k] * y[k];
        }
    }
    lanes.iter().sum::<f64>() + tail
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn short_and_long_sides_give_the_plain_product() {
        for (rows, inner, columns) in [(1, 1, 1), (7, 9, 1), (3, 20, 30), (20, 4, 9), (40, 50, 60)]
        {
            let fill = |count: usize, phase: f64| -> Vec<f64> {
                (0..count).map(|k| (k as f64 + phase).sin()).collect()
            };
            // Three places more than needed between rows or columns.
            let (a, b) = (
                fill(rows * (inner + 3), 0.1),
                fill(columns * (inner + 3), 0.2),
            );
            let mut c = fill(rows * (columns + 3), 0.3);
            let before = c.clone();
            let (a, b) = (
                row_major(&a, rows, inner, inner + 3),
                column_major(&b, inner, columns, inner + 3),
            );
            multiply(
                &mut row_major_mut(&mut c, rows, columns, columns + 3),
                -2.0,
                &a,
                &b,
                0.5,
            );
            let product = DMatrix::from_fn(rows, columns, |r, c| {
                (0..inner).map(|k| a[(r, k)] * b[(k, c)]).sum::<f64>()
            });
            for (at, value) in c.iter().enumerate() {
                let (row, column) = (at / (columns + 3), at % (columns + 3));
                let expected = if column < columns {
                    0.5 * before[at] - 2.0 * product[(row, column)]
                } else {
                    before[at]
                };
                assert!((value - expected).abs() < 1e-12);
            }
        }
    }
}
