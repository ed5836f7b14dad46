//! Least squares whose unknowns meet only near ones: banded normal equations.

use super::product::dot;

/// Symmetric banded normal equations with four right-hand sides.
pub struct BandedSystem {
    half_bandwidth: usize,
    /// Row k holds the entries of columns `k - half_bandwidth ..= k`.
    lower: Vec<f64>,
    right: Vec<[f64; 4]>,
}

impl BandedSystem {
    /// A system of `size` unknowns; entries further than `half_bandwidth` from the diagonal are zero.
    pub fn new(size: usize, half_bandwidth: usize) -> Self {
        Self {
            half_bandwidth,
            lower: vec![0.0; size * (half_bandwidth + 1)],
            right: vec![[0.0; 4]; size],
        }
    }

    /// Adds to the entry (row, column), or to its mirror image.
    fn add(&mut self, a: usize, b: usize, value: f64) {
        let (row, column) = (a.max(b), a.min(b));
        let width = self.half_bandwidth + 1;
        self.lower[row * width + self.half_bandwidth - (row - column)] += value;
    }

    /// Adds the squared weighted sum of some unknowns, minus `value` for each right-hand side.
    pub fn add_square(&mut self, terms: &[(usize, f64)], value: [f64; 4], weight: f64) {
        for (k, &(a, wa)) in terms.iter().enumerate() {
            for &(b, wb) in &terms[..=k] {
                self.add(a, b, weight * wa * wb);
            }
            for (sum, channel) in self.right[a].iter_mut().zip(value) {
                *sum += weight * wa * channel;
            }
        }
    }

    /// Cholesky factorization and both substitutions; `None` if the matrix is not positive
    /// definite.
    pub fn solve(mut self) -> Option<Vec<[f64; 4]>> {
        let (p, width) = (self.half_bandwidth, self.half_bandwidth + 1);
        for row in 0..self.right.len() {
            let first = row.saturating_sub(p);
            let (above, this) = self.lower.split_at_mut(row * width);
            for column in first..row {
                let other = &above[column * width..(column + 1) * width];
                // Entries of both rows in the columns first .. column.
                let count = column - first;
                let start_this = p - (row - first);
                let start_other = p - count;
                let sum: f64 = dot(
                    &this[start_this..start_this + count],
                    &other[start_other..start_other + count],
                );
                let place = p - (row - column);
                this[place] = (this[place] - sum) / other[p];
            }
            let start = p - (row - first);
            let pivot = this[p] - dot(&this[start..p], &this[start..p]);
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            this[p] = pivot.sqrt();
        }
        for row in 0..self.right.len() {
            let entries = &self.lower[row * width..(row + 1) * width];
            for column in row.saturating_sub(p)..row {
                let factor = entries[p - (row - column)];
                for channel in 0..4 {
                    self.right[row][channel] -= factor * self.right[column][channel];
                }
            }
            self.right[row].iter_mut().for_each(|x| *x /= entries[p]);
        }
        for row in (0..self.right.len()).rev() {
            let entries = &self.lower[row * width..(row + 1) * width];
            self.right[row].iter_mut().for_each(|x| *x /= entries[p]);
            for column in row.saturating_sub(p)..row {
                let factor = entries[p - (row - column)];
                for channel in 0..4 {
                    self.right[column][channel] -= factor * self.right[row][channel];
                }
            }
        }
        Some(self.right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_of_differences_is_summed_up() {
        // x0 = 1 and x[k + 1] - x[k] = k for 20 unknowns: x[k] = 1 + k (k - 1) / 2.
        let mut system = BandedSystem::new(20, 3);
        system.add_square(&[(0, 1.0)], [1.0, 2.0, 0.0, -1.0], 5.0);
        for k in 0..19 {
            let step = k as f64;
            system.add_square(&[(k, -1.0), (k + 1, 1.0)], [step, 0.0, 0.0, -step], 1.0);
        }
        for (k, x) in system.solve().unwrap().into_iter().enumerate() {
            let sum = (k * k.saturating_sub(1) / 2) as f64;
            for (x, expected) in x.into_iter().zip([1.0 + sum, 2.0, 0.0, -1.0 - sum]) {
                // The condition number is that of 20 steps: some 400.
                assert!((x - expected).abs() < 1e-11, "{k}: {x} {expected}");
            }
        }
    }

    #[test]
    fn an_unknown_that_nothing_holds_has_no_solution() {
        let mut system = BandedSystem::new(3, 1);
        system.add_square(&[(0, 1.0)], [1.0; 4], 1.0);
        assert!(system.solve().is_none());
    }
}
