//! The summary for a terminal: what stands on the page's first screen.

use super::BlobFacts;
use super::facts::{Facts, pair};
use super::import;
use super::procedure;
use super::record::{Calibration, Grade};
use super::task;
use super::words;
use crate::present::numbers::short;

/// A few lines, each with one fact and its unit; no colors.
pub fn summary(calibration: &Calibration, blob: Option<&BlobFacts>) -> String {
    let facts = Facts::of(calibration);
    if let Some(imported) = &calibration.imported {
        return import::summary(imported, &facts);
    }
    let mut lines: Vec<(&str, String)> = vec![("verdict", facts.verdict.word().to_owned())];
    lines.extend(facts.reasons.iter().map(|reason| ("", reason.clone())));
    lines.extend(causes(calibration));
    lines.push(("held-out error", held_out(calibration, &facts)));
    lines.extend(task::facts(calibration));
    lines.extend(task::certificate(calibration));
    lines.push((
        "corner noise",
        format!(
            "{} px per axis, residual vectors {} px RMS over {} corners ({} rejected)",
            short(facts.sigma_px),
            short(facts.rms_px),
            facts.corners_used,
            facts.corners_rejected
        ),
    ));
    lines.extend(procedure::facts(calibration));
    if let Some(checks) = &calibration.checks {
        lines.push(("half-data check", words::half_data(&checks.half_data)));
    }
    for (camera_idx, camera) in facts.cameras.iter().enumerate() {
        let [width, height] = camera.sensor_px;
        lines.push((
            "camera",
            format!(
                "{}, {width} x {height} px, {} images, {:.0} % of the sensor calibrated",
                camera.name,
                camera.views,
                100.0 * camera.covered_share,
            ),
        ));
        if let Some(model) = words::camera_model(calibration, camera_idx) {
            lines.push(("", model));
        }
        if let Some(pinhole) = calibration.nearest_pinholes.get(camera_idx) {
            lines.push(("", words::nearest_pinhole(pinhole)));
        }
    }
    if let Some(checks) = &calibration.checks {
        lines.push(("central model", words::central_model(&checks.central_model)));
    }
    if let Some(choices) = &calibration.choices {
        if calibration.board.layout.is_grid() {
            lines.push(("board's shape", words::board(choices)));
        }
        lines.push(("noise", words::noise(choices)));
    }
    for (k, baseline_mm) in facts.baseline_mm.iter().enumerate() {
        let between = pair(&facts, k);
        lines.push(("baseline", format!("{baseline_mm:.2} mm {between}")));
    }
    if let Some(distance) = facts.working_distance_mm {
        lines.push((
            "distance",
            format!(
                "{:.0} mm from camera to board ({:.0} to {:.0})",
                distance.median, distance.least, distance.most
            ),
        ));
    }
    lines.push((
        "images",
        format!(
            "{} poses, {} images used; left out in whole or in part: {}",
            facts.poses_used, facts.views_used, facts.left_out
        ),
    ));
    for left in &calibration.left_out {
        lines.push((
            "",
            format!(
                "pose {}{}: {}",
                left.pose,
                left.camera
                    .as_ref()
                    .map_or(String::new(), |c| format!(", {c}")),
                left.reason
            ),
        ));
    }
    for view in &calibration.renumbered {
        let text = format!("pose {}, {}: {}", view.pose, view.camera, view.reason);
        lines.push(("renumbered", text));
    }
    if let Some(blob) = blob {
        lines.push(("blob", blob.in_words()));
    }
    import::lined(&lines)
}

/// What was found about the recording; what lowers the grade stands among the reasons.
fn causes(calibration: &Calibration) -> impl Iterator<Item = (&'static str, String)> {
    calibration.causes.iter().map(|cause| {
        let text = match cause.grade {
            Grade::Pass => cause.text.clone(),
            _ => format!(
                "{}, see above; costs {} mm",
                cause.size,
                short(cause.cost_mm)
            ),
        };
        ("found", format!("{}: {text}", cause.code.word()))
    })
}

fn held_out(calibration: &Calibration, facts: &Facts) -> String {
    let Some(held_out) = &calibration.held_out else {
        return "not checked: too few poses to leave some out".to_owned();
    };
    let mut parts = Vec::new();
    if let (Some(percent), Some(mm)) = (facts.held_out_neighbor_percent, facts.held_out_neighbor_mm)
    {
        parts.push(format!(
            "{} % of the {} between neighboring corners ({} mm of {} mm)",
            short(percent),
            if calibration.board.layout.is_grid() {
                "square"
            } else {
                "spacing"
            },
            short(mm),
            calibration.board.square_mm
        ));
    }
    if let Some(mm) = facts.held_out_rigid_mm {
        parts.push(format!("{} mm from the rigid board", short(mm)));
    }
    if let Some(px) = facts.held_out_rms_px {
        parts.push(format!("{} px", short(px)));
    }
    if parts.is_empty() {
        return format!("nothing could be measured in {} folds", held_out.folds);
    }
    let failed = match held_out.failed_folds {
        0 => String::new(),
        count => {
            let first = held_out.fold_failures.first();
            let reason = first.map_or(String::new(), |failed| format!(": {}", failed.reason));
            format!("; {count} more gave no estimate{reason}")
        }
    };
    format!(
        "{} (RMS, {} folds by {}{failed})",
        parts.join(", "),
        held_out.folds,
        calibration.dealt_word()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::example;
    use crate::report::record::FailedFold;
    use crate::snapshot::assert_snapshot;

    #[test]
    fn the_summary_has_every_fact_with_its_unit() {
        let mut calibration = example::calibration();
        assert_snapshot("summary", &summary(&calibration, None));
        let held_out_line = |calibration: &Calibration| {
            let text = summary(calibration, None);
            let line = text.lines().find(|line| line.starts_with("held-out"));
            line.unwrap().to_owned()
        };
        if let Some(held_out) = &mut calibration.held_out {
            held_out.failed_folds = 1;
            held_out.fold_failures = vec![FailedFold {
                fold: 3,
                reason: "too dark".to_owned(),
            }];
        }
        let with_a_failed_fold = held_out_line(&calibration);
        calibration.held_out = None;
        let lines = [with_a_failed_fold, held_out_line(&calibration)];
        assert_snapshot("summary_held_out", &lines.join("\n"));
    }
}
