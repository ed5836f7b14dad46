//! An audit in plain words.

use super::record::{AgainstOurs, Audit, Audited, Region};
use crate::compare::bootstrap::Ratio;
use crate::present::numbers::short;
use crate::present::table::Table;

/// A difference by less than this share matters to nobody, however certain it is.
const MATTERS: f64 = 0.05;
/// A mean shift of a region below this share of its RMS is chance.
const SYSTEMATIC: f64 = 0.5;

/// The sentences.
pub(super) fn conclude(audit: &Audit) -> Vec<String> {
    let mut said: Vec<String> = audit
        .calibrations
        .iter()
        .flat_map(|calibration| of_one(calibration, audit))
        .collect();
    if let Some(reason) = &audit.no_estimate {
        said.push(format!(
            "There is no estimate of ours to compare with: {reason}"
        ));
    }
    if audit.calibrations.iter().any(|c| c.saw_these.is_none()) {
        said.push(
            "Files by other tools do not say from which images they were made: their figures are held-out only if these images are new."
                .to_owned(),
        );
    }
    said
}

fn of_one(calibration: &Audited, audit: &Audit) -> Vec<String> {
    let title = &calibration.title;
    let mut said = Vec::new();
    if calibration.saw_these == Some(true) {
        said.push(format!(
            "{title} was made from these very corners: its figures are fitted ones."
        ));
    }
    let sees_nothing = calibration
        .points
        .as_ref()
        .filter(|points| points.points == 0 && points.unanswered > 0);
    if let Some(points) = sees_nothing {
        said.push(format!(
            "{title} gives no point for any of {} corners that two cameras saw: with it they lie behind the cameras. Are the cameras' files in the wrong order, or R and T the other way round?",
            points.unanswered
        ));
    } else if let Some(against) = &calibration.against_ours {
        said.push(compared(title, against));
    }
    if let Some(points) = &calibration.points
        && let (Some(scale), Some(rms_mm)) = (points.scale_percent, points.neighbor_rms_mm)
    {
        let square_mm = audit.square_mm;
        // Half of the error and more.
        if (scale / 100.0 * square_mm).abs() > SYSTEMATIC * rms_mm && scale.abs() > 0.02 {
            said.push(format!(
                "{title}: all lengths are {} % too {}: its unit, its board or its baseline differs from this board.",
                short(scale.abs()),
                if scale > 0.0 { "long" } else { "short" }
            ));
        }
    }
    said.extend(worst(calibration, audit.ours.as_ref()));
    let unanswered: usize = calibration
        .cameras
        .iter()
        .map(|camera| camera.unanswered)
        .sum();
    if unanswered > 0 {
        said.push(format!(
            "{title} has no answer for {unanswered} of {} corners.",
            audit.corners
        ));
    }
    said
}

/// By what it differs from ours.
fn compared(title: &str, against: &AgainstOurs) -> String {
    let (ratio, of) = match (&against.rigid, &against.residual) {
        (Some(ratio), _) => (ratio, "points, held against the rigid board,"),
        (None, Some(ratio)) => (ratio, "residuals"),
        (None, None) => {
            return format!("{title} cannot be compared: no board was measured by all.");
        }
    };
    let Ratio {
        ratio, low, high, ..
    } = ratio;
    let interval = format!(
        "{} times ours on boards that ours never saw (95 %: {} to {})",
        short(*ratio),
        short(*low),
        short(*high)
    );
    if *low > 1.0 + MATTERS {
        format!(
            "{title} is worse than what these images can give: errors of its {of} are {interval}."
        )
    } else if *high < 1.0 - MATTERS {
        format!(
            "{title} is better than our own estimate from these images: errors of its {of} are {interval}."
        )
    } else {
        format!(
            "{title} is as good as our own estimate from these images, as far as they tell: errors of its {of} are {interval}."
        )
    }
}

/// Where on a sensor it is farther off than ours, most of all.
fn worst(calibration: &Audited, ours: Option<&Audited>) -> Option<String> {
    let mut found: Option<(f64, String)> = None;
    for (camera_idx, camera) in calibration.cameras.iter().enumerate() {
        for region in &camera.regions {
            let own = ours
                .and_then(|ours| ours.cameras.get(camera_idx))
                .and_then(|camera| camera.regions.iter().find(|own| own.name == region.name))
                .map(|own| own.rms_px);
            let more = region.rms_px.powi(2) - own.unwrap_or(0.0).powi(2);
            let beside = own.map_or_else(String::new, |own| format!(", ours {}", short(own)));
            let text = format!(
                "{} is farthest off in camera {}, {}: {} px RMS{beside}{}.",
                calibration.title,
                camera.name,
                region.name,
                short(region.rms_px),
                systematic(region)
            );
            if found.as_ref().is_none_or(|(most, _)| more > *most) {
                found = Some((more, text));
            }
        }
    }
    found.map(|(_, text)| text)
}

fn systematic(region: &Region) -> String {
    let [du, dv] = region.mean_px;
    let length = du.hypot(dv);
    if length < SYSTEMATIC * region.rms_px {
        return String::new();
    }
    format!(
        "; {} px of it are the same in all images: corners lie that much {} and {} of where it says",
        short(length),
        if du > 0.0 {
            "to the right"
        } else {
            "to the left"
        },
        if dv > 0.0 { "below" } else { "above" }
    )
}

/// For a terminal.
pub fn text(audit: &Audit) -> String {
    let mut lines = vec![format!(
        "{} poses, {} views, {} corners; side by side on {} corners that all can answer, {} folds of ours",
        audit.poses, audit.views, audit.corners, audit.common_corners, audit.folds
    )];
    let all: Vec<&Audited> = audit.calibrations.iter().chain(&audit.ours).collect();
    let mut table = Table::new([
        "calibration",
        "px, a pose a view",
        "px, a pose a board",
        "neighbors, mm",
        "rigid, mm",
        "common px",
        "common neighbors, mm",
        "common rigid, mm",
    ]);
    let cell = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), short);
    for calibration in &all {
        let points = calibration.points.as_ref();
        let common = calibration.common.as_ref();
        table.push(vec![
            calibration.title.clone(),
            cell(calibration.rms_px),
            cell(calibration.together_rms_px),
            cell(points.and_then(|points| points.neighbor_rms_mm)),
            cell(points.and_then(|points| points.rigid_rms_mm)),
            cell(common.and_then(|common| common.rms_px)),
            cell(common.and_then(|common| common.neighbor_rms_mm)),
            cell(common.and_then(|common| common.rigid_rms_mm)),
        ]);
    }
    lines.push(table.text());
    for calibration in &all {
        for camera in &calibration.cameras {
            let regions: Vec<String> = camera
                .regions
                .iter()
                .map(|region| format!("{} {}", region.name, short(region.rms_px)))
                .collect();
            lines.push(format!(
                "{}, camera {} ({}): {} px RMS over {} corners; {}",
                calibration.title,
                camera.name,
                camera.model,
                cell(camera.rms_px),
                camera.corners,
                regions.join(", ")
            ));
        }
    }
    lines.extend(audit.conclusion.iter().cloned());
    lines.join("\n")
}
