//! A symmetric banded matrix; its factorization is in [`super::cholesky`].

use nalgebra::DVector;

/// A symmetric banded matrix: the lower triangle, row by row.
#[derive(Debug, Clone)]
pub struct BandedMatrix {
    size: usize,
    half_bandwidth: usize,
    /// Row i holds columns `i - half_bandwidth ..= i`, the diagonal last.
    rows: Vec<f64>,
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

    /// Number of diagonals below the main one.
    pub fn half_bandwidth(&self) -> usize {
        self.half_bandwidth
    }

    /// The entries of a row in the columns `row - half_bandwidth ..= row`; those left of the matrix
    /// are zero.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.rows[row * (self.half_bandwidth + 1)..][..=self.half_bandwidth]
    }

    /// Adds to the entries of a row from `column` on: contiguous [`Self::add`].
    pub fn row_from_mut(&mut self, row: usize, column: usize) -> &mut [f64] {
        let at = self.at(row, column);
        &mut self.rows[at..=row * (self.half_bandwidth + 1) + self.half_bandwidth]
    }

    /// Adds `scale` times a matrix of the same size whose band is not wider.
    pub fn add_scaled(&mut self, scale: f64, other: &Self) {
        let shift = self.half_bandwidth - other.half_bandwidth;
        let (width, other_width) = (self.half_bandwidth + 1, other.half_bandwidth + 1);
        for (row, other) in self
            .rows
            .chunks_exact_mut(width)
            .zip(other.rows.chunks_exact(other_width))
        {
            for (a, b) in row[shift..].iter_mut().zip(other) {
                *a += scale * b;
            }
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
}
