//! Cholesky factorization of a symmetric banded matrix, and triangular solves with it.

use nalgebra::DVector;

/// Columns of a right-hand side that are solved together: their part of the band stays in cache.
const PANEL: usize = 32;

/// A symmetric banded matrix: the lower triangle, row by row.
#[derive(Debug, Clone)]
pub struct BandedMatrix {
    size: usize,
    half_bandwidth: usize,
    /// Row i holds columns `i - half_bandwidth ..= i`, the diagonal last.
    rows: Vec<f64>,
}

/// The lower factor of a positive definite [`BandedMatrix`].
#[derive(Debug, Clone)]
pub struct BandedCholesky {
    factor: BandedMatrix,
}

impl BandedMatrix {
    /// The zero matrix; entries further than `half_bandwidth` from the diagonal are zero for good.
    pub fn zeros(size: usize, half_bandwidth: usize) -> Self {
        Self {
            size,
            half_bandwidth,
            rows: vec![0.0; size * (half_bandwidth + 1)],
        }
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.size
    }

    fn at(&self, row: usize, column: usize) -> usize {
        row * (self.half_bandwidth + 1) + self.half_bandwidth + column - row
    }

    /// Adds to the entry at (row, column) of the lower triangle: `row - half_bandwidth <= column
    /// <= row`.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        let at = self.at(row, column);
        self.rows[at] += value;
    }

    /// The entry at (row, column) of the lower triangle within the band.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.rows[self.at(row, column)]
    }

    /// Adds `scale` times a matrix of the same shape.
    pub fn add_scaled(&mut self, scale: f64, other: &Self) {
        for (a, b) in self.rows.iter_mut().zip(&other.rows) {
            *a += scale * b;
        }
    }

    /// Multiplies the diagonal.
    pub fn scale_diagonal(&mut self, factor: f64) {
        for row in 0..self.size {
            let at = self.at(row, row);
            self.rows[at] *= factor;
        }
    }

    /// The product with a vector.
    pub fn times(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut product = DVector::zeros(self.size);
        for row in 0..self.size {
            let first = row.saturating_sub(self.half_bandwidth);
            let entries = &self.rows[self.at(row, first)..=self.at(row, row)];
            let (diagonal, below) = (entries[row - first], &entries[..row - first]);
            let mut sum = diagonal * x[row];
            for (k, entry) in below.iter().enumerate() {
                sum += entry * x[first + k];
                product[first + k] += entry * x[row];
            }
            product[row] += sum;
        }
        product
    }

    /// Lower factor L with `L L^T = self`; `None` if the matrix is not positive definite.
    ///
    /// Cost: `size * half_bandwidth^2 / 2` multiplications.
    pub fn cholesky(mut self) -> Option<BandedCholesky> {
        let width = self.half_bandwidth + 1;
        for row in 0..self.size {
            let first = row.saturating_sub(self.half_bandwidth);
            let (above, rest) = self.rows.split_at_mut(row * width);
            let current = &mut rest[..width];
            for column in first..row {
                let column_first = column.saturating_sub(self.half_bandwidth).max(first);
                let shift_row = self.half_bandwidth + column_first - row;
                let shift_column = column * width + self.half_bandwidth + column_first - column;
                let count = column - column_first;
                let dot = dot(
                    &current[shift_row..shift_row + count],
                    &above[shift_column..shift_column + count],
                );
                let diagonal = above[column * width + self.half_bandwidth];
                let at = self.half_bandwidth + column - row;
                current[at] = (current[at] - dot) / diagonal;
            }
            let shift = self.half_bandwidth + first - row;
            let below = &current[shift..self.half_bandwidth];
            let pivot = current[self.half_bandwidth] - dot(below, below);
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            current[self.half_bandwidth] = pivot.sqrt();
        }
        Some(BandedCholesky { factor: self })
    }
}

/// Dot product in eight lanes: a fixed order of additions that vectorizes.
fn dot(a: &[f64], b: &[f64]) -> f64 {
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

impl BandedCholesky {
    /// Natural logarithm of the determinant of the factorized matrix.
    pub fn ln_determinant(&self) -> f64 {
        let f = &self.factor;
        2.0 * (0..f.size).map(|k| f.get(k, k).ln()).sum::<f64>()
    }

    /// Replaces the rows of a row-major matrix of `columns` columns by those of `L^-1` times it.
    pub fn solve_lower(&self, matrix: &mut [f64], columns: usize) {
        let f = &self.factor;
        let mut panel = vec![0.0; f.size * PANEL];
        for start in (0..columns).step_by(PANEL) {
            let count = PANEL.min(columns - start);
            for row in 0..f.size {
                let source = &matrix[row * columns + start..][..count];
                panel[row * PANEL..][..count].copy_from_slice(source);
                panel[row * PANEL + count..(row + 1) * PANEL].fill(0.0);
            }
            self.solve_lower_panel(&mut panel);
            for row in 0..f.size {
                matrix[row * columns + start..][..count]
                    .copy_from_slice(&panel[row * PANEL..][..count]);
            }
        }
    }

    fn solve_lower_panel(&self, panel: &mut [f64]) {
        let f = &self.factor;
        // Rows before the first one that is not zero stay zero.
        let Some(begin) = panel.iter().position(|x| *x != 0.0).map(|at| at / PANEL) else {
            return;
        };
        for row in begin..f.size {
            let first = row.saturating_sub(f.half_bandwidth).max(begin);
            let entries = &f.rows[f.at(row, first)..=f.at(row, row)];
            let (solved, current) = panel.split_at_mut(row * PANEL);
            let mut sum = [0.0; PANEL];
            for (entry, other) in entries[..row - first]
                .iter()
                .zip(solved[first * PANEL..].chunks_exact(PANEL))
            {
                for k in 0..PANEL {
                    sum[k] += entry * other[k];
                }
            }
            let inverse = 1.0 / entries[row - first];
            for k in 0..PANEL {
                current[k] = (current[k] - sum[k]) * inverse;
            }
        }
    }

    /// Solves `L^T x = b` in place.
    pub fn solve_upper_vector(&self, x: &mut DVector<f64>) {
        let f = &self.factor;
        for row in (0..f.size).rev() {
            let first = row.saturating_sub(f.half_bandwidth);
            let entries = &f.rows[f.at(row, first)..=f.at(row, row)];
            let value = x[row] / entries[row - first];
            x[row] = value;
            for (k, entry) in entries[..row - first].iter().enumerate() {
                x[first + k] -= entry * value;
            }
        }
    }

    /// Solves `L x = b` in place.
    pub fn solve_lower_vector(&self, x: &mut DVector<f64>) {
        let f = &self.factor;
        for row in 0..f.size {
            let first = row.saturating_sub(f.half_bandwidth);
            let entries = &f.rows[f.at(row, first)..=f.at(row, row)];
            let sum = dot(&entries[..row - first], &x.as_slice()[first..row]);
            x[row] = (x[row] - sum) / entries[row - first];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// A positive definite banded matrix and the same one dense.
    fn example() -> (BandedMatrix, DMatrix<f64>) {
        let (size, half_bandwidth) = (60, 11);
        let mut banded = BandedMatrix::zeros(size, half_bandwidth);
        let mut dense = DMatrix::zeros(size, size);
        for row in 0..size {
            for column in row.saturating_sub(half_bandwidth)..=row {
                let value = if row == column {
                    20.0 + (row as f64).sin()
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

    #[test]
    fn solves_agree_with_the_dense_matrix() {
        let (banded, dense) = example();
        let right = DVector::from_fn(60, |k, _| (k as f64 * 0.7).sin());
        assert!((banded.times(&right) - &dense * &right).norm() < 1e-12);
        let expected = dense.clone().cholesky().unwrap();
        let cholesky = banded.cholesky().unwrap();
        let ln_det: f64 = 2.0 * expected.l().diagonal().map(f64::ln).sum();
        assert!((cholesky.ln_determinant() - ln_det).abs() < 1e-10);
        let mut x = right.clone();
        cholesky.solve_lower_vector(&mut x);
        cholesky.solve_upper_vector(&mut x);
        assert!((x - expected.solve(&right)).norm() < 1e-13);
    }

    #[test]
    fn many_right_sides_are_solved_as_one() {
        let (banded, _) = example();
        let cholesky = banded.cholesky().unwrap();
        let columns = 45;
        // Leading zero rows, as pose columns have.
        let entry = |row: usize, column: usize| {
            if row < column {
                0.0
            } else {
                ((row * 5 + column) as f64).sin()
            }
        };
        let mut matrix: Vec<f64> = (0..60 * columns)
            .map(|at| entry(at / columns, at % columns))
            .collect();
        cholesky.solve_lower(&mut matrix, columns);
        for column in 0..columns {
            let mut single = DVector::from_fn(60, |row, _| entry(row, column));
            cholesky.solve_lower_vector(&mut single);
            for row in 0..60 {
                assert!((matrix[row * columns + column] - single[row]).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        let mut matrix = BandedMatrix::zeros(2, 1);
        matrix.add(0, 0, 1.0);
        matrix.add(1, 0, 2.0);
        matrix.add(1, 1, 1.0);
        assert!(matrix.cholesky().is_none());
    }
}
