//! The evidence for numbers that a model does not have yet, from their scores alone.
//!
//! With score s = B^T W r and information M = B^T W B, what else moves eliminated, and a prior N(0, t^2)
//! on each number (in its unit), the log likelihood of the number x is `s.x - x.M x / 2`, so that
//! integrating x out gives `2 ln K = s^T (M + t^-2)^-1 s - ln det(t^2 M + 1)`, the logarithm of a Bayes
//! factor in the scale of Kass and Raftery (1995). t is taken where it is largest.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Standard deviations tried, in units: half decades up to 100.
const LEAST_LOG10_SD: f64 = -4.0;
const STEPS: usize = 13;

/// What the data say of some numbers.
#[derive(Debug, Clone)]
pub struct Judged {
    /// Twice the log Bayes factor for having them.
    pub gain: f64,
    /// Their posterior mean, in units.
    pub mean: DVector<f64>,
    /// Of the inverse of their posterior covariance.
    factor: Cholesky<f64, Dyn>,
    /// Standard deviation of the prior, units.
    pub prior_sd: f64,
    /// `ln det(t^2 M + 1)`.
    pub occam: f64,
}

/// Judges numbers with scores and information in units, at which they already are `at`.
///
/// `None` if the information is none.
pub fn judge(
    score: &DVector<f64>,
    information: &DMatrix<f64>,
    at: &DVector<f64>,
) -> Option<Judged> {
    // About zero: the score there, if the likelihood is what it is here.
    let score = score + information * at;
    let sds = (0..STEPS).map(|step| 10f64.powf(LEAST_LOG10_SD + 0.5 * step as f64));
    sds.filter_map(|sd| at_prior(&score, information, sd))
        .filter(|judged| judged.gain.is_finite())
        .max_by(|a, b| a.gain.total_cmp(&b.gain))
}

/// With one standard deviation of the prior. Numbers that what else moves can stand for have no
/// information, to round-off, and a wide prior does not make up for that: `None`.
fn at_prior(score: &DVector<f64>, information: &DMatrix<f64>, prior_sd: f64) -> Option<Judged> {
    let mut matrix = information.clone();
    for k in 0..matrix.nrows() {
        matrix[(k, k)] += 1.0 / (prior_sd * prior_sd);
    }
    let factor: Cholesky<f64, Dyn> = matrix.cholesky()?;
    let mean = factor.solve(score);
    let diagonal = factor.l_dirty().diagonal();
    let occam: f64 = diagonal.iter().map(|x| 2.0 * (x * prior_sd).ln()).sum();
    Some(Judged {
        gain: score.dot(&mean) - occam,
        mean,
        factor,
        prior_sd,
        occam,
    })
}

impl Judged {
    /// Posterior standard deviations of the numbers, in units.
    pub fn sd(&self) -> DVector<f64> {
        let variances = self.factor.inverse().diagonal();
        variances.map(|variance| variance.max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gain_is_that_of_one_normal_number() {
        // One number seen with variance 1/4 at 3: score 12 at 0, information 4.
        let judged = judge(
            &DVector::from_element(1, 12.0),
            &DMatrix::from_element(1, 1, 4.0),
            &DVector::zeros(1),
        )
        .unwrap();
        // ln N(3; 0, t^2 + 1/4) - ln N(3; 0, 1/4) at the best t of the grid, 10^0.5.
        let (wide, narrow): (f64, f64) = (10.0 + 0.25, 0.25);
        let expected = -(9.0 / wide + wide.ln()) + (9.0 / narrow + narrow.ln());
        assert!((judged.gain - expected).abs() < 1e-9, "{}", judged.gain);
        assert!((judged.mean[0] - 3.0 * 10.0 / 10.25).abs() < 1e-9);
    }

    #[test]
    fn it_does_not_matter_where_one_stands() {
        let information = DMatrix::from_row_slice(2, 2, &[5.0, 1.0, 1.0, 3.0]);
        let score = DVector::from_vec(vec![7.0, -2.0]);
        let zero = DVector::zeros(2);
        let from_zero = judge(&score, &information, &zero).unwrap();
        let at = DVector::from_vec(vec![0.5, -0.3]);
        let there = judge(&(&score - &information * &at), &information, &at).unwrap();
        assert!((from_zero.mean - there.mean).norm() < 1e-12);
        assert!((from_zero.gain - there.gain).abs() < 1e-12);
    }
}
