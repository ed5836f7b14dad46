//! The estimate made again without what the evidence chose, for views that it never saw to judge.

use super::choice::{self, Alternative, Candidate, Choice};
use super::error::EstimateError;
use super::estimate::{Estimate, Forbidden, anchored, finish};
use super::refit::settled;
use crate::adjust::{CameraModel, Model};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a simpler model does without.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Simpler {
    /// Every camera is central.
    NoOffsets,
    /// No direction has a spline.
    NoSpline,
    /// Neither offsets nor splines.
    Neither,
    /// Plain lenses: neither, and the polynomials of all directions held at what a plain lens does.
    Plain,
}

/// The estimate without something.
#[derive(Debug, Clone)]
pub struct SimplerEstimate {
    /// The estimate.
    pub estimate: Estimate,
    /// Twice the log evidence that it is ahead of the one with it.
    pub evidence_gain: f64,
}

/// An estimate whose cameras are all central, and what that costs.
#[derive(Debug, Clone)]
pub struct CentralEstimate {
    /// The estimate.
    pub estimate: Estimate,
    /// Twice the log evidence that the model with offsets is ahead of it.
    pub evidence_loss: f64,
}

impl Simpler {
    /// Those that a model with offsets or splines can be compared with, of rising simplicity; none for any other.
    pub fn of(estimate: &Estimate) -> &'static [Self] {
        match (estimate.has_offsets(), estimate.model.has_spline()) {
            (true, true) => &[Self::NoOffsets, Self::NoSpline, Self::Neither, Self::Plain],
            (true, false) => &[Self::NoOffsets, Self::Plain],
            (false, true) => &[Self::NoSpline, Self::Plain],
            (false, false) => &[],
        }
    }

    /// Whether an estimate has anything of what this does without.
    pub fn changes(self, estimate: &Estimate) -> bool {
        let spline = estimate.model.has_spline();
        match self {
            Self::NoOffsets => estimate.has_offsets(),
            Self::NoSpline => spline,
            Self::Neither => estimate.has_offsets() || spline,
            Self::Plain => true,
        }
    }

    /// As what the model's choice calls it.
    fn as_choice(self, gain: f64) -> impl Iterator<Item = Choice> {
        let tried = match self {
            Self::NoOffsets => &[Alternative::AllCentral][..],
            Self::NoSpline => &[Alternative::NoSpline],
            Self::Neither => &[Alternative::AllCentral, Alternative::NoSpline],
            Self::Plain => &[Alternative::AllCentral, Alternative::Plain { degree: None }],
        };
        // What two changes gain together is written to the first.
        tried.iter().enumerate().map(move |(k, tried)| Choice {
            tried: *tried,
            gain: Some(if k == 0 { gain } else { 0.0 }),
            taken: true,
        })
    }

    fn apply(self, model: &mut Model) {
        if self != Self::NoSpline {
            model.cameras.iter_mut().for_each(CameraModel::drop_offset);
        }
        if self != Self::NoOffsets {
            for camera in &mut model.cameras {
                camera.field.direction.spline = None;
            }
        }
    }
}

impl Estimate {
    /// Whether any camera has an offset.
    pub fn has_offsets(&self) -> bool {
        let mut cameras = self.model.cameras.iter();
        cameras.any(|camera| camera.offset().is_some())
    }

    /// The same without something that it has.
    ///
    /// Cost: a few rounds.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn without(&self, simpler: Simpler) -> Result<SimplerEstimate, EstimateError> {
        let observations = self.observations.clone();
        let with = self.fit.clone().round(&observations)?;
        let mut fit = self
            .fit
            .changed(&observations, |model| simpler.apply(model));
        if simpler == Simpler::Plain {
            fit.smoothness.hold_directions(None);
        }
        let without = settled(fit, &observations)?;
        Ok(SimplerEstimate {
            evidence_gain: without.evidence - with,
            estimate: self.remade(without.fit, observations),
        })
    }

    /// The same without the offsets of all cameras.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn made_central(&self) -> Result<CentralEstimate, EstimateError> {
        let central = self.without(Simpler::NoOffsets)?;
        Ok(CentralEstimate {
            evidence_loss: -central.evidence_gain,
            estimate: central.estimate,
        })
    }

    /// The estimate itself without something that unseen views speak against: what is left of the model is simplified by
    /// the evidence, and adjusted to the end.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn made_simpler(&self, simpler: Simpler) -> Result<Self, EstimateError> {
        let SimplerEstimate {
            estimate,
            evidence_gain,
        } = self.without(simpler)?;
        let observations = estimate.observations;
        let mut choices = estimate.choices;
        choices.extend(simpler.as_choice(evidence_gain));
        let candidate = Candidate::settle(estimate.fit, f64::NEG_INFINITY, &observations)?;
        let candidate = choice::simplify(candidate, &mut choices, &observations);
        let fit = anchored(candidate.fit, &observations);
        let forbidden = self.forbidden.clone().map(|forbidden| Forbidden {
            gain: forbidden.gain - evidence_gain,
            ..forbidden
        });
        Ok(Self {
            forbidden,
            ..finish(fit, observations, self.neighbor_correlation, choices)
        })
    }
}
