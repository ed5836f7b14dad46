//! Correlation of neighboring corners' errors without what a fault adds to it. A fault shifts whole views
//! smoothly; paper, detector and glare do not.

use crate::adjust::Observations;
use crate::adjust::robust::StudentT;
use crate::joint::correlation::neighbor_correlation;
use nalgebra::{Matrix6, Matrix6x2, RowVector2, Vector2, Vector6};

type Residuals = Vec<Vec<Option<Vector2<f64>>>>;

/// [`neighbor_correlation`] of residuals, a quadratic over the board taken off in every view.
pub fn detrended_correlation(
    residuals: &Residuals,
    observations: &Observations,
    noise: &StudentT,
) -> Option<f64> {
    let views = observations.views.iter().zip(residuals);
    let detrended: Residuals = views
        .map(|(view, residuals)| {
            let labels = view.corners.iter().map(|c| (c.row as f64, c.col as f64));
            detrended(&labels.collect::<Vec<_>>(), residuals, noise)
        })
        .collect();
    neighbor_correlation(&detrended, observations, noise)
}

fn detrended(
    labels: &[(f64, f64)],
    residuals: &[Option<Vector2<f64>>],
    noise: &StudentT,
) -> Vec<Option<Vector2<f64>>> {
    let count = labels.len().max(1) as f64;
    let (row, col) = labels.iter().fold((0.0, 0.0), |(r, c), label| {
        (r + label.0 / count, c + label.1 / count)
    });
    let terms = |(r, c): (f64, f64)| {
        let (r, c) = (r - row, c - col);
        Vector6::new(1.0, r, c, r * r, r * c, c * c)
    };
    let (mut matrix, mut right) = (Matrix6::zeros(), Matrix6x2::zeros());
    for (label, residual) in labels.iter().zip(residuals) {
        if let Some(residual) = residual {
            let (terms, weight) = (terms(*label), noise.weight(residual.norm_squared()));
            matrix += weight * terms * terms.transpose();
            right += weight * terms * RowVector2::new(residual.x, residual.y);
        }
    }
    let Some(factor) = matrix.cholesky() else {
        // Too few corners for a trend; then all of it counts.
        return residuals.to_vec();
    };
    let trend = factor.solve(&right);
    let pairs = labels.iter().zip(residuals);
    pairs
        .map(|(label, residual)| Some((*residual)? - trend.tr_mul(&terms(*label))))
        .collect()
}
