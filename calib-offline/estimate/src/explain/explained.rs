//! A suspicion that holds: its numbers, and the estimate with it.

use super::bayes::{Judged, judge};
use super::effects::shifts;
use super::scores::Scores;
use super::suspicion::{Since, Suspect, Suspicion};
use crate::adjust::Observations;
use crate::adjust::levenberg::Settings;
use crate::joint::choice::Candidate;
use crate::joint::evidence::Smoothness;
use crate::joint::fit::Fit;
use nalgebra::{DVector, Vector2};

/// Steps from a linearization to the next, and their precision: numbers far below their standard
/// deviation do not matter.
const REFITS: usize = 8;
const BETWEEN: Settings = Settings {
    max_iterations: 8,
    relative_decrease: 1e-6,
};
/// A change by less, in standard deviations, is the last.
const SETTLED_SD: f64 = 0.1;

/// Something found about a recording.
#[derive(Debug, Clone)]
pub struct Explanation {
    /// What.
    pub suspect: Suspect,
    /// In which poses (by index) it was otherwise than at the end.
    pub since: Since,
    /// Its numbers, in the units of the effects (px, rad, mm, shares): of a change in time, those
    /// after it minus those before.
    pub values: Vec<f64>,
    /// Their standard deviations.
    pub sd: Vec<f64>,
    /// Twice the log evidence gained by it, over all that was found before.
    pub gain: f64,
}

/// Standard deviations between a shift and a whole or half pixel, at most.
const ON_LATTICE_SD: f64 = 4.0;
/// A shift's scale error: an explanation is linear in what it corrects.
const SHIFT_SHARE: f64 = 0.005;

impl Explanation {
    /// RMS of the numbers that belong to effect `k` of `of` effects.
    pub fn rms(&self, k: usize, of: usize) -> f64 {
        let own: Vec<f64> = self.values.iter().skip(k).step_by(of).copied().collect();
        calib_rays::numerics::rms(&own).unwrap_or(0.0)
    }

    /// The whole or half pixels that a shift is of, per camera that it may be of, if it is such.
    pub fn half_pixels(&self) -> Option<Vec<f64>> {
        if !matches!(self.suspect, Suspect::Shift { .. }) {
            return None;
        }
        let rounded: Vec<f64> = self
            .values
            .iter()
            .map(|x| (2.0 * x).round() / 2.0)
            .collect();
        let near = self.values.iter().zip(&self.sd).zip(&rounded);
        let is_near = near.into_iter().all(|((value, sd), rounded)| {
            (value - rounded).abs() < ON_LATTICE_SD * sd + SHIFT_SHARE * rounded.abs()
                && ON_LATTICE_SD * sd < 0.25
        });
        (is_near && rounded.iter().any(|x| *x != 0.0)).then_some(rounded)
    }

    /// Whether it is what it says, among explanations that the data cannot tell apart: a shift of
    /// pixels that is none of whole or half pixels is rather a turn.
    pub fn is_likely(&self) -> bool {
        !matches!(self.suspect, Suspect::Shift { .. }) || self.half_pixels().is_some()
    }
}

/// A model with what explains, on the data as they would be without it.
#[derive(Clone)]
pub(super) struct Explained {
    pub candidate: Candidate,
    pub observations: Observations,
}

impl Explained {
    /// The same with lenses that may only do what every lens does: smooth fields follow a fault, and
    /// what they followed no longer shows.
    pub fn stiff(&self) -> Self {
        let mut stiff = self.clone();
        let fit = &mut stiff.candidate.fit;
        fit.smoothness = Smoothness::structured_only(&fit.model);
        fit.adjust(&stiff.observations, BETWEEN);
        stiff
    }
}

/// Scores at a fit.
pub(super) fn scores(fit: &mut Fit, observations: &Observations) -> Option<Scores> {
    let weights = fit.reweight(observations);
    let priors = fit.priors();
    Scores::new(
        &fit.model,
        observations,
        fit.bases(),
        fit.residuals(),
        &weights,
        &priors,
    )
}

/// Fits a suspicion in full, to be held against a rival's evidence. The evidence of the result counts
/// the suspicion's numbers.
///
/// `None` if the data leave it open.
pub(super) fn fitted(
    rival: f64,
    start: &Explained,
    suspicion: &Suspicion,
) -> Option<(Explanation, Explained)> {
    let at = DVector::zeros(suspicion.numbers.len());
    let fit = start.candidate.fit.clone();
    fitted_from(rival, fit, start.observations.clone(), suspicion, at)
}

/// [`fitted`] from numbers (in units) that the observations are corrected by already.
pub(super) fn fitted_from(
    rival: f64,
    mut fit: Fit,
    mut observations: Observations,
    suspicion: &Suspicion,
    mut at: DVector<f64>,
) -> Option<(Explanation, Explained)> {
    for _ in 0..REFITS {
        let judged = judged(&mut fit, &observations, suspicion, &at)?;
        let change = &judged.mean - &at;
        observations = corrected(&observations, &fit, suspicion, &change);
        let sd = judged.sd();
        at = judged.mean;
        fit = fit.on(&observations);
        fit.adjust(&observations, BETWEEN);
        if change
            .iter()
            .zip(&sd)
            .all(|(x, sd)| x.abs() < SETTLED_SD * sd)
        {
            break;
        }
    }
    let mut candidate = settled_anew(fit, &observations)?;
    let last = judged(&mut candidate.fit, &observations, suspicion, &at)?;
    let Judged {
        prior_sd, occam, ..
    } = last;
    let alternatives = 2.0 * suspicion.alternatives.ln();
    candidate.evidence -= at.norm_squared() / (prior_sd * prior_sd) + occam + alternatives;
    let scaled = |values: &DVector<f64>| {
        let units = suspicion.units.iter();
        values.iter().zip(units).map(|(x, unit)| x * unit).collect()
    };
    let explanation = Explanation {
        suspect: suspicion.suspect,
        since: suspicion.since.clone(),
        values: scaled(&at),
        sd: scaled(&last.sd()),
        gain: candidate.evidence - rival,
    };
    let explained = Explained {
        candidate,
        observations,
    };
    explanation
        .gain
        .is_finite()
        .then_some((explanation, explained))
}

/// A fit with smoothness found anew.
pub(super) fn settled_anew(mut fit: Fit, observations: &Observations) -> Option<Candidate> {
    fit.smoothness = Smoothness::new(&fit.model);
    let once = Candidate::settle(fit, f64::NEG_INFINITY, observations).ok()?;
    Candidate::settle(once.fit, f64::NEG_INFINITY, observations).ok()
}

fn judged(
    fit: &mut Fit,
    observations: &Observations,
    suspicion: &Suspicion,
    at: &DVector<f64>,
) -> Option<Judged> {
    let (score, information) = scores(fit, observations)?.of(suspicion);
    judge(&score, &information, at)
}

/// The pixels without what the numbers of a suspicion, in units, do to them.
pub(super) fn corrected(
    observations: &Observations,
    fit: &Fit,
    suspicion: &Suspicion,
    numbers: &DVector<f64>,
) -> Observations {
    let mut corrected = observations.clone();
    for (view_idx, view) in corrected.views.iter_mut().enumerate() {
        let sizes = suspicion.sizes(view_idx, numbers.as_slice());
        if sizes.iter().all(|size| *size == 0.0) {
            continue;
        }
        let as_seen = &observations.views[view_idx];
        let by_corner = shifts(&fit.model, observations, as_seen, &fit.bases()[view_idx]);
        for (corner, by) in view.corners.iter_mut().zip(by_corner) {
            let shift: Vector2<f64> = by
                .iter()
                .flatten()
                .zip(sizes)
                .map(|(by, size)| by * size)
                .sum();
            corner.pixel.u -= shift.x;
            corner.pixel.v -= shift.y;
        }
    }
    corrected
}
