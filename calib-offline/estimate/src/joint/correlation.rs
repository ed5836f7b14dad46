//! How alike neighboring corners err, and what that leaves of their number.

use crate::adjust::Observations;
use crate::adjust::robust::StudentT;
use nalgebra::Vector2;
use std::collections::HashMap;

/// Least effective share of corners, however alike neighbors err.
const LEAST_EFFECTIVE_SHARE: f64 = 1.0 / 25.0;

/// Correlation of the residuals of neighboring corners within a view, over both board directions,
/// robustly weighted; `None` if no two neighbors were seen.
///
/// Real boards and detectors err alike at neighboring corners (0.25 to 0.7 on real sets); simulated
/// noise does not (METHOD 9A). It must be measured after the field is flexible, so that misfit of
/// the field does not count.
pub fn neighbor_correlation(
    residuals: &[Vec<Option<Vector2<f64>>>],
    observations: &Observations,
    noise: &StudentT,
) -> Option<f64> {
    let (mut product, mut power) = (0.0, 0.0);
    for (view, residuals) in observations.views.iter().zip(residuals) {
        let by_label: HashMap<(usize, usize), Vector2<f64>> = view
            .corners
            .iter()
            .zip(residuals)
            .filter_map(|(corner, residual)| Some(((corner.row, corner.col), (*residual)?)))
            .collect();
        for corner in &view.corners {
            let Some(here) = by_label.get(&(corner.row, corner.col)) else {
                continue;
            };
            for neighbor in observations.board.next_to(corner.row, corner.col) {
                let Some(there) = by_label.get(&neighbor) else {
                    continue;
                };
                let w1 = noise.weight(here.norm_squared());
                let w2 = noise.weight(there.norm_squared());
                product += (w1 * w2).sqrt() * here.dot(there);
                if w1 * w2 > 0.0 {
                    power += (w1 * here.norm_squared() + w2 * there.norm_squared()) / 2.0;
                }
            }
        }
    }
    (power > 0.0).then(|| product / power)
}

/// The share of corners that count as independent, given the correlation of neighbors:
/// `((1 - rho) / (1 + rho))^2`, one factor per direction of the board.
pub fn effective_share(correlation: f64) -> f64 {
    let rho = correlation.clamp(0.0, 1.0);
    ((1.0 - rho) / (1.0 + rho))
        .powi(2)
        .max(LEAST_EFFECTIVE_SHARE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn independent_corners_all_count_and_alike_ones_hardly() {
        assert_eq!(effective_share(-0.02), 1.0);
        assert!((effective_share(0.5) - 1.0 / 9.0).abs() < 1e-15);
        assert_eq!(effective_share(1.0), LEAST_EFFECTIVE_SHARE);
    }
}
