//! What the model is made of, chosen by the evidence (marginal likelihood): spline spacing, and per
//! camera central or not. Every alternative that was tried is reported with its evidence. METHOD 2.7
//! has a picture of what is tried after which.

use super::error::EstimateError;
use super::evidence::{Family, Smoothness};
use super::fit::Fit;
use super::pinhole_lens::are_pinholes;
use super::pinholes::pinholes;
use super::rebase::rebase;
use crate::adjust::levenberg::Settings;
use crate::adjust::{CameraModel, Model, Observations};
use calib_rays::field::spline::{Spline, SplineGrid};
use calib_rays::field::structured::TILT_DEGREE;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Spacing of a first spline, in cells along the sensor's longer side: 56 px on 1280 px.
const FIRST_CELLS: f64 = 23.0;
/// Finer ones, coarse to fine: 40 and 28 px on 1280 px. The search stops when the evidence falls.
const FINER_CELLS: [f64; 2] = [32.0, 46.0];
/// Degree of the offset's polynomial: a cubic follows windows and flat ports, the higher degrees,
/// held back by weights of their own, curved ports and mirrors.
const OFFSET_DEGREE: usize = 7;
/// Share of a spline's numbers that the data determine, above which a finer one is tried.
const USED_UP: f64 = 0.6;
/// The same share, below which the spline itself is asked whether it is needed.
const IDLE: f64 = 0.01;
/// Rounds after a change of the model, at most; twice as many if it is the best so far.
const ROUNDS: usize = 8;
/// A round that changes twice the log evidence by less settles the fit.
const SETTLED: f64 = 0.5;
/// A model is given up when it is behind its rival by more than this and what its changes may still
/// add up to: so many times their geometric sum, and at most so many times the last one. Weights
/// that are still on their way gain tens, not more.
const HOPELESS_GAP: f64 = 100.0;
const HOPELESS_SUMS: f64 = 4.0;
const HOPELESS_CHANGES: f64 = 10.0;
/// Twice the log evidence that a more flexible model must gain: "positive" on the scale of Kass
/// and Raftery (1995). Ties go to the simpler model.
pub const NEEDED_GAIN: f64 = 4.0;

/// The adjustment after base lenses were fitted anew.
const RENEWED: Settings = Settings {
    max_iterations: 15,
    relative_decrease: 1e-4,
};
/// How often the base lenses are fitted anew at this stage, at most.
const MOST_REBASES: usize = 3;

/// A change of the model that was best until then.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Alternative {
    /// Every camera gets an offset: its rays need not meet in one point.
    Offsets,
    /// The same from another start: the polynomials of the directions are held back at first.
    OffsetsFirst,
    /// The same, and the splines go.
    OffsetsForSpline,
    /// The same from the lenses as they were before they were fitted anew as if central.
    OffsetsAfresh,
    /// The lenses underneath are fitted anew, as offsets explain part of what they did.
    Lenses,
    /// Every camera's direction gets a spline, or one of another spacing.
    Spline {
        /// Cells along the sensor's longer side.
        cells: f64,
    },
    /// All cameras lose their offsets.
    AllCentral,
    /// One camera loses its offset.
    Central {
        /// Index of the camera.
        camera_idx: usize,
    },
    /// All cameras lose their splines.
    NoSpline,
    /// All cameras are pinholes with the distortion of Brown and Conrady, and nothing else.
    Pinhole,
    /// The polynomials of all directions are held at what a plain lens does, or those of one
    /// degree.
    Plain {
        /// Total degree; `None` for all.
        degree: Option<usize>,
    },
}

/// An alternative that was tried.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Choice {
    /// What it changes.
    pub tried: Alternative,
    /// Twice its log evidence minus that of the model that was best until then; `None` if the data
    /// leave a parameter of it open, and only roughly so if it is far behind.
    pub gain: Option<f64>,
    /// Whether it was taken.
    pub taken: bool,
}

/// The fit with its evidence.
#[derive(Clone)]
pub struct Candidate {
    /// The fit.
    pub fit: Fit,
    /// Twice the log evidence, up to a constant.
    pub evidence: f64,
}

impl Candidate {
    /// Takes a fit through rounds until its evidence settles, or until it is clear that it cannot
    /// reach `rival`, the evidence of another model (minus infinity: there is none).
    ///
    /// # Errors
    /// [`EstimateError::Singular`].
    pub fn settle(
        mut fit: Fit,
        rival: f64,
        observations: &Observations,
    ) -> Result<Self, EstimateError> {
        let mut evidence = f64::NEG_INFINITY;
        let mut last_change = f64::INFINITY;
        for round in 0..2 * ROUNDS {
            let now = fit.round(observations)?;
            let change = (now - evidence).abs();
            evidence = now;
            // Changes that shrink by a factor still add up to so many times the last one.
            let shrink = change / last_change;
            let to_come = if shrink < 1.0 {
                (HOPELESS_SUMS * shrink / (1.0 - shrink)).min(HOPELESS_CHANGES)
            } else {
                HOPELESS_CHANGES
            };
            last_change = change;
            let hopeless = rival - now > HOPELESS_GAP + to_come * change;
            // Only what wins is worth more rounds; unsettled, it would lose to itself.
            let wins = rival.is_finite() && now - rival >= NEEDED_GAIN;
            let decided = round + 1 >= ROUNDS && !wins;
            if change < SETTLED || hopeless || decided {
                break;
            }
        }
        Ok(Self { fit, evidence })
    }
}

/// What was chosen.
pub struct Chosen {
    /// The best model.
    pub best: Candidate,
    /// The way to it.
    pub tried: Vec<Choice>,
    /// The same with offsets for every camera, where some may have none.
    pub forbidden: Option<Candidate>,
}

/// Takes what the evidence asks for, starting from a settled fit without spline and offset. `ideal` is the fit before
/// its lenses were fitted anew, if that is to be gone back to.
pub fn choose(start: Candidate, ideal: Option<&Fit>, observations: &Observations) -> Chosen {
    let mut search = Search {
        best: start,
        tried: Vec::new(),
        observations,
    };
    search.structure();
    if let Some(ideal) = ideal {
        search.offsets_afresh(ideal);
    }
    for cells in FINER_CELLS {
        if !search.spline_is_used_up() || !search.spline(cells) {
            break;
        }
    }
    let forbidden = search.forbidden();
    search.simplify();
    Chosen {
        best: search.best,
        tried: search.tried,
        forbidden,
    }
}

/// Drops what the evidence no longer asks for; what was tried is added to `tried`.
pub fn simplify(
    best: Candidate,
    tried: &mut Vec<Choice>,
    observations: &Observations,
) -> Candidate {
    let mut search = Search {
        best,
        tried: std::mem::take(tried),
        observations,
    };
    search.simplify();
    *tried = search.tried;
    search.best
}

/// The best model so far and the way to it.
struct Search<'a> {
    best: Candidate,
    tried: Vec<Choice>,
    observations: &'a Observations,
}

impl Search<'_> {
    /// A spline, offsets, or both. A lens that needs one of them badly lets the other explain part
    /// of what it does, so whichever explains more goes first.
    fn structure(&mut self) {
        let bare = self.best.clone();
        if !self.spline(FIRST_CELLS) {
            if self.offsets() {
                self.lenses();
                self.spline(FIRST_CELLS);
            }
            return;
        }
        let splined = std::mem::replace(&mut self.best, bare);
        if self.offsets_beyond(splined.evidence) {
            self.lenses();
            self.spline(FIRST_CELLS);
        } else {
            self.best = splined;
            if self.offsets() && self.drop_spline() {
                self.lenses();
            }
        }
    }

    /// Whether the data determine so many of a spline's numbers that finer ones could be wanted;
    /// else they would only be held by the smoothness.
    fn spline_is_used_up(&self) -> bool {
        let model = &self.best.fit.model;
        let found = self.best.fit.smoothness.found(model);
        found.iter().any(|found| {
            found.family == Family::Spline && found.effective > USED_UP * found.parameters as f64
        })
    }

    /// Whether the data determine next to nothing of any spline: what is left of it only costs bytes.
    fn spline_is_idle(&self) -> bool {
        let found = self.best.fit.smoothness.found(&self.best.fit.model);
        let mut splines = found.iter().filter(|found| found.family == Family::Spline);
        splines.all(|found| found.effective < IDLE * found.parameters as f64)
    }

    fn spline(&mut self, cells: f64) -> bool {
        self.take_if_better(Alternative::Spline { cells }, NEEDED_GAIN, |model| {
            set_spline(model, cells);
        })
    }

    /// Offsets, from two starts: held back, so that they explain what nothing else does; and free
    /// while the polynomials are held back. Where boards stood at much the same distance, one can
    /// stand for the other, and weights do not find from one such model to the other. Data that
    /// determine a spline are not of that kind.
    fn offsets(&mut self) -> bool {
        if !may_have_offsets(self.observations) {
            return false;
        }
        let observations = self.observations;
        let add = |model: &mut Model| add_offsets(model, observations);
        let late = self.take_if_better(Alternative::Offsets, NEEDED_GAIN, add);
        if self.best.fit.model.has_spline() {
            return late;
        }
        let needed = if late { 0.0 } else { NEEDED_GAIN };
        let mut fit = self.best.fit.changed(observations, add);
        fit.smoothness.put_offsets_first();
        self.take_fit_if_better(Alternative::OffsetsFirst, needed, fit) || late
    }

    /// Offsets on the best model, against a rival that is none of its own.
    fn offsets_beyond(&mut self, rival: f64) -> bool {
        self.best.evidence = rival;
        let observations = self.observations;
        may_have_offsets(observations)
            && self.take_if_better(Alternative::OffsetsForSpline, 0.0, |model| {
                add_offsets(model, observations);
            })
    }

    /// What offsets for all cameras would make of the best model, where some are declared to have none: by the better
    /// of the two starts.
    fn forbidden(&self) -> Option<Candidate> {
        let cameras = 0..self.observations.sensors.len();
        let mut declared = cameras.filter(|k| self.observations.is_declared_central(*k));
        declared.next()?;
        let late = self.best.fit.changed(self.observations, |model| {
            for camera in model.cameras.iter_mut().filter(|c| c.offset().is_none()) {
                camera.free_offset(OFFSET_DEGREE);
            }
        });
        let mut first = late.clone();
        first.smoothness.put_offsets_first();
        [late, first]
            .into_iter()
            .filter_map(|fit| Candidate::settle(fit, f64::NEG_INFINITY, self.observations).ok())
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
    }

    /// Where offsets and a spline both seem needed, the lens underneath may be to blame: fitted as if all rays met
    /// in a point, it bends after what they do not. So offsets are tried once from where no lens was fitted yet.
    fn offsets_afresh(&mut self, ideal: &Fit) {
        let model = &self.best.fit.model;
        let is_central = model.cameras.iter().all(|camera| camera.offset().is_none());
        if is_central || !model.has_spline() {
            return;
        }
        let mut fit = ideal.clone();
        fit.smoothness = Smoothness::new(&fit.model);
        let observations = self.observations;
        let mut fit = fit.changed(observations, |model| add_offsets(model, observations));
        fit.smoothness.put_offsets_first();
        // It comes from far, and would be given up before its offsets are where they can be.
        let from_far = Candidate::settle(fit, f64::NEG_INFINITY, self.observations);
        let Ok(Candidate { fit, .. }) = from_far else {
            return;
        };
        if self.take_fit_if_better(Alternative::OffsetsAfresh, NEEDED_GAIN, fit) {
            self.spline(FIRST_CELLS);
        }
    }

    /// Base lenses that were fitted as if central hold part of what offsets explain.
    fn lenses(&mut self) {
        let observations = self.observations;
        for _ in 0..MOST_REBASES {
            let renew = |model: &mut Model| rebase(model, observations);
            let mut fit = self.best.fit.changed(observations, renew);
            // The frame turned with the lens, and offsets are along its axes: rounds of single steps would give the
            // new lens up before it is where it can be.
            fit.adjust(observations, RENEWED);
            if !self.take_fit_if_better(Alternative::Lenses, NEEDED_GAIN, fit) {
                break;
            }
        }
    }

    /// A weight of its own follows the noise of what the data hardly determine, in half of the
    /// families. So all are held if that costs no evidence to speak of: the lenses are pinholes, or
    /// at least plain.
    fn plain(&mut self) {
        if are_pinholes(&self.best.fit.model) {
            return;
        }
        let pinholes = pinholes(&self.best.fit, self.observations, HOPELESS_GAP);
        if let Some(fit) = pinholes
            && self.take_fit_if_better(Alternative::Pinhole, -NEEDED_GAIN, fit)
        {
            return;
        }
        for degree in [None, Some(TILT_DEGREE)] {
            let mut fit = self.best.fit.clone();
            if fit.smoothness.hold_directions(degree)
                && self.take_fit_if_better(Alternative::Plain { degree }, -NEEDED_GAIN, fit)
            {
                break;
            }
        }
    }

    fn drop_spline(&mut self) -> bool {
        self.take_if_better(Alternative::NoSpline, -NEEDED_GAIN, |model| {
            for camera in &mut model.cameras {
                camera.field.direction.spline = None;
            }
        })
    }

    /// Drops what the evidence no longer asks for: offsets of all cameras, else camera by camera,
    /// then splines.
    fn simplify(&mut self) {
        let with_offset: Vec<usize> = {
            let cameras = self.best.fit.model.cameras.iter().enumerate();
            let with_offset = cameras.filter(|(_, camera)| camera.offset().is_some());
            with_offset.map(|(camera_idx, _)| camera_idx).collect()
        };
        let mut remaining = with_offset.len();
        if remaining > 1
            && self.take_if_better(Alternative::AllCentral, -NEEDED_GAIN, |model| {
                model.cameras.iter_mut().for_each(CameraModel::drop_offset);
            })
        {
            remaining = 0;
        }
        for &camera_idx in &with_offset {
            // Beside another camera with offsets, a tie is no reason to think this one unlike it.
            let needed = match remaining {
                0 => break,
                1 => -NEEDED_GAIN,
                _ => NEEDED_GAIN,
            };
            let tried = Alternative::Central { camera_idx };
            if self.take_if_better(tried, needed, |model| {
                model.cameras[camera_idx].drop_offset();
            }) {
                remaining -= 1;
            }
        }
        let changed = remaining < with_offset.len();
        if self.best.fit.model.has_spline() && (changed || self.spline_is_idle()) {
            self.drop_spline();
        }
        self.plain();
    }

    fn take_if_better(
        &mut self,
        tried: Alternative,
        needed: f64,
        change: impl FnOnce(&mut Model),
    ) -> bool {
        let changed = self.best.fit.changed(self.observations, change);
        self.take_fit_if_better(tried, needed, changed)
    }

    fn take_fit_if_better(&mut self, tried: Alternative, needed: f64, fit: Fit) -> bool {
        // A model that the data leave open has no evidence for it; the one so far stands.
        let settled = Candidate::settle(fit, self.best.evidence, self.observations).ok();
        let gain = settled
            .as_ref()
            .map(|candidate| candidate.evidence - self.best.evidence);
        let taken = gain.is_some_and(|gain| gain > needed);
        self.tried.push(Choice { tried, gain, taken });
        if let Some(candidate) = settled.filter(|_| taken) {
            self.best = candidate;
        }
        taken
    }
}

/// Whether any camera may have an offset.
pub fn may_have_offsets(observations: &Observations) -> bool {
    (0..observations.sensors.len()).any(|idx| !observations.is_declared_central(idx))
}

/// Gives every camera an offset that is not declared to have none.
pub fn add_offsets(model: &mut Model, observations: &Observations) {
    for (camera_idx, camera) in model.cameras.iter_mut().enumerate() {
        if !observations.is_declared_central(camera_idx) {
            camera.free_offset(OFFSET_DEGREE);
        }
    }
}

fn set_spline(model: &mut Model, cells: f64) {
    for camera in &mut model.cameras {
        let sensor = camera.field.sensor;
        let longer_px = f64::from(sensor.width.max(sensor.height));
        let grid = SplineGrid::with_spacing(sensor, longer_px / cells);
        let spline = camera.field.direction.spline.take();
        camera.field.direction.spline =
            Some(spline.map_or_else(|| Spline::zero(grid), |old| old.resampled(grid)));
    }
}
