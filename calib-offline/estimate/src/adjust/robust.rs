//! How much a residual counts: weights of a bivariate Student-t distribution, found anew between
//! steps (iteratively reweighted least squares; METHOD 2.6, 9A).
//!
//! Real corners have heavier tails than a Gaussian; simulated ones do not. The number of degrees
//! of freedom comes from the residuals' own likelihood, so that Gaussian noise costs nothing.

use super::objective::Weights;
use super::observations::Observations;
use calib_rays::numerics::median;
use nalgebra::Vector2;

/// Degrees of freedom that are tried; the last is least squares to all practical purposes.
const CANDIDATES: [f64; 6] = [3.0, 4.0, 6.0, 10.0, 20.0, 1000.0];

/// A residual within this many standard deviations is that of a corner, however light the tails.
const KEEP_WITHIN_SIGMA: f64 = 8.0;

/// Logarithm of the density of outliers, 1/px^2: anywhere on a megapixel.
pub const LN_OUTLIER_DENSITY: f64 = -13.8;

/// Logarithm of the share of corners that are outliers before anything is seen: one in a hundred.
const LN_OUTLIER_SHARE: f64 = -4.6;

/// The distribution of residual vectors: `p(r) ~ (1 + |r|^2 / (nu v))^(-(nu + 2) / 2)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StudentT {
    /// Degrees of freedom nu.
    pub freedom: f64,
    /// Scale v, px^2 per axis.
    pub variance_px2: f64,
}

impl StudentT {
    /// Weight of a residual whose squared length is `squared_px2`, and 0 where an outlier is likelier: with light
    /// tails beyond a few standard deviations, with heavy ones, which real images have, many times further out.
    pub fn weight(&self, squared_px2: f64) -> f64 {
        if self.is_near(squared_px2)
            || self.log_density_of_corners(squared_px2) >= LN_OUTLIER_DENSITY + LN_OUTLIER_SHARE
        {
            self.tail_weight(squared_px2)
        } else {
            0.0
        }
    }

    /// Whether a residual is within eight times the scale.
    pub fn is_near(&self, squared_px2: f64) -> bool {
        squared_px2 <= KEEP_WITHIN_SIGMA * KEEP_WITHIN_SIGMA * self.variance_px2
    }

    /// [`Self::weight`] without a rejection limit: the pull of a residual falls with its length and never ends.
    pub fn tail_weight(&self, squared_px2: f64) -> f64 {
        (self.freedom + 2.0) / (self.freedom + squared_px2 / self.variance_px2)
    }

    /// `ln p = -ln(2 pi v) - (nu + 2)/2 ln(1 + |r|^2/(nu v))` of a residual whose squared length is
    /// given, 1/px^2. One that is rejected comes from anywhere, with a density that no parameter changes.
    pub fn log_density(&self, squared_px2: f64) -> f64 {
        if self.weight(squared_px2) > 0.0 {
            self.log_density_of_corners(squared_px2)
        } else {
            LN_OUTLIER_DENSITY
        }
    }

    fn log_density_of_corners(&self, squared_px2: f64) -> f64 {
        -(2.0 * std::f64::consts::PI * self.variance_px2).ln()
            - (self.freedom + 2.0) / 2.0
                * (squared_px2 / (self.freedom * self.variance_px2)).ln_1p()
    }

    /// The distribution, of those tried, that makes the residuals most likely. `squared_px2` are
    /// the squared lengths of residual vectors; at least `floor_px2` per axis is assumed, so that
    /// noise-free data have a scale. Of a fit to much the same residuals, `known`, only the
    /// neighbors are tried.
    pub fn fit(squared_px2: &[f64], floor_px2: f64, known: Option<&Self>) -> Self {
        let mut best: Option<(f64, Self)> = None;
        let robust_start = {
            let median = median(squared_px2.iter().copied()).unwrap_or(0.0);
            // The median of |r|^2 of a bivariate Gaussian is 2 ln 2 times its variance per axis.
            median / (2.0 * 2f64.ln())
        }
        .max(floor_px2);
        let near = |freedom: f64| {
            let place = |wanted: f64| CANDIDATES.iter().position(|c| *c >= wanted);
            known.is_none_or(|known| match (place(known.freedom), place(freedom)) {
                (Some(a), Some(b)) => a.abs_diff(b) <= 1,
                _ => true,
            })
        };
        for freedom in CANDIDATES.into_iter().filter(|freedom| near(*freedom)) {
            let mut fit = Self {
                freedom,
                variance_px2: robust_start,
            };
            for _ in 0..30 {
                let (mut weighted, mut count) = (0.0, 0.0);
                for s in squared_px2 {
                    let w = fit.weight(*s);
                    if w > 0.0 {
                        weighted += w * s;
                        count += 1.0;
                    }
                }
                if count == 0.0 {
                    break;
                }
                let variance_px2 = (weighted / (2.0 * count)).max(floor_px2);
                let change = (variance_px2 / fit.variance_px2).ln().abs();
                fit.variance_px2 = variance_px2;
                if change < 1e-6 {
                    break;
                }
            }
            let log_likelihood: f64 = squared_px2.iter().map(|s| fit.log_density(*s)).sum();
            if best.is_none_or(|(likelihood, _)| log_likelihood > likelihood) {
                best = Some((log_likelihood, fit));
            }
        }
        best.map_or(
            Self {
                freedom: CANDIDATES[1],
                variance_px2: robust_start,
            },
            |(_, fit)| fit,
        )
    }
}

/// The scale of residuals that counts as noise-free, px: 1/500 of what the best detectors reach.
const FLOOR_PX: f64 = 2e-5;

/// The distribution of the residuals, and the weight in 1/px^2 that it gives to every corner.
///
/// A corner behind its camera gets weight 0. With `tails`, none is rejected: while a lens is still far from what it
/// will be, its rim is off by more than any noise, and the corners there are all that can say so. `strength` scales all weights: 1 for independent
/// corners, less if neighboring corners err alike. `known`: see [`StudentT::fit`].
pub fn reweight(
    residuals: &[Vec<Option<Vector2<f64>>>],
    observations: &Observations,
    strength: f64,
    known: Option<&StudentT>,
    tails: bool,
) -> (StudentT, Weights) {
    let squared = per_corner(residuals, observations, |residual, relative_weight| {
        let squared = residual.as_ref()?.norm_squared() * relative_weight;
        squared.is_finite().then_some(squared)
    });
    let flat: Vec<f64> = squared.iter().flatten().filter_map(|s| *s).collect();
    let noise = StudentT::fit(&flat, FLOOR_PX * FLOOR_PX, known);
    let weight = |s: f64| {
        if tails {
            noise.tail_weight(s)
        } else {
            noise.weight(s)
        }
    };
    let weights = per_corner(&squared, observations, |squared, relative_weight| {
        squared.map_or(0.0, |s| {
            strength * weight(s) * relative_weight / noise.variance_px2
        })
    });
    (noise, weights)
}

/// Weight of every corner relative to that of one without residual: 0 to 1, and 0 for one that is
/// rejected or has no residual.
pub fn relative_weights(
    residuals: &[Vec<Option<Vector2<f64>>>],
    observations: &Observations,
    noise: &StudentT,
) -> Vec<Vec<f64>> {
    per_corner(residuals, observations, |residual, relative_weight| {
        let squared = residual.map(|r| r.norm_squared() * relative_weight);
        // The largest weight of the distribution is (nu + 2) / nu, at zero.
        squared.map_or(0.0, |s| noise.weight(s) / noise.weight(0.0))
    })
}

/// A value of every corner from another and the corner's relative weight, view by view.
fn per_corner<A, B>(
    values: &[Vec<A>],
    observations: &Observations,
    of: impl Fn(&A, f64) -> B,
) -> Vec<Vec<B>> {
    let views = values.iter().zip(&observations.views);
    views
        .map(|(values, view)| {
            let corners = values.iter().zip(&view.corners);
            corners
                .map(|(value, corner)| of(value, corner.relative_weight))
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn gaussian(count: usize, sigma: f64) -> Vec<f64> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        (0..count)
            .map(|_| {
                let x: f64 = StandardNormal.sample(&mut rng);
                let y: f64 = StandardNormal.sample(&mut rng);
                sigma * sigma * (x * x + y * y)
            })
            .collect()
    }

    #[test]
    fn gaussian_residuals_are_least_squares() {
        let fit = StudentT::fit(&gaussian(5000, 0.05), 1e-12, None);
        assert!(fit.freedom >= 20.0, "nu = {}", fit.freedom);
        // Standard error of a standard deviation from 10^4 numbers: 0.7 %.
        assert!((fit.variance_px2.sqrt() / 0.05 - 1.0).abs() < 0.03);
    }

    #[test]
    fn outliers_do_not_move_the_scale() {
        let mut squared = gaussian(5000, 0.05);
        for s in squared.iter_mut().step_by(20) {
            *s = 25.0;
        }
        let fit = StudentT::fit(&squared, 1e-12, None);
        assert_eq!(fit.weight(25.0), 0.0);
        assert!((fit.variance_px2.sqrt() / 0.05 - 1.0).abs() < 0.1);
    }
}
