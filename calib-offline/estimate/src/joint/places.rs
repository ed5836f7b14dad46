//! Places of a target that are not exactly known: their errors come on top of those of the pixels.

use super::fit::Fit;
use crate::adjust::Observations;
use crate::adjust::prediction::predict;
use calib_rays::numerics::median;

/// Least share of the residuals' variance that is the pixels' own, however uncertain the places are said to be.
const LEAST_PIXEL_SHARE: f64 = 0.1;

/// The observations with weights that count what the places' own standard deviations make in the image, at the
/// scale that the fit has there: `v / (v + p)`, v being the variance of a pixel coordinate and p that of a place,
/// each per axis, px^2. v is what the residuals have beyond the middle p. `None` where all places are exact.
///
/// The error of a place is the same in every view of it; it is taken as if it were not.
pub fn weighted_by_places(observations: &Observations, fit: &Fit) -> Option<Observations> {
    let board = &observations.board;
    let places_px2: Vec<Vec<f64>> = observations
        .views
        .iter()
        .zip(fit.bases())
        .map(|(view, basis)| {
            predict(&fit.model, observations, view, basis)
                .zip(&view.corners)
                .map(|(seen, corner)| {
                    let sigma_mm = board.place_sigma_mm(corner.col);
                    let scale = seen
                        .linearization
                        .map_or(0.0, |l| l.by_point.norm_squared());
                    sigma_mm * sigma_mm * scale / 2.0
                })
                .collect()
        })
        .collect();
    let all = places_px2.iter().flatten();
    let middle_px2 = median(all.copied().filter(|p| *p > 0.0))?;
    let seen_px2 = fit.noise.variance_px2;
    let pixel_px2 = (seen_px2 - middle_px2).max(LEAST_PIXEL_SHARE * seen_px2);
    let mut weighted = observations.clone();
    for (view, places_px2) in weighted.views.iter_mut().zip(&places_px2) {
        for (corner, place_px2) in view.corners.iter_mut().zip(places_px2) {
            // Relative to a corner of the same pixels at an exact place.
            corner.relative_weight = 1.0 / (1.0 / corner.relative_weight + place_px2 / pixel_px2);
        }
    }
    Some(weighted)
}
