//! Cholesky factorization of a banded matrix by blocks, and triangular solves with it.
//!
//! Everything of size is a product of dense blocks: row i of the band starts one place further
//! right than row i - 1, so a rectangle inside the band is a matrix with a constant stride and goes
//! to the general product as it lies. The inverses of the diagonal blocks are kept, so that a
//! substitution is made of products too. A dense matrix is one whose band is everything.

use super::banded::BandedMatrix;
use super::product::{
    View, column_major, column_major_mut, dot, multiply, row_major, row_major_mut,
};
use nalgebra::{DMatrix, DVector};

/// Rows of a block: wide enough for products to run at speed, small against a usual band (250).
const BLOCK: usize = 48;
/// Columns of a block of a product that is computed by its lower triangle only.
const TRIANGLE_BLOCK: usize = 64;

/// The lower factor L of a positive definite matrix `L L^T`.
#[derive(Debug, Clone)]
pub struct BandedCholesky {
    size: usize,
    half_bandwidth: usize,
    /// Stored diagonals below the main one: the band and a block of zeros.
    reach: usize,
    /// Row i holds columns `i - reach ..= i`.
    rows: Vec<f64>,
    /// The inverse of each diagonal block, row-major, rows of [`BLOCK`] places.
    inverses: Vec<f64>,
}

impl BandedCholesky {
    /// Factorizes a banded matrix whose diagonal is multiplied by `diagonal_factor` first; `None`
    /// if it is not positive definite.
    ///
    /// Cost: `size * half_bandwidth^2 / 2` multiplications.
    pub fn of_banded(matrix: &BandedMatrix, diagonal_factor: f64) -> Option<Self> {
        let half_bandwidth = matrix.half_bandwidth();
        Self::factorize(matrix.size(), half_bandwidth, |row, target| {
            target.copy_from_slice(matrix.row(row));
            target[half_bandwidth] *= diagonal_factor;
        })
    }

    /// Factorizes a dense matrix given by its lower triangle; `None` if it is not positive
    /// definite.
    pub fn of_dense(matrix: &DMatrix<f64>) -> Option<Self> {
        let half_bandwidth = matrix.nrows().saturating_sub(1);
        Self::factorize(matrix.nrows(), half_bandwidth, |row, target| {
            for column in 0..=row {
                target[half_bandwidth - row + column] = matrix[(row, column)];
            }
        })
    }

    /// `fill` writes the places `row - half_bandwidth ..= row` of a row.
    fn factorize(
        size: usize,
        half_bandwidth: usize,
        fill: impl Fn(usize, &mut [f64]),
    ) -> Option<Self> {
        let reach = half_bandwidth + BLOCK;
        let mut factor = Self {
            size,
            half_bandwidth,
            reach,
            rows: vec![0.0; size * (reach + 1)],
            inverses: vec![0.0; size * BLOCK],
        };
        for (row, target) in factor.rows.chunks_exact_mut(reach + 1).enumerate() {
            fill(row, &mut target[BLOCK..]);
        }
        let mut panel = vec![0.0; half_bandwidth * BLOCK];
        for start in (0..size).step_by(BLOCK) {
            factor.factorize_diagonal_block(start)?;
            factor.eliminate_block(start, &mut panel);
        }
        Some(factor)
    }

    fn block_len(&self, start: usize) -> usize {
        BLOCK.min(self.size - start)
    }

    /// Place of (row, column) in `rows`.
    fn at(&self, row: usize, column: usize) -> usize {
        row * self.reach + column + self.reach
    }

    /// A rectangle that lies within the stored diagonals.
    fn view(&self, row: usize, column: usize, rows: usize, columns: usize) -> View<'_> {
        row_major(
            &self.rows[self.at(row, column)..],
            rows,
            columns,
            self.reach,
        )
    }

    /// The transpose of [`Self::view`].
    fn transposed(&self, row: usize, column: usize, rows: usize, columns: usize) -> View<'_> {
        column_major(
            &self.rows[self.at(row, column)..],
            columns,
            rows,
            self.reach,
        )
    }

    /// The inverse of the diagonal block that starts at a row.
    fn inverse(&self, start: usize) -> View<'_> {
        let len = self.block_len(start);
        row_major(&self.inverses[start * BLOCK..], len, len, BLOCK)
    }

    /// The transpose of [`Self::inverse`].
    fn inverse_transposed(&self, start: usize) -> View<'_> {
        let len = self.block_len(start);
        column_major(&self.inverses[start * BLOCK..], len, len, BLOCK)
    }

    /// Factorizes a diagonal block from which all blocks left of it have been taken, and inverts
    /// its factor.
    fn factorize_diagonal_block(&mut self, start: usize) -> Option<()> {
        let len = self.block_len(start);
        let mut lower = vec![[0.0; BLOCK]; BLOCK];
        for row in 0..len {
            let at = self.at(start + row, start);
            lower[row][..=row].copy_from_slice(&self.rows[at..=at + row]);
        }
        for row in 0..len {
            let (above, rest) = lower.split_at_mut(row);
            let current = &mut rest[0];
            for (column, other) in above.iter().enumerate() {
                let sum = dot(&current[..column], &other[..column]);
                current[column] = (current[column] - sum) / other[column];
            }
            let pivot = current[row] - dot(&current[..row], &current[..row]);
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            current[row] = pivot.sqrt();
        }
        for row in 0..len {
            let at = self.at(start + row, start);
            self.rows[at..=at + row].copy_from_slice(&lower[row][..=row]);
        }
        // Row by row: W[r] = (unit[r] - sum_c L[r, c] W[c]) / L[r, r].
        let inverse = &mut self.inverses[start * BLOCK..];
        for row in 0..len {
            let (above, rest) = inverse.split_at_mut(row * BLOCK);
            let current = &mut rest[..len];
            for (factor, other) in lower[row][..row].iter().zip(above.chunks_exact(BLOCK)) {
                for (entry, other) in current[..row].iter_mut().zip(other) {
                    *entry -= factor * other;
                }
            }
            let scale = 1.0 / lower[row][row];
            for entry in &mut current[..row] {
                *entry *= scale;
            }
            current[row] = scale;
        }
        Some(())
    }

    /// Replaces what stands below a factorized diagonal block by the factor, and takes its share
    /// off everything to the right of it. `panel` is working memory.
    fn eliminate_block(&mut self, start: usize, panel: &mut [f64]) {
        let len = self.block_len(start);
        let below = start + len;
        let count = self.half_bandwidth.min(self.size - below);
        if count == 0 {
            return;
        }
        multiply(
            &mut column_major_mut(panel, count, len, count),
            1.0,
            &self.view(below, start, count, len),
            &self.inverse_transposed(start),
            0.0,
        );
        for row in 0..count {
            let at = self.at(below + row, start);
            for (k, entry) in self.rows[at..at + len].iter_mut().enumerate() {
                *entry = panel[k * count + row];
            }
        }
        let mut square = vec![0.0; TRIANGLE_BLOCK * TRIANGLE_BLOCK];
        for first in (0..count).step_by(TRIANGLE_BLOCK) {
            let width = TRIANGLE_BLOCK.min(count - first);
            let columns = row_major(&panel[first..], len, width, count);
            multiply(
                &mut row_major_mut(&mut square, width, width, width),
                1.0,
                &column_major(&panel[first..], width, len, count),
                &columns,
                0.0,
            );
            for (row, square) in square.chunks_exact(width).take(width).enumerate() {
                let at = self.at(below + first + row, below + first);
                for (entry, share) in self.rows[at..=at + row].iter_mut().zip(square) {
                    *entry -= share;
                }
            }
            let next = first + width;
            if next < count {
                let at = self.at(below + next, below + first);
                multiply(
                    &mut row_major_mut(&mut self.rows[at..], count - next, width, self.reach),
                    -1.0,
                    &column_major(&panel[next..], count - next, len, count),
                    &columns,
                    1.0,
                );
            }
        }
    }

    /// Natural logarithm of the determinant of the factorized matrix.
    pub fn ln_determinant(&self) -> f64 {
        2.0 * (0..self.size)
            .map(|k| self.rows[self.at(k, k)].ln())
            .sum::<f64>()
    }

    /// Replaces a row-major matrix by `L^-1` times it. `begins` has per column the number of
    /// leading rows that are zero, in rising order: they cost nothing.
    pub fn solve_lower(&self, matrix: &mut [f64], begins: &[usize]) {
        let columns = begins.len();
        let mut solved = vec![0.0; BLOCK * columns];
        for start in (0..self.size).step_by(BLOCK) {
            let len = self.block_len(start);
            let (above, rest) = matrix.split_at_mut(start * columns);
            let first = start.saturating_sub(self.half_bandwidth);
            let active = begins.partition_point(|begin| *begin < start);
            if first < start && active > 0 {
                multiply(
                    &mut row_major_mut(rest, len, active, columns),
                    -1.0,
                    &self.view(start, first, len, start - first),
                    &row_major(&above[first * columns..], start - first, active, columns),
                    1.0,
                );
            }
            let active = begins.partition_point(|begin| *begin < start + len);
            apply_inverse(&self.inverse(start), rest, columns, active, &mut solved);
        }
    }

    /// Replaces a row-major matrix by `L^-T` times it.
    pub fn solve_upper(&self, matrix: &mut [f64], columns: usize) {
        let mut solved = vec![0.0; BLOCK * columns];
        for start in (0..self.size).step_by(BLOCK).rev() {
            let len = self.block_len(start);
            let (above, rest) = matrix.split_at_mut(start * columns);
            let inverse = self.inverse_transposed(start);
            apply_inverse(&inverse, rest, columns, columns, &mut solved);
            let first = start.saturating_sub(self.half_bandwidth);
            if first < start {
                multiply(
                    &mut row_major_mut(
                        &mut above[first * columns..],
                        start - first,
                        columns,
                        columns,
                    ),
                    -1.0,
                    &self.transposed(start, first, len, start - first),
                    &row_major(rest, len, columns, columns),
                    1.0,
                );
            }
        }
    }

    /// A row of the factor up to the diagonal, and the column where it begins.
    fn row(&self, row: usize) -> (usize, &[f64]) {
        let first = row.saturating_sub(self.half_bandwidth);
        (first, &self.rows[self.at(row, first)..=self.at(row, row)])
    }

    /// Solves `L^T x = b` in place.
    pub fn solve_upper_vector(&self, x: &mut DVector<f64>) {
        for row in (0..self.size).rev() {
            let (first, entries) = self.row(row);
            let value = x[row] / entries[row - first];
            x[row] = value;
            let above = &mut x.as_mut_slice()[first..row];
            for (x, entry) in above.iter_mut().zip(entries) {
                *x -= entry * value;
            }
        }
    }

    /// Solves `L x = b` in place.
    pub fn solve_lower_vector(&self, x: &mut DVector<f64>) {
        for row in 0..self.size {
            let (first, entries) = self.row(row);
            let sum = dot(&entries[..row - first], &x.as_slice()[first..row]);
            x[row] = (x[row] - sum) / entries[row - first];
        }
    }

    /// Solves `L L^T x = b` in place.
    pub fn solve_vector(&self, x: &mut DVector<f64>) {
        self.solve_lower_vector(x);
        self.solve_upper_vector(x);
    }
}

/// Replaces the first columns of the first rows by `inverse` times them.
fn apply_inverse(
    inverse: &View,
    rows: &mut [f64],
    columns: usize,
    active: usize,
    solved: &mut [f64],
) {
    if active == 0 {
        return;
    }
    let len = inverse.nrows();
    multiply(
        &mut row_major_mut(solved, len, active, active),
        1.0,
        inverse,
        &row_major(rows, len, active, columns),
        0.0,
    );
    for (row, solved) in rows
        .chunks_exact_mut(columns)
        .zip(solved.chunks_exact(active))
        .take(len)
    {
        row[..active].copy_from_slice(solved);
    }
}

/// `M^T M` of a row-major matrix, lower triangle (the rest is not meaningful); `begins` as in
/// [`BandedCholesky::solve_lower`].
pub fn gram(matrix: &[f64], begins: &[usize]) -> DMatrix<f64> {
    let columns = begins.len();
    let rows = matrix.len() / columns.max(1);
    let mut product = DMatrix::zeros(columns, columns);
    for first in (0..columns).step_by(TRIANGLE_BLOCK) {
        let width = TRIANGLE_BLOCK.min(columns - first);
        let begin = begins[first].min(rows);
        if begin == rows {
            break;
        }
        let below = &matrix[begin * columns..];
        multiply(
            &mut column_major_mut(
                &mut product.as_mut_slice()[first..],
                width,
                first + width,
                columns,
            ),
            1.0,
            &column_major(&below[first..], width, rows - begin, columns),
            &row_major(below, rows - begin, first + width, columns),
            0.0,
        );
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A positive definite banded matrix of more than two blocks, and the same one dense.
    fn example(half_bandwidth: usize) -> (BandedMatrix, DMatrix<f64>) {
        let size = 2 * BLOCK + 37;
        let mut banded = BandedMatrix::zeros(size, half_bandwidth);
        let mut dense = DMatrix::zeros(size, size);
        for row in 0..size {
            for column in row.saturating_sub(half_bandwidth)..=row {
                let value = if row == column {
                    2.0 * half_bandwidth as f64 + 3.0 + (row as f64).sin()
                } else {
                    ((row * 7 + column * 3) as f64).cos()
                };
                banded.add(row, column, value);
                dense[(row, column)] = value;
                dense[(column, row)] = value;
            }
        }
        (banded, dense)
    }

    /// Bands narrower than a block, wider than one, and everything.
    const HALF_BANDWIDTHS: [usize; 4] = [0, 11, BLOCK + 9, 2 * BLOCK + 36];

    #[test]
    fn solves_agree_with_the_dense_matrix() {
        for half_bandwidth in HALF_BANDWIDTHS {
            let (banded, dense) = example(half_bandwidth);
            let right = DVector::from_fn(banded.size(), |k, _| (k as f64 * 0.7).sin());
            assert!((banded.times(&right) - &dense * &right).norm() < 1e-10);
            let expected = dense.clone().cholesky().unwrap();
            let ln_det: f64 = 2.0 * expected.l().diagonal().map(f64::ln).sum();
            for cholesky in [
                BandedCholesky::of_banded(&banded, 1.0).unwrap(),
                BandedCholesky::of_dense(&dense).unwrap(),
            ] {
                assert!((cholesky.ln_determinant() - ln_det).abs() < 1e-9);
                let mut x = right.clone();
                cholesky.solve_vector(&mut x);
                assert!((x - expected.solve(&right)).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn a_diagonal_factor_damps() {
        let (banded, mut dense) = example(11);
        for k in 0..dense.nrows() {
            dense[(k, k)] *= 1.5;
        }
        let damped = BandedCholesky::of_banded(&banded, 1.5).unwrap();
        let expected = BandedCholesky::of_dense(&dense).unwrap();
        assert!((damped.ln_determinant() - expected.ln_determinant()).abs() < 1e-9);
    }

    #[test]
    fn many_right_sides_are_solved_as_one() {
        for half_bandwidth in HALF_BANDWIDTHS {
            let (banded, _) = example(half_bandwidth);
            let cholesky = BandedCholesky::of_banded(&banded, 1.0).unwrap();
            // Leading zero rows, as pose columns have, over more than one block.
            let columns = 90;
            let begins: Vec<usize> = (0..columns).map(|column| column * 3 / 2).collect();
            let entry = |row: usize, column: usize| {
                if row < begins[column] {
                    0.0
                } else {
                    ((row * 5 + column) as f64).sin()
                }
            };
            let mut matrix: Vec<f64> = (0..banded.size() * columns)
                .map(|at| entry(at / columns, at % columns))
                .collect();
            cholesky.solve_lower(&mut matrix, &begins);
            let dense = DMatrix::from_row_slice(banded.size(), columns, &matrix);
            for column in 0..columns {
                let mut single = DVector::from_fn(banded.size(), |row, _| entry(row, column));
                cholesky.solve_lower_vector(&mut single);
                assert!((dense.column(column) - single).norm() < 1e-12);
            }
            let expected = dense.transpose() * &dense;
            let product = gram(&matrix, &begins);
            for row in 0..columns {
                for column in 0..=row {
                    assert!((product[(row, column)] - expected[(row, column)]).abs() < 1e-11);
                }
            }
            let mut upper = matrix.clone();
            cholesky.solve_upper(&mut upper, columns);
            for column in 0..columns {
                let mut single = dense.column(column).into_owned();
                cholesky.solve_upper_vector(&mut single);
                for row in 0..banded.size() {
                    assert!((upper[row * columns + column] - single[row]).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        let mut matrix = BandedMatrix::zeros(2, 1);
        matrix.add(0, 0, 1.0);
        matrix.add(1, 0, 2.0);
        matrix.add(1, 1, 1.0);
        assert!(BandedCholesky::of_banded(&matrix, 1.0).is_none());
    }
}
