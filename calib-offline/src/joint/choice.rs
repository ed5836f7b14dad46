//! What the model is made of, chosen by the evidence: spline spacing, and per camera central or
//! not. Every alternative that was tried is reported with its evidence.

use super::estimate::EstimateError;
use super::fit::Fit;
use crate::adjust::{Model, Observations};
use crate::field::SmoothMap;
use crate::field::spline::{Spline, SplineGrid};
use serde::{Deserialize, Serialize};

/// Spacings tried, in cells along the sensor's longer side, coarse to fine: 112, 56, 40 and 28 px
/// on 1280 px. The search stops when the evidence falls.
const CELLS: [f64; 4] = [11.5, 23.0, 32.0, 46.0];
/// Degree of the offset's polynomial: a cubic follows windows and flat ports, the higher degrees,
/// held back by weights of their own, curved ports and mirrors.
const OFFSET_DEGREE: usize = 7;
/// Rounds after a change of the model, at most.
const ROUNDS: usize = 8;
/// A round that changes twice the log evidence by less settles the fit.
const SETTLED: f64 = 0.5;
/// A model is given up when it is behind its rival by more than this and so many times the change
/// of its last round: weights that are still on their way gain tens, not more.
const HOPELESS_GAP: f64 = 100.0;
const HOPELESS_CHANGES: f64 = 10.0;
/// Twice the log evidence that a more flexible model must gain: "positive" on the scale of Kass
/// and Raftery (1995). Ties go to the simpler model.
pub const NEEDED_GAIN: f64 = 4.0;

/// A change of the model that was best until then.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Alternative {
    /// Every camera gets an offset: its rays need not meet in one point.
    Offsets,
    /// Every camera's direction gets a spline, or one of another spacing.
    Spline {
        /// Cells along the sensor's longer side.
        cells: f64,
    },
    /// One camera loses its offset.
    Central {
        /// Index of the camera.
        camera_idx: usize,
    },
    /// All cameras lose their splines.
    NoSpline,
}

/// An alternative that was tried.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
        for _ in 0..ROUNDS {
            let now = fit.round(observations)?;
            let change = (now - evidence).abs();
            evidence = now;
            if change < SETTLED || rival - now > HOPELESS_GAP + HOPELESS_CHANGES * change {
                break;
            }
        }
        Ok(Self { fit, evidence })
    }
}

/// Takes what the evidence asks for, starting from a settled fit without spline and offset.
pub fn choose(start: Candidate, observations: &Observations) -> (Candidate, Vec<Choice>) {
    let mut best = start;
    let mut tried = Vec::new();
    take_if_better(
        &mut best,
        &mut tried,
        Alternative::Offsets,
        NEEDED_GAIN,
        observations,
        add_offsets,
    );
    for cells in CELLS {
        let taken = take_if_better(
            &mut best,
            &mut tried,
            Alternative::Spline { cells },
            NEEDED_GAIN,
            observations,
            |model| set_spline(model, cells),
        );
        if !taken {
            break;
        }
    }
    simplify(&mut best, &mut tried, observations);
    (best, tried)
}

/// Drops what the evidence no longer asks for: offsets camera by camera, then splines.
pub fn simplify(best: &mut Candidate, tried: &mut Vec<Choice>, observations: &Observations) {
    for camera_idx in 0..best.fit.model.cameras.len() {
        if best.fit.model.cameras[camera_idx].field.offset.is_some() {
            take_if_better(
                best,
                tried,
                Alternative::Central { camera_idx },
                -NEEDED_GAIN,
                observations,
                |model| model.cameras[camera_idx].field.offset = None,
            );
        }
    }
    if best
        .fit
        .model
        .cameras
        .iter()
        .any(|c| c.knot_order().is_some())
    {
        take_if_better(
            best,
            tried,
            Alternative::NoSpline,
            -NEEDED_GAIN,
            observations,
            |model| {
                for camera in &mut model.cameras {
                    camera.field.direction.spline = None;
                }
            },
        );
    }
}

fn take_if_better(
    best: &mut Candidate,
    choices: &mut Vec<Choice>,
    tried: Alternative,
    needed: f64,
    observations: &Observations,
    change: impl FnOnce(&mut Model),
) -> bool {
    // A model that the data leave open has no evidence for it; the one so far stands.
    let changed = best.fit.changed(observations, change);
    let Ok(candidate) = Candidate::settle(changed, best.evidence, observations) else {
        choices.push(Choice {
            tried,
            gain: None,
            taken: false,
        });
        return false;
    };
    let gain = candidate.evidence - best.evidence;
    let taken = gain > needed;
    choices.push(Choice {
        tried,
        gain: Some(gain),
        taken,
    });
    if taken {
        *best = candidate;
    }
    taken
}

fn add_offsets(model: &mut Model) {
    for camera in &mut model.cameras {
        camera.field.offset = Some(SmoothMap::zero(OFFSET_DEGREE));
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
