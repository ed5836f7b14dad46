//! A fit whose fields are pinholes: adjusted by the numbers of a pinhole, and put back among the pinholes
//! after every adjustment, as straight steps lead beside them (METHOD 2.9).

use super::fit::{Fit, LAST};
use super::pinhole_lens::{Pinholes, are_pinholes, as_pinholes};
use crate::adjust::Observations;

/// Rounds at most. Three or four are enough unless no pinhole fits.
const MOST_ROUNDS: usize = 12;
/// A round that changes the objective by less is the last: a thirtieth of a standard deviation.
const SETTLED: f64 = 1e-3;
/// Sum of squares over all corners, in variances of the noise, by which fields may miss their pinholes: no
/// number moves by more than the root of it, in standard deviations.
const UNFELT: f64 = 0.05;

/// The same fit with the best pinholes for fields; `None` if it has offsets or splines, or if a lens sees
/// what no pinhole can see.
///
/// It is left where it stands once twice its log likelihood is behind that of `from` by more than
/// `hopeless`.
pub fn pinholes(from: &Fit, observations: &Observations, hopeless: f64) -> Option<Fit> {
    let mut cameras = from.model.cameras.iter();
    if from.model.has_spline() || cameras.any(|camera| camera.offset().is_some()) {
        return None;
    }
    let least = from.share * 2.0 * from.log_likelihood() - hopeless;
    let mut fit = from.clone();
    let mut before = f64::INFINITY;
    for _ in 0..MOST_ROUNDS {
        fit = among_pinholes(&fit, observations)?;
        fit.adjust(observations, LAST);
        let now = *fit.costs.last()?;
        let is_hopeless = fit.share * 2.0 * fit.log_likelihood() < least;
        if is_hopeless || (before - now).abs() < SETTLED {
            break;
        }
        before = now;
    }
    Some(fit)
}

/// The fit with every field replaced by the nearest pinhole. `None` besides if a field cannot be as near to
/// it as that the data do not feel what is left.
pub fn among_pinholes(fit: &Fit, observations: &Observations) -> Option<Fit> {
    let Pinholes { model, missed_px2 } = as_pinholes(&fit.model, observations)?;
    let felt = missed_px2 * observations.corner_count() as f64 / fit.noise.variance_px2;
    if felt > UNFELT {
        return None;
    }
    let mut next = fit.changed(observations, |old| *old = model);
    if are_pinholes(&fit.model) {
        next.smoothness = fit.smoothness.clone();
    }
    Some(next)
}
