//! Does the calibration still fit? The device counts the gaps of its own triangulations and compares
//! them with what its blob predicts.
//!
//! The gap is how far the two rays of a match pass each other. Pixel noise opens it both ways alike, so
//! that its mean, taken with its sign ([`Measurement::signed_gap_mm`]), stays near zero and its size near
//! the predicted standard deviation. A rig that has been bent or knocked opens it one way.
//!
//! **What gaps cannot see**: errors along the plane of the two rays. A turn of one camera about the axis
//! across that plane, a longer baseline, another scale: all of them move points, mostly in depth, and
//! open no gap. A rig that fits by its gaps may still measure wrong lengths; only known lengths show that.
//!
//! Counts are halved when there are [`FORGET_AT`] of them, so that what was long ago weighs little. Sums
//! are f32, in the order of the matches: every target reports the same bits.

mod histogram;

use histogram::Histogram;
use ray_runtime::Measurement;
use serde::{Deserialize, Serialize};

/// Points after which all counts are halved.
pub const FORGET_AT: u32 = 1 << 16;

/// Fewest points that say something: the mean of 100 is known to a tenth of a standard deviation.
pub const MIN_POINTS: u32 = 100;

/// A mean beyond this share of the predicted standard deviation is a shift: it makes gaps, squared and
/// averaged, a quarter larger than noise does.
pub const MAX_SHIFT: f32 = 0.5;

/// 95 % of the gaps are within 1.96 predicted standard deviations; within 1.5 times that, pixels are
/// taken to be as noisy as the prediction has them.
pub const MAX_SPREAD: f32 = 1.5;

/// Of a normal distribution, in standard deviations: what 95 % stay within.
const SIGMAS_95: f32 = 1.96;

/// A single gap counts into the mean with at most so many predicted standard deviations, so that a few
/// wrong matches do not look like a shift.
const CLIPPED_AT: f32 = 4.0;

/// The gaps of the points measured so far; about 700 bytes.
#[derive(Debug, Clone)]
pub struct Health {
    points: u32,
    predicted: u32,
    signed_mm: f32,
    size_mm: f32,
    sigma_mm: f32,
    signed_ratio: f32,
    sizes_mm: Histogram,
    ratios: Histogram,
}

impl Default for Health {
    fn default() -> Self {
        Self::new()
    }
}

impl Health {
    /// Nothing measured yet.
    pub const fn new() -> Self {
        Self {
            points: 0,
            predicted: 0,
            signed_mm: 0.0,
            size_mm: 0.0,
            sigma_mm: 0.0,
            signed_ratio: 0.0,
            sizes_mm: Histogram::new(),
            ratios: Histogram::new(),
        }
    }

    /// Counts a point.
    pub fn note(&mut self, measured: &Measurement) {
        let predicted = measured.covariance.as_ref();
        self.note_gap(
            measured.signed_gap_mm(),
            predicted.map_or(0.0, |covariance| covariance.gap_mm2),
        );
    }

    /// Counts a gap with its sign, mm, and the variance that is predicted for it, mm^2: 0 where nothing is.
    pub fn note_gap(&mut self, gap_mm: f32, variance_mm2: f32) {
        if !gap_mm.is_finite() {
            return;
        }
        if self.points >= FORGET_AT {
            self.halve();
        }
        self.points += 1;
        self.signed_mm += gap_mm;
        self.size_mm += gap_mm.abs();
        self.sizes_mm.count(gap_mm.abs());
        // A blob that predicts no gap at all predicts nothing to compare with.
        if variance_mm2 > 0.0 && variance_mm2.is_finite() {
            let sigma_mm = libm::sqrtf(variance_mm2);
            let ratio = gap_mm / sigma_mm;
            self.predicted += 1;
            self.sigma_mm += sigma_mm;
            self.signed_ratio += ratio.clamp(-CLIPPED_AT, CLIPPED_AT);
            self.ratios.count(ratio.abs());
        }
    }

    fn halve(&mut self) {
        self.points /= 2;
        self.predicted /= 2;
        for sum in [
            &mut self.signed_mm,
            &mut self.size_mm,
            &mut self.sigma_mm,
            &mut self.signed_ratio,
        ] {
            *sum *= 0.5;
        }
        self.sizes_mm.halve();
        self.ratios.halve();
    }

    /// What has been counted, in the form that travels; `None` before the first point.
    pub fn report(&self) -> Option<GapReport> {
        if self.points == 0 {
            return None;
        }
        let per_point = 1.0 / self.points as f32;
        Some(GapReport {
            points: self.points,
            mean_signed_mm: self.signed_mm * per_point,
            mean_size_mm: self.size_mm * per_point,
            within_95_mm: self.sizes_mm.quantile(95),
            predicted: (self.predicted > 0).then(|| {
                let per_point = 1.0 / self.predicted as f32;
                Predicted {
                    points: self.predicted,
                    mean_sigma_mm: self.sigma_mm * per_point,
                    shift: self.signed_ratio * per_point,
                    spread: self.ratios.quantile(95) * (1.0 / SIGMAS_95),
                }
            }),
        })
    }
}

/// The gaps of what a device has measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GapReport {
    /// Points counted, older ones with less weight: see [`FORGET_AT`].
    pub points: u32,
    /// Mean of the gaps with their sign, mm: positive where the second camera's ray is above the
    /// first's ([`Measurement::is_second_above`]).
    pub mean_signed_mm: f32,
    /// Mean of their size, mm.
    pub mean_size_mm: f32,
    /// 95 % of them are smaller, mm; to some 3 %.
    pub within_95_mm: f32,
    /// The same beside what the blob predicts; `None` if it predicts nothing.
    pub predicted: Option<Predicted>,
}

/// Gaps beside their predicted standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Predicted {
    /// Points with a prediction.
    pub points: u32,
    /// Mean of the predicted standard deviations, mm.
    pub mean_sigma_mm: f32,
    /// Mean gap in predicted standard deviations, with its sign. Noise gives 0; what the calibration
    /// itself leaves open gives some tenths.
    pub shift: f32,
    /// What 95 % of the gaps stay within, over what 95 % should: 1 if pixels are as noisy as the request or the blob
    /// says, or where neither does, as the corners of the calibration were.
    pub spread: f32,
}

/// What a [`GapReport`] says of the calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Verdict {
    /// The blob says nothing of gaps.
    NothingPredicted,
    /// Fewer points than [`MIN_POINTS`].
    TooFewPoints,
    /// Gaps are as predicted.
    Fits,
    /// Gaps are larger than predicted, both ways: pixels are noisier than the prediction has them, some
    /// matches are wrong, or the optics have changed in places.
    Scattered,
    /// Gaps open one way: the cameras have moved against each other.
    Shifted,
}

impl GapReport {
    /// What it says of the calibration.
    pub fn verdict(&self) -> Verdict {
        match &self.predicted {
            None => Verdict::NothingPredicted,
            Some(found) if found.points < MIN_POINTS => Verdict::TooFewPoints,
            Some(found) if !(found.shift.abs() <= MAX_SHIFT) => Verdict::Shifted,
            Some(found) if !(found.spread <= MAX_SPREAD) => Verdict::Scattered,
            Some(_) => Verdict::Fits,
        }
    }
}

/// In plain words: the verdict, the figures with sign and unit, and what they cannot show.
impl core::fmt::Display for GapReport {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let verdict = self.verdict();
        match verdict {
            Verdict::NothingPredicted => {
                write!(
                    out,
                    "whether the calibration still fits is not known: its blob predicts no gaps"
                )?;
            }
            Verdict::TooFewPoints => write!(
                out,
                "whether the calibration still fits is not known yet: it takes {MIN_POINTS} points"
            )?,
            Verdict::Fits => write!(out, "the calibration still fits, as far as gaps show")?,
            Verdict::Scattered => write!(
                out,
                "the gaps scatter more than predicted: the matches are noisier than was said (or, where nothing was \
                 said, than the calibration's corners; measure --match-noise-px says it), some of them are wrong, or the \
                 optics have changed in places"
            )?,
            Verdict::Shifted => write!(
                out,
                "the calibration no longer fits: the cameras have moved against each other; calibrate again"
            )?,
        }
        write!(
            out,
            ". Gaps of {} points: mean {:+.4} mm (the second camera's rays pass {} the first's), size {:.4} mm, \
             95 % within {:.4} mm",
            self.points,
            self.mean_signed_mm,
            if self.mean_signed_mm < 0.0 {
                "below"
            } else {
                "above"
            },
            self.mean_size_mm,
            self.within_95_mm,
        )?;
        if let Some(found) = &self.predicted {
            write!(
                out,
                "; predicted: standard deviation {:.4} mm, so the mean is {:+.2} of it and 95 % are {:.2} times as wide",
                found.mean_sigma_mm, found.shift, found.spread
            )?;
        }
        write!(
            out,
            ". Gaps do not see what moves points within the plane of the two rays, such as another distance or \
             angle between the cameras: only known lengths show that"
        )
    }
}

#[cfg(test)]
mod tests;
