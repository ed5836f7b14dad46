//! What is made as small as possible: weighted squares of the residuals, and the priors.

use super::model::Model;
use super::observations::{Observations, ViewBasis};
use super::prediction::predict;
use super::priors::Priors;
use nalgebra::Vector2;
use rayon::prelude::*;

/// Weight per corner, in the order of the views and their corners.
pub type Weights = Vec<Vec<f64>>;

/// Residual vectors of every corner (observed minus predicted, px), in the order of the views;
/// `None` behind the camera.
pub fn residuals(
    model: &Model,
    observations: &Observations,
    bases: &[ViewBasis],
) -> Vec<Vec<Option<Vector2<f64>>>> {
    observations
        .views
        .par_iter()
        .zip(bases)
        .map(|(view, basis)| {
            predict(model, observations, view, basis)
                .map(|seen| seen.linearization.map(|l| l.residual_px))
                .collect()
        })
        .collect()
}

/// Sum of `w |r|^2` and of the priors. A corner behind its camera counts as one a sensor's width
/// away, so that no step gains by turning a board over.
pub fn cost(
    model: &Model,
    observations: &Observations,
    bases: &[ViewBasis],
    weights: &Weights,
    priors: &Priors,
) -> f64 {
    let residuals = residuals(model, observations, bases);
    cost_of_residuals(&residuals, model, observations, weights, priors)
}

/// [`cost`], given the [`residuals`] of the model.
pub fn cost_of_residuals(
    residuals: &[Vec<Option<Vector2<f64>>>],
    model: &Model,
    observations: &Observations,
    weights: &Weights,
    priors: &Priors,
) -> f64 {
    let corners: f64 = observations
        .views
        .iter()
        .zip(residuals)
        .zip(weights)
        .map(|((view, residuals), weights)| {
            let lost_px = f64::from(observations.sensors[view.camera_idx].width);
            residuals
                .iter()
                .zip(weights)
                .map(|(residual, w)| {
                    let squared = residual
                        .map(|r| r.norm_squared())
                        .filter(|squared| squared.is_finite());
                    w * squared.unwrap_or(lost_px * lost_px)
                })
                .sum::<f64>()
        })
        .sum();
    corners + priors.cost(model)
}
