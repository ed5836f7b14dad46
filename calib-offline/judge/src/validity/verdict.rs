//! What was found about an old calibration, and the verdict on it.

use super::amounts::Amount;
use super::boards::MeasuredBoards;
use super::residuals::Residuals;
use crate::cause::{Cause, Code};
use crate::grade::Grade;
use crate::suspects::COSTLY;
use serde::Serialize;

/// A change of so many standard deviations gains the evidence that is asked for, in nearly all cases:
/// 3.6 do on average.
pub(super) const NOTICED_SD: f64 = 5.0;
/// A pass that lets a change go unnoticed is none if that costs more than so many times the noise of a
/// measured length, and more than the old calibration hides by itself.
const UNNOTICED: f64 = 2.0;

/// Something that changed, with its numbers.
#[derive(Debug, Clone, Serialize)]
pub struct Found {
    /// In the words that all checks share.
    #[serde(flatten)]
    pub cause: Cause,
    /// Twice the log evidence that it gains.
    pub evidence: f64,
    /// Its signed numbers.
    pub amounts: Vec<Amount>,
}

/// What the new boards show of one camera.
#[derive(Debug, Clone, Serialize)]
pub struct Seen {
    /// The camera.
    pub name: String,
    /// Corners.
    pub corners: usize,
    /// Area that they cover over the area that is calibrated.
    pub share: f64,
}

/// Whether an old calibration still holds.
#[derive(Debug, Clone, Serialize)]
pub struct Validity {
    /// Pass: nothing that costs; doubtful: too little is seen; fail: it no longer holds.
    pub verdict: Grade,
    /// What the verdict rests on, what lowered it first.
    pub reasons: Vec<String>,
    /// The first cause that lowered the verdict.
    pub cause: Option<Code>,
    /// What all that changed costs measured points, RMS at the working distances, mm.
    pub cost_mm: f64,
    /// Above this cost the calibration no longer holds, mm.
    pub limit_mm: f64,
    /// What the calibration leaves open of points, RMS, mm.
    pub left_open_mm: f64,
    /// A single change may cost this much and go unnoticed, RMS, mm; `None` if that is not known.
    pub unnoticed_mm: Option<f64>,
    /// Distances of the boards of the calibration: least, middle, largest, mm.
    pub distances_mm: Vec<f64>,
    /// What changed, most important first.
    pub causes: Vec<Found>,
    /// What the data cannot tell.
    pub cannot_tell: Vec<String>,
    /// New poses used.
    pub poses: Vec<usize>,
    /// Per camera.
    pub cameras: Vec<Seen>,
    /// RMS residual of the new corners from the old rig, each board where it fits best, px.
    pub rms_px: f64,
    /// The same of the old corners, px.
    pub old_rms_px: f64,
    /// The new boards, measured with the old rig; two cameras only.
    pub boards: Option<MeasuredBoards>,
    /// The boards of the calibration, likewise.
    pub old_boards: Option<MeasuredBoards>,
}

impl Validity {
    /// The verdict from what was found; `noise_mm` is the noise of a measured length.
    pub(super) fn judge(&mut self, residuals: &Residuals, noise_mm: f64) {
        let mut reasons: Vec<(Grade, String)> = self
            .causes
            .iter()
            .map(|found| (found.cause.grade, found.cause.text.clone()))
            .collect();
        let cost_mm = self.cost_mm;
        let together = (cost_mm > self.limit_mm).then_some(Grade::Fail);
        let summary = if self.causes.is_empty() {
            "nothing changed that the new boards show".to_owned()
        } else {
            format!(
                "what changed moves points by {cost_mm:.3} mm RMS in all; the limit is {:.3} mm, {COSTLY} times what \
                 the calibration leaves open",
                self.limit_mm
            )
        };
        reasons.push((together.unwrap_or(Grade::Pass), summary));
        if let Some((ratio, limit)) = residuals
            .disagreement
            .filter(|(ratio, limit)| ratio > limit)
        {
            reasons.push((
                Grade::Doubtful,
                format!(
                    "the cameras disagree about the new boards, residuals {:.2} times those of each camera alone where \
                     chance leaves {:.2}, and no change that is looked for explains it: calibrate again",
                    ratio.sqrt(),
                    limit.sqrt()
                ),
            ));
        }
        let allowed_mm = (UNNOTICED * noise_mm).max(NOTICED_SD * self.left_open_mm);
        match self.unnoticed_mm {
            Some(mm) if mm <= allowed_mm => reasons.push((
                Grade::Pass,
                format!("a change that costs less than {mm:.3} mm may go unnoticed"),
            )),
            Some(mm) => {
                let boards = self.poses.len() as f64;
                let more = (boards * ((mm / allowed_mm).powi(2) - 1.0)).ceil().max(1.0);
                let few = self.cameras.iter().min_by(|a, b| a.share.total_cmp(&b.share));
                let where_to = few.map_or(String::new(), |seen| {
                    format!(
                        " (camera {} sees boards in {:.0} % of its calibrated area)",
                        seen.name,
                        100.0 * seen.share
                    )
                });
                reasons.push((
                    Grade::Doubtful,
                    format!(
                        "a change that costs {mm:.3} mm may go unnoticed, where {allowed_mm:.3} mm are allowed: \
                         record {more:.0} more boards, tilted by 20 degrees, near and far, all over \
                         the images{where_to}"
                    ),
                ));
            }
            None => reasons.push((
                Grade::Doubtful,
                "the new boards leave changes open: record three boards or more, tilted, near and far".to_owned(),
            )),
        }
        reasons.sort_by_key(|reason| std::cmp::Reverse(reason.0));
        self.verdict = reasons.first().map_or(Grade::Pass, |(grade, _)| *grade);
        let lowering = self.causes.iter().map(|found| &found.cause);
        self.cause = lowering
            .filter(|cause| cause.grade > Grade::Pass)
            .reduce(|worst, cause| {
                if cause.grade > worst.grade {
                    cause
                } else {
                    worst
                }
            })
            .or_else(|| {
                let fails = self.verdict == Grade::Fail;
                self.causes
                    .first()
                    .map(|found| &found.cause)
                    .filter(|_| fails)
            })
            .map(|cause| cause.code);
        self.reasons = reasons
            .into_iter()
            .map(|(grade, text)| match grade {
                Grade::Pass => text,
                _ => format!("{grade}: {text}"),
            })
            .collect();
    }
}
