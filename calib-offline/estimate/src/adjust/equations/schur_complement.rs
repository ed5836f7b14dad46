//! The factorized normal equations, a Schur complement and what was eliminated before it: what the
//! data leave open, without the inverse.

use super::spline_block::EliminatedSpline;
use calib_rays::numerics::cholesky::BandedCholesky;
use nalgebra::{Cholesky, DVector};

/// The factorized equations.
#[derive(Debug, Clone)]
pub struct SchurComplement {
    /// Of the global parameters, and of the poses behind them if splines were eliminated.
    pub(super) border: BandedCholesky,
    pub(super) right: DVector<f64>,
    pub(super) global_len: usize,
    pub(super) eliminated: Eliminated,
}

#[derive(Debug, Clone)]
pub(super) enum Eliminated {
    Poses(Vec<Cholesky<f64, nalgebra::Const<6>>>),
    /// Per camera.
    Splines(Vec<Option<EliminatedSpline>>),
}

impl SchurComplement {
    /// Number of equations of poses behind those of the global parameters.
    pub(super) fn pose_columns(&self) -> usize {
        self.right.len() - self.global_len
    }

    /// Variances of the global parameters (everything else marginalized), if the weights are
    /// inverse variances and the damping was 0.
    pub fn marginal_variances(&self) -> DVector<f64> {
        // Of the inverse of L L^T: the squared lengths of the columns of L^-1.
        let (n, size) = (self.global_len, self.right.len());
        let mut units = vec![0.0; size * n];
        for k in 0..n {
            units[k * n + k] = 1.0;
        }
        self.border
            .solve_lower(&mut units, &(0..n).collect::<Vec<_>>());
        let mut variances = DVector::zeros(n);
        for row in units.chunks_exact(n.max(1)) {
            for (sum, x) in variances.iter_mut().zip(row) {
                *sum += x * x;
            }
        }
        variances
    }

    /// Natural logarithm of the determinant of the whole Hessian.
    pub fn ln_determinant(&self) -> f64 {
        let border = self.border.ln_determinant();
        let eliminated: f64 = match &self.eliminated {
            Eliminated::Poses(factors) => factors
                .iter()
                .map(|f| 2.0 * (0..6).map(|k| f.l_dirty()[(k, k)].ln()).sum::<f64>())
                .sum(),
            Eliminated::Splines(splines) => splines
                .iter()
                .flatten()
                .map(EliminatedSpline::ln_determinant)
                .sum(),
        };
        border + eliminated
    }

    /// `tr(matrix covariance)` over the knots of one camera's spline, by Hutchinson's estimator
    /// with the given probes (entries +1 and -1) and `matrix` times each. 0 without a spline.
    pub fn spline_trace(
        &self,
        camera_idx: usize,
        probes: &[DVector<f64>],
        weighted: &[DVector<f64>],
    ) -> f64 {
        let Eliminated::Splines(splines) = &self.eliminated else {
            return 0.0;
        };
        let Some(Some(spline)) = splines.get(camera_idx) else {
            return 0.0;
        };
        let count = probes.len();
        let mut columns = vec![0.0; probes.iter().map(DVector::len).sum()];
        for (k, probe) in probes.iter().enumerate() {
            for (row, value) in probe.iter().enumerate() {
                columns[row * count + k] = *value;
            }
        }
        let solved = spline.covariance_times(&columns, count, &self.border, self.right.len());
        let sum: f64 = weighted
            .iter()
            .enumerate()
            .map(|(k, weighted)| {
                let solved = solved.iter().skip(k).step_by(count);
                weighted.iter().zip(solved).map(|(a, b)| a * b).sum::<f64>()
            })
            .sum();
        sum / count as f64
    }
}
