//! Which suspicions the data support: all of them judged from one linearization, those ahead fitted in
//! full, the best taken, and once more from there.

use super::bayes::judge;
use super::detrended::detrended_correlation;
use super::effects::Effect::{
    self, BoardScale, BoardShear, Focus, MoveX, MoveY, MoveZ, Shape0, Shape1, Shape2, ShiftU,
    ShiftV, SkewU, SkewV, TurnX, TurnY, TurnZ,
};
use super::explained::{Explained, Explanation, fitted, scores};
use super::suspicion::{Since, Suspect, Suspicion};
use crate::adjust::{Model, Observations};
use crate::joint::Estimate;
use crate::joint::choice::{self, Candidate};
use crate::joint::correlation::effective_share;
use crate::joint::fit::Fit;
use rayon::prelude::*;

/// Twice the log evidence that an explanation must gain: "very strong" on the scale of Kass and
/// Raftery (1995). It is an accusation, and not one more number of a model.
pub const NEEDED: f64 = 10.0;
/// Share of an explanation's gain that its being linear may leave for others.
pub(super) const LEFT_BY_LINEARITY: f64 = 1e-3;
/// Explanations at most: what is left then is small, or is none of these.
const MOST: usize = 3;
/// Suspicions that are fitted in full, of different kinds.
const FITTED: usize = 7;
pub(super) const SHIFT: [Effect; 2] = [ShiftU, ShiftV];
pub(super) const TURN: [Effect; 3] = [TurnX, TurnY, TurnZ];
pub(super) const MOVE: [Effect; 3] = [MoveX, MoveY, MoveZ];
pub(super) const TURN_AND_MOVE: [Effect; 6] = [TurnX, TurnY, TurnZ, MoveX, MoveY, MoveZ];
pub(super) const SHAPE: [Effect; 3] = [Shape0, Shape1, Shape2];

/// What explains the residuals of an estimate, most important first: each with the estimate that has it
/// and those before it, on the data as they would have been at the end of the recording.
///
/// A model with offsets or splines may have followed a fault, and one without them may lay to a fault
/// what is the optics' own. So faults are looked for beside the model as it was chosen, beside the
/// central one without splines and beside one with offsets, and compete with all; what the lenses need
/// is chosen anew beside each fault found.
///
/// Cost: a tenth of the estimate's if there is nothing to be found, about the estimate's for each found.
pub fn explain(estimate: &Estimate) -> Vec<(Explanation, Estimate)> {
    let share = detrended_share(estimate);
    let mut fit = estimate.fit.clone();
    fit.share = fit.share.max(share);
    let observations = estimate.observations.clone();
    let mut found: Vec<(Explanation, Estimate)> = Vec::new();
    let Some(chosen) = Explained::settled(fit, observations) else {
        return found;
    };
    let mut bases = chosen.with_others();
    let mut needed = NEEDED;
    while found.len() < MOST {
        let Some((explanation, explained)) = next(&bases, needed) else {
            break;
        };
        bases = explained.rechosen();
        let Some(best) = bases.first() else {
            break;
        };
        needed = needed.max(LEFT_BY_LINEARITY * explanation.gain);
        let fit = best.candidate.fit.clone();
        found.push((explanation, estimate.remade(fit, best.observations.clone())));
    }
    found
}

/// Share of the corners that counts as independent, but for what a fault makes them err alike.
pub(super) fn detrended_share(estimate: &Estimate) -> f64 {
    let Estimate {
        residuals,
        observations,
        noise,
        ..
    } = estimate;
    detrended_correlation(residuals, observations, noise).map_or(1.0, effective_share)
}

impl Explained {
    fn settled(fit: Fit, observations: Observations) -> Option<Self> {
        let candidate = Candidate::settle(fit, f64::NEG_INFINITY, &observations).ok()?;
        Some(Self {
            candidate,
            observations,
        })
    }

    /// The same data with another model.
    fn changed(&self, change: impl FnOnce(&mut Model)) -> Option<Self> {
        let fit = self.candidate.fit.changed(&self.observations, change);
        Self::settled(fit, self.observations.clone())
    }

    fn plain(&self) -> Option<Self> {
        self.changed(|model| {
            for camera in &mut model.cameras {
                camera.drop_offset();
                camera.field.direction.spline = None;
            }
        })
    }

    /// This model first; then those that hold less and more of what lenses may do.
    fn with_others(self) -> Vec<Self> {
        let model = &self.candidate.fit.model;
        let others = [
            if is_plain(model) { None } else { self.plain() },
            if has_offsets(model) || !choice::may_have_offsets(&self.observations) {
                None
            } else {
                self.changed(|model| choice::add_offsets(model, &self.observations))
            },
        ];
        std::iter::once(self)
            .chain(others.into_iter().flatten())
            .collect()
    }

    /// What the lenses need beside what was found, chosen anew; the best first.
    fn rechosen(self) -> Vec<Self> {
        let Some(plain) = self.plain() else {
            return vec![self];
        };
        let chosen = choice::choose(plain.candidate.clone(), None, &self.observations);
        let candidate = chosen.best;
        let best = if candidate.evidence > self.candidate.evidence {
            Self {
                candidate,
                observations: self.observations,
            }
        } else {
            self
        };
        best.with_others()
    }
}

/// Whether a model is central and without splines.
fn is_plain(model: &Model) -> bool {
    !model.has_spline() && !has_offsets(model)
}

fn has_offsets(model: &Model) -> bool {
    model.cameras.iter().any(|camera| camera.offset().is_some())
}

/// The best explanation beside any of some models, if it gains enough over the best of them.
fn next(bases: &[Explained], needed: f64) -> Option<(Explanation, Explained)> {
    let evidences = bases.iter().map(|base| base.candidate.evidence);
    let rival = evidences.max_by(f64::total_cmp)?;
    let beside: Vec<Vec<_>> = bases.par_iter().map(|base| beside(base, rival)).collect();
    let mut good: Vec<_> = beside.into_iter().flatten().collect();
    let most = good
        .iter()
        .map(|(found, _)| found.gain)
        .max_by(f64::total_cmp)?;
    if most <= needed {
        return None;
    }
    // What the data cannot tell apart is told apart by what happens: regions and pixel origins move by
    // whole or half pixels, knocks do not.
    good.retain(|(found, _)| found.gain > most - NEEDED);
    good.into_iter().max_by(|(a, _), (b, _)| {
        let likely = |found: &Explanation| found.is_likely();
        likely(a).cmp(&likely(b)).then(a.gain.total_cmp(&b.gain))
    })
}

/// Explanations beside a model, each fitted in full, with what they gain over another's evidence.
fn beside(base: &Explained, rival: f64) -> Vec<(Explanation, Explained)> {
    let mut start = if is_plain(&base.candidate.fit.model) {
        base.stiff()
    } else {
        base.clone()
    };
    let Some(scores) = scores(&mut start.candidate.fit, &start.observations) else {
        return Vec::new();
    };
    let gain = |suspicion: &Suspicion| {
        let (score, information) = scores.of(suspicion);
        let at = nalgebra::DVector::zeros(score.len());
        let judged = judge(&score, &information, &at)?;
        Some(judged.gain - 2.0 * suspicion.alternatives.ln())
    };
    let suspicions = suspicions(&base.candidate.fit.model, &base.observations);
    let mut judged: Vec<(f64, Suspicion)> = suspicions
        .into_par_iter()
        .filter_map(|suspicion| Some((gain(&suspicion)?, suspicion)))
        .collect();
    judged.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut ahead: Vec<&Suspicion> = Vec::new();
    for (gain, suspicion) in &judged {
        let is_new = ahead.iter().all(|other| other.suspect != suspicion.suspect);
        if *gain > NEEDED && is_new && ahead.len() < FITTED {
            ahead.push(suspicion);
        }
    }
    let results: Vec<_> = ahead
        .into_par_iter()
        .map(|suspicion| fitted(rival, &start, suspicion))
        .collect();
    results.into_iter().flatten().collect()
}

/// All suspicions about some observations.
fn suspicions(model: &Model, observations: &Observations) -> Vec<Suspicion> {
    let all = |suspect, effects: &[Effect]| {
        Suspicion::common(observations, suspect, Since::Always, None, effects)
    };
    let mut list = vec![
        all(Suspect::BoardScale, &[BoardScale]),
        all(Suspect::BoardShear, &[BoardScale, BoardShear]),
        Suspicion::every(observations, Suspect::BoardFlexes, None, &SHAPE, false),
        Suspicion::every(
            observations,
            Suspect::RollingShutter,
            None,
            &[SkewU, SkewV],
            true,
        ),
    ];
    let cameras = observations.sensors.len();
    for camera_idx in 1..cameras {
        let suspect = Suspect::Late { camera_idx };
        list.push(Suspicion::every(
            observations,
            suspect,
            Some(camera_idx),
            &MOVE,
            false,
        ));
    }
    let changes: Vec<usize> = (1..observations.poses.len())
        .filter(|k| observations.poses[*k] != observations.poses[k - 1])
        .collect();
    for change in &changes {
        let since = Since::Before(*change);
        let mut put = |mut suspicion: Suspicion| {
            suspicion.alternatives = changes.len() as f64;
            list.push(suspicion);
        };
        if cameras > 1 {
            let all = Suspect::Focus { camera_idx: None };
            put(Suspicion::common(
                observations,
                all,
                since.clone(),
                None,
                &[Focus],
            ));
            let all = Suspect::Shift { camera_idx: None };
            put(Suspicion::each_camera(observations, all, &since, &SHIFT));
        }
        for camera_idx in 0..cameras {
            let one = Some(camera_idx);
            let of_one = |suspect, effects: &[Effect]| {
                Suspicion::common(observations, suspect, since.clone(), one, effects)
            };
            put(of_one(Suspect::Focus { camera_idx: one }, &[Focus]));
            put(of_one(Suspect::Shift { camera_idx: one }, &SHIFT));
            if camera_idx > 0 {
                put(of_one(Suspect::Turned { camera_idx }, &TURN));
                put(of_one(Suspect::Moved { camera_idx }, &TURN_AND_MOVE));
                let camera = &model.cameras[camera_idx].camera_from_rig;
                let direction = camera.translation_mm.normalize();
                put(Suspicion::baseline(
                    observations,
                    camera_idx,
                    since.clone(),
                    &direction,
                ));
            }
        }
    }
    list
}
