//! Pass, doubtful or fail, with reasons: every figure next to its threshold.

use super::cause::Cause;
use serde::{Deserialize, Serialize};

/// The judgement with its reasons.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The grade.
    pub grade: Grade,
    /// Each with its figure and threshold; those that lowered the grade first.
    pub reasons: Vec<String>,
}

/// Pass, doubtful or fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Grade {
    /// Nothing speaks against it.
    Pass,
    /// Usable with care: see the reasons.
    Doubtful,
    /// Not usable: see the reasons.
    Fail,
}

impl Grade {
    /// The grade as a word.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Doubtful => "doubtful",
            Self::Fail => "fail",
        }
    }
}

impl std::fmt::Display for Grade {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.word())
    }
}

/// Where a figure stops being good, and where it stops being usable.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Thresholds {
    /// Corner noise, px per axis. Sub-pixel detectors reach 0.02 to 0.1 px on sharp images; half a
    /// pixel means blur or a board that is not what the manifest says.
    pub sigma_px: (f64, f64),
    /// Held-out RMS over the fit's own: 1 is ideal, much more means that the fit followed noise.
    pub held_out_ratio: (f64, f64),
    /// RMS error of neighboring corners' distance on held-out boards, percent of the square.
    pub neighbor_rms_percent: (f64, f64),
    /// Difference of two calibrations from half of the poses over what it was to be; above it the
    /// calibration is doubtful. Chance alone leads to 1.5 (see `half_data`); at twice the
    /// prediction the predicted uncertainty is worth little.
    pub half_data_ratio: f64,
    /// Share of corners rejected as outliers.
    pub rejected_share: (f64, f64),
    /// Share of views that had to be left out, split from their pair or renumbered; above it,
    /// something is wrong with how the recording is made.
    pub suspect_views: f64,
    /// Poses used; below the first is doubtful (few views hold no flexible field), below the
    /// second is a fail.
    pub poses: (usize, usize),
    /// Share of a sensor that is calibrated; below the first is doubtful.
    pub covered_share: f64,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self {
            sigma_px: (0.3, 2.0),
            held_out_ratio: (1.5, 5.0),
            neighbor_rms_percent: (1.0, 10.0),
            half_data_ratio: 2.0,
            rejected_share: (0.03, 0.3),
            suspect_views: 0.03,
            poses: (10, 3),
            covered_share: 0.5,
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
    /// RMS of the residual vectors of the corners used, px.
    pub rms_px: f64,
    /// RMS of the residual vectors on held-out boards, px.
    pub held_out_rms_px: Option<f64>,
    /// RMS error of neighboring corners' distance on held-out boards, percent.
    pub neighbor_rms_percent: Option<f64>,
    /// Difference of two calibrations from half of the poses over what it was to be.
    pub half_data_ratio: Option<f64>,
    /// Corners used and rejected.
    pub corners: (usize, usize),
    /// Views that could not be used as they were recorded, and all views.
    pub suspect_views: (usize, usize),
    /// Poses used.
    pub pose_count: usize,
    /// Name and calibrated share of the sensor, per camera.
    pub covered_share: Vec<(String, f64)>,
    /// Whether the adjustment came to rest.
    pub settled: bool,
}

/// Judges a calibration.
pub fn judge(figures: &Figures, thresholds: &Thresholds) -> Verdict {
    let mut reasons: Vec<(Grade, String)> = Vec::new();
    let mut above = |name: &str, value: f64, unit: &str, (doubtful, fail): (f64, f64)| {
        // Written so that NaN fails.
        let grade = if value <= doubtful {
            Grade::Pass
        } else if value <= fail {
            Grade::Doubtful
        } else {
            Grade::Fail
        };
        let relation = match grade {
            Grade::Pass => format!("within {doubtful}{unit}"),
            Grade::Doubtful => format!("above {doubtful}{unit}"),
            Grade::Fail => format!("above {fail}{unit}"),
        };
        reasons.push((grade, format!("{name} {value:.3}{unit}, {relation}")));
    };
    above("corner noise", figures.sigma_px, " px", thresholds.sigma_px);
    if let Some(held_out) = figures.held_out_rms_px {
        above(
            "held-out over fitted residual",
            held_out / figures.rms_px.max(1e-9),
            "",
            thresholds.held_out_ratio,
        );
    }
    if let Some(percent) = figures.neighbor_rms_percent {
        above(
            "held-out neighbor distance error",
            percent,
            " % of the square",
            thresholds.neighbor_rms_percent,
        );
    }
    if let Some(ratio) = figures.half_data_ratio {
        above(
            "difference of half-data calibrations over the predicted one",
            ratio,
            "",
            (thresholds.half_data_ratio, f64::INFINITY),
        );
    }
    let (used, rejected) = figures.corners;
    above(
        "share of corners rejected",
        100.0 * rejected as f64 / (used + rejected).max(1) as f64,
        " %",
        (
            100.0 * thresholds.rejected_share.0,
            100.0 * thresholds.rejected_share.1,
        ),
    );
    if figures.held_out_rms_px.is_none() {
        reasons.push((
            Grade::Doubtful,
            "too few poses for a held-out check".to_string(),
        ));
    }
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
    let (few, too_few) = thresholds.poses;
    let grade = match figures.pose_count {
        n if n < too_few => Grade::Fail,
        n if n < few => Grade::Doubtful,
        _ => Grade::Pass,
    };
    reasons.push((
        grade,
        format!("{} poses, {few} or more wanted", figures.pose_count),
    ));
    let cameras = figures.covered_share.iter();
    reasons.extend(cameras.map(|(name, share)| coverage(name, *share, thresholds.covered_share)));
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

fn coverage(camera: &str, share: f64, wanted: f64) -> (Grade, String) {
    let grade = if share >= wanted {
        Grade::Pass
    } else {
        Grade::Doubtful
    };
    let reason = format!(
        "camera {camera}: corners cover {:.0} % of the sensor, {:.0} % or more wanted",
        100.0 * share,
        100.0 * wanted
    );
    (grade, reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> Figures {
        Figures {
            sigma_px: 0.05,
            rms_px: 0.07,
            held_out_rms_px: Some(0.072),
            neighbor_rms_percent: Some(0.1),
            half_data_ratio: Some(1.3),
            corners: (5000, 10),
            suspect_views: (1, 68),
            pose_count: 34,
            covered_share: vec![("left".into(), 0.9)],
            settled: true,
        }
    }

    /// Makes one figure bad.
    type Spoil = fn(&mut Figures);

    #[test]
    fn good_figures_pass_and_each_bad_one_lowers_the_grade() {
        let thresholds = Thresholds::default();
        assert_eq!(judge(&good(), &thresholds).grade, Grade::Pass);
        let cases: [(Spoil, Grade); 8] = [
            (|f| f.half_data_ratio = Some(2.5), Grade::Doubtful),
            (|f| f.suspect_views = (11, 68), Grade::Doubtful),
            (|f| f.sigma_px = 0.4, Grade::Doubtful),
            (|f| f.sigma_px = f64::NAN, Grade::Fail),
            (|f| f.held_out_rms_px = Some(0.5), Grade::Fail),
            (|f| f.corners = (900, 100), Grade::Doubtful),
            (|f| f.pose_count = 5, Grade::Doubtful),
            (|f| f.covered_share[0].1 = 0.2, Grade::Doubtful),
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
