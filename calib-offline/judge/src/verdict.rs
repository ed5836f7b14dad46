//! Pass, doubtful or fail, with reasons: every figure next to its threshold.

use super::agreement::{Agreement, Ratio};
use super::cause::Cause;
pub use super::grade::Grade;
use super::half_data::{HalfData, Split};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The judgement with its reasons.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Verdict {
    /// The grade.
    pub grade: Grade,
    /// Each with its figure and threshold; those that lowered the grade first.
    pub reasons: Vec<String>,
}

/// Where a figure stops being good, and where it stops being usable. What depends on a rig's geometry,
/// on the number of corners or on their noise has no limit here: it is judged by what chance leaves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Thresholds {
    /// Corner noise, px per axis. Sub-pixel detectors reach 0.02 to 0.1 px on sharp images; half a
    /// pixel means blur or a board that is not what the manifest says.
    pub sigma_px: (f64, f64),
    /// Held-out residual over the fitted one: beyond, the calibration is of no use on boards that it
    /// never saw.
    pub held_out_ratio: f64,
    /// Distance error of neighboring corners on held-out boards over what the noise of the corners
    /// makes of it: at the first, half of the squared error is not noise.
    pub neighbor_ratio: (f64, f64),
    /// What the cameras disagree about, over what the calibration leaves open anyway.
    pub disagreement: f64,
    /// Share of corners rejected as outliers that is a fail.
    pub rejected_share: f64,
    /// Share of views that had to be left out, split from their pair or renumbered; above it,
    /// something is wrong with how the recording is made.
    pub suspect_views: f64,
    /// Fewer poses are a fail. How many a recording needs beyond follows from its geometry (`few-poses`).
    pub poses: usize,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self {
            sigma_px: (0.3, 2.0),
            held_out_ratio: 5.0,
            neighbor_ratio: (2f64.sqrt(), 10.0),
            disagreement: 2.0,
            rejected_share: 0.3,
            suspect_views: 0.1,
            poses: 3,
        }
    }
}

impl Verdict {
    /// The verdict with what was found about the recording: causes that lower a grade are reasons.
    pub fn with_causes(mut self, causes: &[Cause]) -> Self {
        let lowering = |cause: &&Cause| cause.grade > Grade::Pass;
        let reasons: Vec<String> = causes
            .iter()
            .filter(lowering)
            .map(|cause| format!("{}: {}", cause.grade, cause.text))
            .collect();
        let worst = causes.iter().map(|cause| cause.grade).max();
        self.grade = self.grade.max(worst.unwrap_or(Grade::Pass));
        self.reasons.splice(0..0, reasons);
        self
    }
}

/// What is judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// Standard deviation of the corner noise per axis, px.
    pub sigma_px: f64,
    /// RMS of the residual vectors of all corners, rejected ones too, px per axis.
    pub all_sigma_px: f64,
    /// Like with like; `None` without a held-out check.
    pub agreement: Option<Agreement>,
    /// What a pixel is at the working distance, mm.
    pub mm_per_px: f64,
    /// RMS of what the calibration leaves open of points at the working distance, mm.
    pub left_open_mm: Option<f64>,
    /// RMS error of neighboring corners' distance on held-out boards, and what noise makes of it, mm.
    pub neighbors_mm: Option<(f64, f64)>,
    /// Halves of the poses that were compared.
    pub halves: Vec<(Split, HalfData)>,
    /// Corners used and rejected.
    pub corners: (usize, usize),
    /// Views that could not be used as they were recorded, and all views.
    pub suspect_views: (usize, usize),
    /// Poses used; `None` where one is enough.
    pub pose_count: Option<usize>,
    /// Whether the rays of every camera meet in a point.
    pub is_central: bool,
    /// Whether the adjustment came to rest.
    pub settled: bool,
}

type Reason = (Grade, String);

/// Judges a calibration.
pub fn judge(figures: &Figures, thresholds: &Thresholds) -> Verdict {
    let mut reasons = vec![noise(figures, thresholds)];
    match &figures.agreement {
        Some(agreement) => reasons.extend(like_with_like(agreement, figures, thresholds)),
        None => reasons.push((
            Grade::Doubtful,
            "too few poses for a held-out check".to_string(),
        )),
    }
    reasons.extend(
        figures
            .neighbors_mm
            .map(|mm| neighbors(mm, figures, thresholds)),
    );
    let halves = figures.halves.iter();
    reasons.extend(halves.map(|(split, half)| half_data(*split, half, figures.is_central)));
    reasons.push(rejected(figures, thresholds));
    let (suspect, views) = figures.suspect_views;
    if suspect as f64 > thresholds.suspect_views * views as f64 {
        reasons.push((
            Grade::Doubtful,
            format!(
                "{suspect} of {views} views could not be used as recorded (see what was left out), \
                 above {:.0} %",
                100.0 * thresholds.suspect_views
            ),
        ));
    }
    if let Some(poses) = figures.pose_count.filter(|have| *have < thresholds.poses) {
        reasons.push((
            Grade::Fail,
            format!("{poses} poses, {} or more needed", thresholds.poses),
        ));
    }
    if !figures.settled {
        reasons.push((
            Grade::Doubtful,
            "the adjustment did not come to rest".to_string(),
        ));
    }
    // Worst first; the sort keeps the order within a grade.
    reasons.sort_by_key(|reason| std::cmp::Reverse(reason.0));
    Verdict {
        grade: reasons.first().map_or(Grade::Pass, |reason| reason.0),
        reasons: reasons
            .into_iter()
            .map(|(grade, text)| format!("{grade}: {text}"))
            .collect(),
    }
}

/// The grade of a value by two limits; NaN fails.
fn above(value: f64, (doubtful, fail): (f64, f64)) -> Grade {
    if value <= doubtful {
        Grade::Pass
    } else if value <= fail {
        Grade::Doubtful
    } else {
        Grade::Fail
    }
}

fn noise(figures: &Figures, thresholds: &Thresholds) -> Reason {
    let (doubtful, fail) = thresholds.sigma_px;
    let grade = above(figures.sigma_px, thresholds.sigma_px);
    let relation = match grade {
        Grade::Pass => format!("within {doubtful} px"),
        Grade::Doubtful => format!("above {doubtful} px"),
        Grade::Fail => format!("above {fail} px"),
    };
    let text = format!(
        "corner noise {:.3} px, {:.3} mm at the working distance, {relation}",
        figures.sigma_px,
        figures.sigma_px * figures.mm_per_px
    );
    (grade, text)
}

/// Boards that fit to so little say nothing against a calibration: it is what a field of smooth functions leaves of
/// a lens (METHOD 2.1), and what noise hides in any image.
const NEGLIGIBLE_PX: f64 = 0.001;

/// Residuals of the same corners.
fn like_with_like(
    agreement: &Agreement,
    figures: &Figures,
    thresholds: &Thresholds,
) -> Vec<Reason> {
    let mut reasons = Vec::new();
    let kinds = [
        ("a pose for each view", agreement.mono),
        ("a pose for each board", agreement.stereo),
    ];
    for (kind, ratio) in kinds {
        let Some(found) = ratio else { continue };
        // Boards at the edge of those learned from have more than an average share of what is open: what is
        // more than chance must cost as well.
        let excess_px = (found.rms_px.powi(2) - found.beside_px.powi(2))
            .max(0.0)
            .sqrt();
        let costs = figures
            .left_open_mm
            .is_none_or(|open| excess_px * figures.mm_per_px > thresholds.disagreement * open);
        let grade = if found.rms_px <= NEGLIGIBLE_PX {
            Grade::Pass
        } else if !(found.ratio <= thresholds.held_out_ratio) {
            Grade::Fail
        } else if found.is_unlikely() && (costs || found.ratio < 1.0) {
            Grade::Doubtful
        } else {
            Grade::Pass
        };
        let text = format!(
            "held-out over fitted residual of the same corners, {kind}: {}",
            ratio_words(&found, figures.mm_per_px)
        );
        reasons.push((grade, text));
    }
    if let Some(found) = agreement.cameras {
        let mm = agreement.disagreement_px * figures.mm_per_px;
        let costs = figures
            .left_open_mm
            .is_some_and(|open| mm > thresholds.disagreement * open);
        let grade = if found.is_unlikely() && costs {
            Grade::Doubtful
        } else {
            Grade::Pass
        };
        let text = format!(
            "cameras about where boards are (one pose for all over one for each): {}",
            ratio_words(&found, figures.mm_per_px)
        );
        reasons.push((grade, text));
    }
    reasons
}

fn ratio_words(found: &Ratio, mm_per_px: f64) -> String {
    let [low, high] = found.by_chance;
    format!(
        "{:.3}, {low:.3} to {high:.3} by chance ({:.3} px, {:.3} mm)",
        found.ratio,
        found.rms_px,
        found.rms_px * mm_per_px
    )
}

/// What is more than the corners' noise must cost as well, as for the ratios: images without noise leave errors
/// of the corners themselves, a few micrometers.
fn neighbors(
    (found_mm, noise_mm): (f64, f64),
    figures: &Figures,
    thresholds: &Thresholds,
) -> Reason {
    let ratio = found_mm / noise_mm;
    let excess_mm = (found_mm.powi(2) - noise_mm.powi(2)).max(0.0).sqrt();
    let costs = figures
        .left_open_mm
        .is_none_or(|open| excess_mm > thresholds.disagreement * open);
    let grade = match above(ratio, thresholds.neighbor_ratio) {
        Grade::Doubtful if !costs => Grade::Pass,
        grade => grade,
    };
    let text = format!(
        "held-out neighbor distance error {found_mm:.4} mm, {ratio:.2} of what the corners' noise \
         makes of it, {:.2} allowed{}",
        thresholds.neighbor_ratio.0,
        if grade == Grade::Pass && ratio > thresholds.neighbor_ratio.0 {
            " where it costs"
        } else {
            ""
        }
    );
    (grade, text)
}

/// Half of a recording in time holds no field without a center: its prediction is too small (METHOD 9.5, 10).
fn half_data(split: Split, half: &HalfData, is_central: bool) -> Reason {
    let [_, high] = half.ratio_by_chance;
    let figures = format!(
        "{}: calibrations differ by {:.4} mm RMS, {:.2} of the predicted, up to {high:.2} by chance",
        split.word(),
        half.difference_rms_mm,
        half.ratio
    );
    let is_held = is_central || split == Split::InTurn;
    if half.is_larger() && is_held {
        (Grade::Doubtful, figures)
    } else if half.shows_nothing() || !is_held {
        (Grade::Pass, format!("{figures}, which shows nothing"))
    } else {
        (Grade::Pass, figures)
    }
}

/// Outliers cost what they would as errors of a measurement.
fn rejected(figures: &Figures, thresholds: &Thresholds) -> Reason {
    let (used, rejected) = figures.corners;
    let share = rejected as f64 / (used + rejected).max(1) as f64;
    let limit_px = thresholds.sigma_px.0;
    let grade = if share > thresholds.rejected_share {
        Grade::Fail
    } else if rejected > 0 && figures.all_sigma_px > limit_px {
        Grade::Doubtful
    } else {
        Grade::Pass
    };
    let text = format!(
        "{:.3} % of corners rejected; with them the residual is {:.3} px per axis, {limit_px} px allowed",
        100.0 * share,
        figures.all_sigma_px
    );
    (grade, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(ratio: f64) -> Ratio {
        Ratio {
            rms_px: 0.07 * ratio,
            beside_px: 0.07,
            ratio,
            by_chance: [1.0, 1.04],
        }
    }

    fn good() -> Figures {
        Figures {
            sigma_px: 0.05,
            all_sigma_px: 0.06,
            agreement: Some(Agreement {
                mono: Some(ratio(1.02)),
                stereo: Some(ratio(1.02)),
                cameras: Some(ratio(1.02)),
                disagreement_px: 0.0,
            }),
            mm_per_px: 0.3,
            left_open_mm: Some(0.007),
            neighbors_mm: Some((0.02, 0.02)),
            halves: vec![(Split::InTurn, half(1.3))],
            corners: (5000, 10),
            suspect_views: (1, 68),
            pose_count: Some(34),
            is_central: true,
            settled: true,
        }
    }

    fn half(ratio: f64) -> HalfData {
        HalfData {
            poses: [17, 17],
            points: 100,
            difference_rms_mm: 0.01 * ratio,
            predicted_rms_mm: 0.01,
            ratio,
            modes: 10.0,
            ratio_by_chance: [0.4, 1.7],
        }
    }

    /// Makes one figure bad.
    type Spoil = fn(&mut Figures);

    #[test]
    fn good_figures_pass_and_each_bad_one_lowers_the_grade() {
        let thresholds = Thresholds::default();
        assert_eq!(judge(&good(), &thresholds).grade, Grade::Pass);
        let cases: [(Spoil, Grade); 13] = [
            (|f| f.halves[0].1 = half(1.8), Grade::Doubtful),
            (|f| f.suspect_views = (11, 68), Grade::Doubtful),
            (|f| f.sigma_px = 0.4, Grade::Doubtful),
            (|f| f.sigma_px = f64::NAN, Grade::Fail),
            (|f| f.agreement = None, Grade::Doubtful),
            (
                |f| {
                    f.agreement
                        .iter_mut()
                        .for_each(|a| a.mono = Some(ratio(6.0)));
                },
                Grade::Fail,
            ),
            (
                |f| {
                    f.agreement
                        .iter_mut()
                        .for_each(|a| a.stereo = Some(ratio(0.9)));
                },
                Grade::Doubtful,
            ),
            (
                |f| {
                    f.agreement.iter_mut().for_each(|a| {
                        a.cameras = Some(ratio(1.5));
                        a.disagreement_px = 0.08;
                    });
                },
                Grade::Doubtful,
            ),
            (|f| f.neighbors_mm = Some((0.03, 0.02)), Grade::Doubtful),
            (|f| f.neighbors_mm = Some((0.0003, 0.0002)), Grade::Pass),
            (|f| f.corners = (500, 500), Grade::Fail),
            (|f| f.all_sigma_px = 0.5, Grade::Doubtful),
            (|f| f.pose_count = Some(2), Grade::Fail),
        ];
        for (spoil, expected) in cases {
            let mut figures = good();
            spoil(&mut figures);
            let verdict = judge(&figures, &thresholds);
            assert_eq!(verdict.grade, expected, "{:?}", verdict.reasons);
            assert!(verdict.reasons[0].starts_with(&expected.to_string()));
        }
    }
}
