//! What was found, in words and tables: Markdown that reads well on a console too.

use super::Evaluation;
use super::known::KnownExperiment;
use super::spread::SpreadExperiment;
use super::stage::StageExperiment;
use super::statistics::ErrorStatistics;
use super::target::{TargetExperiment, TargetMethod};
use crate::methods::METHODS;
use crate::present::numbers::{or_dash, short};
use crate::present::table::Table;
use calib_judge::known_points::TruthErrors;
use std::fmt::Write as _;

/// The publication's mean error of its method, mm.
pub const PUBLISHED_MEAN_MM: f64 = 0.037;
/// What the publication gives as the largest variance of its method, in mm: a standard deviation.
pub const PUBLISHED_DEVIATION_MM: f64 = 0.017;
/// What the publication's figures can be compared with, and what not.
pub const COMPARABLE: &str = "\
What can be compared: the methods with each other, since they get the same corners and measure the
same pixels; and how an error depends on the distance. What cannot: the figures here with the
publication's 0.037 mm and 0.017 mm. Those come from other cameras, another target and another
stage; their detector and its noise are not known; the publication does not say how its error is
defined, and gives the second figure as a variance in mm, which is taken for a standard deviation
here. A simulated recording has no errors of printing or flatness, no drift and no blur but what was
asked for, and a detector that was tried on such images. A smaller figure here is no better method.";

/// The whole text, `table.md`.
pub fn text(evaluations: &[Evaluation]) -> String {
    let mut text = String::from("# The publication's experiments\n\n");
    for evaluation in evaluations {
        text += &section(evaluation);
    }
    let _ = write!(
        text,
        "## Beside the publication\n\n{}\n{COMPARABLE}\n",
        published_table(evaluations)
    );
    text
}

// Writing to a String cannot fail: the results of writeln are of no interest below.

fn section(evaluation: &Evaluation) -> String {
    let mut text = format!(
        "## {}\n\n{} poses, {} corners, cameras {}\n\n",
        evaluation.name,
        evaluation.poses,
        evaluation.corners,
        evaluation.cameras.join(", ")
    );
    for outcome in &evaluation.methods {
        if let Some(reason) = &outcome.failed {
            let _ = writeln!(text, "{}: failed, {reason}\n", outcome.method);
        }
    }
    if let Some(spread) = &evaluation.spread {
        text += &spread_words(spread);
    }
    if let Some(stage) = &evaluation.stage_angles {
        text += &stage_words(stage);
    }
    if let Some(target) = &evaluation.target {
        text += &target_words(target);
    }
    if let Some(known) = &evaluation.known_points {
        text += &known_words(known);
    }
    for left_out in &evaluation.left_out {
        let _ = writeln!(text, "Left out: {}: {}\n", left_out.part, left_out.reason);
    }
    text
}

fn spread_words(spread: &SpreadExperiment) -> String {
    let mut text = format!(
        "Networks (Fig. 7; RMS over {} views, at most {} neurons, no homography before them): {} mm at \
         corners left out with the publication's spread of 6000 px, {} mm at {:.0} px, the best of all \
         spreads tried. ",
        spread.views,
        spread.neurons,
        short(spread.published_choice_left_out_rms_mm),
        short(spread.best_left_out_rms_mm),
        spread.best_px
    );
    if let [first, .., last] = &spread.published[..] {
        let _ = write!(
            text,
            "From {:.0} to {:.0} px it goes from {} to {} mm",
            first.spread_px,
            last.spread_px,
            short(first.left_out_rms_mm),
            short(last.left_out_rms_mm)
        );
        // A few percent are within what the draw of views does.
        text += if last.left_out_rms_mm > 1.05 * first.left_out_rms_mm {
            ", in steps: the wider the neurons, the more alike they are, and one singular value after \
             another is lost in round-off (the flat limit). The publication's curve falls. "
        } else {
            "; like the publication's curve it does not rise. "
        };
    }
    let marker = |points: &[super::spread::SpreadPoint]| {
        let errors = points
            .iter()
            .filter_map(|p| Some((p.spread_px, p.marker_rms_mm?)));
        errors.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    if let (Some((at, error)), Some((wide_at, wide_error))) =
        (marker(&spread.published), marker(&spread.wide))
    {
        let _ = write!(
            text,
            "Auxiliary markers ({} pairs, 160 mm apart, outside the corners): at best {} mm at {at:.0} \
             px in the published range, {} mm at {wide_at:.0} px beyond it.",
            spread.marker_pairs,
            short(error),
            short(wide_error)
        );
    }
    text.trim_end().to_owned() + "\n\n"
}

fn stage_words(stage: &StageExperiment) -> String {
    let mut table = Table::new([
        "method",
        "RMS, degrees",
        "worst, degrees",
        "not about the axis, RMS, degrees",
    ]);
    for method in &stage.methods {
        let worst = method.angles.iter().map(|a| a.error_deg.abs());
        let wobbles: Vec<String> = method.wobble_rms_deg.iter().map(|w| short(*w)).collect();
        table.row(&[
            &method.method,
            &short(method.rms_deg),
            &short(worst.fold(0.0, f64::max)),
            &wobbles.join(", "),
        ]);
    }
    format!(
        "Angles about the stage's axis against the dial (Fig. 8):\n\n{}\n",
        table.left_aligned().markdown()
    )
}

fn target_words(target: &TargetExperiment) -> String {
    let mut table = Table::new([
        "method",
        "mean, mm",
        "standard deviation, mm",
        "RMS, mm",
        "worst, mm",
        "neighbors' distance, RMS, mm",
        "true places *, RMS, mm",
        "no point",
    ]);
    for method in &target.methods {
        let errors = method.errors.as_ref();
        let number = |of: fn(&ErrorStatistics) -> f64| or_dash(errors.map(|e| short(of(e))));
        table.row(&[
            &method.method,
            &number(|e| e.mean_mm),
            &number(|e| e.deviation_mm),
            &number(|e| e.rms_mm),
            &number(|e| e.worst_mm),
            &or_dash(method.neighbor_rms_mm.map(short)),
            &or_dash(method.true_rms_mm.map(short)),
            &method.without_point,
        ]);
    }
    format!(
        "Measurement target (Fig. 10, 11): {} of {} markers were measured by every method. Distances \
         of markers from the best-placed nominal target:\n\n{}\n\
         \\* where the truth is known, after one rigid placement of all poses together\n\n",
        target.common,
        target.markers,
        table.left_aligned().markdown()
    )
}

fn known_words(known: &KnownExperiment) -> String {
    let mut table = Table::new([
        "method",
        "as measured, mm",
        "frame placed, mm",
        "ratio",
        "no point",
    ]);
    for method in &known.methods {
        let errors = method.errors.as_ref();
        let number = |of: fn(&TruthErrors) -> f64| or_dash(errors.map(|e| short(of(e))));
        let direct = if known.frame_is_true {
            number(|e| e.direct_rms_mm)
        } else {
            "-".to_owned()
        };
        table.row(&[
            &method.method,
            &direct,
            &number(|e| e.placed_rms_mm),
            &number(|e| e.placed_ratio),
            &method.without_point,
        ]);
    }
    format!(
        "Points with known truth: {} of {} were measured by every method. RMS errors; the ratio is to \
         the true rays of the same noisy pixels{}:\n\n{}\n",
        known.common,
        known.matches,
        if known.frame_is_true {
            ""
        } else {
            " (the frame is not that of the truth: only placed errors count)"
        },
        table.left_aligned().markdown()
    )
}

fn published_table(evaluations: &[Evaluation]) -> String {
    let mut table = Table::new([
        "",
        "method",
        "mean error of markers, mm",
        "largest standard deviation of a pose, mm",
    ]);
    table.row(&[
        &"publication",
        &"its own (alternating)",
        &PUBLISHED_MEAN_MM,
        &PUBLISHED_DEVIATION_MM,
    ]);
    for evaluation in evaluations {
        for method in METHODS {
            let measured = evaluation.target.as_ref();
            let found = measured.and_then(|t| t.methods.iter().find(|m| m.method == method.name()));
            let number =
                |of: fn(&TargetMethod) -> Option<f64>| or_dash(found.and_then(of).map(short));
            table.row(&[
                &evaluation.name,
                &method.name(),
                &number(|m| m.errors.as_ref().map(|e| e.mean_mm)),
                &number(|m| m.largest_pose_deviation_mm),
            ]);
        }
    }
    table.left_aligned().markdown()
}

#[cfg(test)]
mod tests {
    use super::super::spread::SpreadPoint;
    use super::super::stage::{MethodAngles, StageAngle};
    use super::super::statistics::ErrorStatistics;
    use super::super::{LeftOut, MethodOutcome, known::KnownMethod};
    use super::*;
    use crate::snapshot::assert_snapshot;
    use calib_judge::known_points::TruthErrors;

    fn empty(name: &str) -> Evaluation {
        Evaluation {
            name: name.to_owned(),
            dataset: None,
            cameras: vec!["left".to_owned(), "right".to_owned()],
            poses: 18,
            corners: 3510,
            methods: Vec::new(),
            spread: None,
            stage_angles: None,
            target: None,
            known_points: None,
            left_out: Vec::new(),
        }
    }

    fn networks() -> SpreadExperiment {
        let point = |spread_px, left_out_rms_mm, marker_rms_mm| SpreadPoint {
            spread_px,
            training_rms_mm: 0.5 * left_out_rms_mm,
            left_out_rms_mm,
            marker_rms_mm,
        };
        SpreadExperiment {
            views: 4,
            neurons: 48,
            marker_pairs: 12,
            published: vec![
                point(1000.0, 0.01, Some(0.3)),
                point(7000.0, 0.02, Some(0.2)),
            ],
            wide: vec![point(100.0, 5.0, None), point(400.0, 0.008, Some(0.25))],
            best_px: 400.0,
            best_left_out_rms_mm: 0.008,
            alternating_px: Some(438.0),
            published_choice_left_out_rms_mm: 0.019,
        }
    }

    fn stage() -> StageExperiment {
        let angle = |pose, error_deg| StageAngle {
            pose,
            placement: 0,
            dial_deg: 10.0 * pose as f64,
            error_deg,
        };
        StageExperiment {
            methods: vec![MethodAngles {
                method: "joint",
                rms_deg: 0.015625,
                wobble_rms_deg: vec![0.25, 0.5],
                angles: vec![angle(0, 0.0078125), angle(1, -0.03125)],
            }],
        }
    }

    fn target() -> TargetExperiment {
        let statistics = ErrorStatistics {
            count: 300,
            mean_mm: 0.011,
            deviation_mm: 0.004,
            variance_mm2: 0.004 * 0.004,
            rms_mm: 0.0117,
            worst_mm: 0.03,
        };
        let method = |method, errors: Option<ErrorStatistics>| TargetMethod {
            method,
            without_point: 2,
            neighbor_rms_mm: errors.as_ref().map(|_| 0.006),
            true_rms_mm: None,
            largest_pose_deviation_mm: errors.as_ref().map(|_| 0.005),
            errors,
            poses: Vec::new(),
        };
        TargetExperiment {
            markers: 320,
            common: 300,
            methods: vec![method("joint", Some(statistics)), method("baseline", None)],
            cloud_method: Some("joint"),
            cloud: Vec::new(),
        }
    }

    fn known(frame_is_true: bool) -> KnownExperiment {
        let errors = TruthErrors {
            points: 190,
            direct_rms_mm: 0.022,
            placed_rms_mm: 0.021,
            oracle_rms_mm: 0.02,
            direct_ratio: 1.1,
            placed_ratio: 1.05,
        };
        KnownExperiment {
            matches: 200,
            common: 190,
            frame_is_true,
            methods: vec![KnownMethod {
                method: "joint",
                without_point: 3,
                errors: Some(errors),
                bins: Vec::new(),
            }],
            oracle: Vec::new(),
        }
    }

    #[test]
    fn every_part_in_words() {
        let whole = Evaluation {
            spread: Some(networks()),
            stage_angles: Some(stage()),
            target: Some(target()),
            known_points: Some(known(true)),
            ..empty("whole")
        };
        let mut falling = networks();
        falling.published[1].left_out_rms_mm = 0.009;
        let part = Evaluation {
            methods: vec![MethodOutcome {
                method: "alternating",
                placed_poses: 0,
                failed: Some("no view has the board's inner corners".to_owned()),
            }],
            spread: Some(falling),
            known_points: Some(known(false)),
            left_out: vec![LeftOut {
                part: "measurement target",
                reason: "the dataset has none".to_owned(),
            }],
            ..empty("part")
        };
        assert_snapshot("publication", &text(&[whole, part]));
    }
}
