//! Least squares whose unknowns meet only near ones: banded normal equations.

use super::banded::BandedMatrix;
use super::cholesky::BandedCholesky;

/// Number of right-hand sides.
const CHANNELS: usize = 4;

/// Symmetric banded normal equations with four right-hand sides.
pub struct BandedSystem {
    normal: BandedMatrix,
    right: Vec<[f64; CHANNELS]>,
}

impl BandedSystem {
    /// A system of `size` unknowns; entries further than `half_bandwidth` from the diagonal are zero.
    pub fn new(size: usize, half_bandwidth: usize) -> Self {
        Self {
            normal: BandedMatrix::zeros(size, half_bandwidth),
            right: vec![[0.0; CHANNELS]; size],
        }
    }

    /// Adds the squared weighted sum of some unknowns, minus `value` for each right-hand side.
    pub fn add_square(&mut self, terms: &[(usize, f64)], value: [f64; CHANNELS], weight: f64) {
        for (k, &(a, wa)) in terms.iter().enumerate() {
            for &(b, wb) in &terms[..=k] {
                self.normal.add(a.max(b), a.min(b), weight * wa * wb);
            }
            for (sum, channel) in self.right[a].iter_mut().zip(value) {
                *sum += weight * wa * channel;
            }
        }
    }

    /// The unknowns per right-hand side; `None` if the matrix is not positive definite.
    pub fn solve(mut self) -> Option<Vec<[f64; CHANNELS]>> {
        let factor = BandedCholesky::of_banded(&self.normal, 1.0)?;
        let columns = self.right.as_flattened_mut();
        factor.solve_lower(columns, &[0; CHANNELS]);
        factor.solve_upper(columns, CHANNELS);
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
