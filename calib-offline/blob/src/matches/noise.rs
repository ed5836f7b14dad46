//! How noisy the pixels of matches are, from their gaps.
//!
//! A gap has the variance `c + v m`: c is what the calibration leaves uncertain, v the variance of a pixel
//! coordinate, m what a pixel makes of the gap. Half of the squares of standard normal numbers are below q, so half
//! of the gaps are where `gap^2 <= q (c + v m)`, and v is the median of `(gap^2 / q - c) / m`. Wrong matches, as long
//! as they are the minority, hardly move it.
//!
//! Gaps see only the noise across the plane of the two rays. That within it, which makes most of the error in
//! depth, opens none; it is taken to be as large.

use super::blob_source::BlobSource;
use super::error::MatchesError;
use super::stream::each_match;
use calib_rays::measure::{Gap, PointSource, RigSource};
use calib_rays::remedy::Remedy;
use serde::Serialize;
use std::io::Read;
use std::path::Path;

/// Fewest gaps that say something: the noise is then known to 12 %, one standard deviation.
pub const MIN_GAPS: usize = 100;

/// Half of the squares of standard normal numbers are below this.
const MEDIAN_OF_SQUARES: f64 = 0.454_936_423_119_572_8;

/// 95 % of normal numbers are within so many standard deviations.
const SIGMAS_95: f64 = 1.96;

/// The noise of matches, with its 95 % interval: what chance leaves of a median of so many gaps, and of a
/// calibration whose own share of all gaps is anything from none to 1.96 of its standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoiseEstimate {
    /// Standard deviation of a pixel coordinate, px.
    pub px: f64,
    /// Lower end, px; 0 where the calibration alone may explain the gaps.
    pub low_px: f64,
    /// Upper end, px.
    pub high_px: f64,
    /// Gaps that it comes from.
    pub gaps: usize,
}

/// Why gaps do not say how noisy matches are.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoiseError {
    /// The rig does not know its uncertainty.
    #[error(
        "the rig says nothing of the uncertainty of these cameras, so that nothing is known of their gaps"
    )]
    NothingPredicted,
    /// Too few matches of two cameras have a point.
    #[error("{have} gaps do not say how noisy the matches are, it takes {MIN_GAPS}")]
    TooFew {
        /// Gaps.
        have: usize,
    },
    /// The calibration's own uncertainty is enough to explain the gaps.
    #[error(
        "the gaps are as small as the calibration alone makes them: the noise of the matches does not show in them, \
         and is at most {at_most_px:.4} px"
    )]
    NotSeen {
        /// Upper end of its 95 % interval, px.
        at_most_px: f64,
    },
}

impl Remedy for NoiseError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::NothingPredicted => {
                "estimate it with a calibration or a blob that has the uncertainty (pack without --no-uncertainty)"
            }
            Self::TooFew { .. } => "measure more points at once, or say it with --match-noise-px",
            Self::NotSeen { .. } => "say it with --match-noise-px, or calibrate with more poses",
        };
        Some(text.to_owned())
    }
}

/// How noisy the matches of `input` are; `file` is for messages only. Of matches of more than two cameras there is
/// no gap.
///
/// # Errors
/// [`MatchesError`]; inside the result, why the gaps do not say.
pub fn noise_with_blob(
    source: &BlobSource<'_>,
    file: &Path,
    input: &mut dyn Read,
) -> Result<Result<NoiseEstimate, NoiseError>, MatchesError> {
    estimate_noise(source, file, input)
}

/// The same with a calibration.
///
/// # Errors
/// Those of [`noise_with_blob`].
pub fn noise_with_calibration(
    source: &RigSource<'_>,
    file: &Path,
    input: &mut dyn Read,
) -> Result<Result<NoiseEstimate, NoiseError>, MatchesError> {
    estimate_noise(source, file, input)
}

fn estimate_noise<S: PointSource>(
    source: &S,
    file: &Path,
    mut input: &mut dyn Read,
) -> Result<Result<NoiseEstimate, NoiseError>, MatchesError> {
    let mut gaps = Vec::new();
    let mut points = 0;
    each_match(&source.cameras(), file, &mut input, |sightings| {
        if sightings.len() == 2 {
            points += usize::from(source.point(sightings).is_ok());
            gaps.extend(source.gap(sightings));
        }
    })?;
    Ok(if gaps.is_empty() && points > 0 {
        Err(NoiseError::NothingPredicted)
    } else {
        of_gaps(&gaps)
    })
}

fn of_gaps(gaps: &[Gap]) -> Result<NoiseEstimate, NoiseError> {
    let usable = |gap: &&Gap| gap.mm2_per_px2 > 0.0 && gap.gap_mm.is_finite();
    let gaps: Vec<&Gap> = gaps.iter().filter(usable).collect();
    let have = gaps.len();
    if have < MIN_GAPS {
        return Err(NoiseError::TooFew { have });
    }
    // Variances of which a share of the gaps ask for less, the calibration's share being so many times what is
    // predicted.
    let quantile_px = |share: f64, calibration: f64| {
        let wanted = |gap: &&Gap| {
            let gap_mm2 = gap.gap_mm * gap.gap_mm / MEDIAN_OF_SQUARES;
            (gap_mm2 - calibration * gap.calibration_mm2) / gap.mm2_per_px2
        };
        let mut wanted: Vec<f64> = gaps.iter().map(wanted).collect();
        let index = ((share * have as f64) as usize).min(have - 1);
        let (_, found, _) = wanted.select_nth_unstable_by(index, f64::total_cmp);
        found.max(0.0).sqrt()
    };
    let chance = 0.5 * SIGMAS_95 / (have as f64).sqrt();
    let high_px = quantile_px(0.5 + chance, 0.0);
    let px = quantile_px(0.5, 1.0);
    if px > 0.0 {
        Ok(NoiseEstimate {
            px,
            low_px: quantile_px(0.5 - chance, SIGMAS_95 * SIGMAS_95),
            high_px,
            gaps: have,
        })
    } else {
        Err(NoiseError::NotSeen {
            at_most_px: high_px,
        })
    }
}

#[cfg(test)]
mod tests;
