//! How the published procedure went, in words: for the summary and the page.

use super::record::{AlternatingRecord, Calibration};
use crate::present::numbers::short;
use calib_estimate::alternating::start::StartKind;
use maud::{Markup, html};

/// Facts about the procedure, each with its name; nothing for another method.
pub fn facts(calibration: &Calibration) -> Vec<(&'static str, String)> {
    let Some(record) = &calibration.alternating else {
        return Vec::new();
    };
    let mut facts = vec![
        (
            "method",
            "the published procedure, view by view and pixel by pixel".to_owned(),
        ),
        ("networks", networks(record)),
        ("start", start(record)),
        ("stage", stage(record)),
        ("alternation", calibration.estimate.stop_reason.clone()),
    ];
    let fields: Vec<String> = calibration
        .rig
        .cameras
        .iter()
        .zip(&record.field_rms_error_px)
        .map(|(camera, error)| format!("{} {} px", camera.name, short(*error)))
        .collect();
    facts.push((
        "field",
        format!(
            "smoothed from one ray per pixel; single rays differ from it by (RMS) {}",
            fields.join(", ")
        ),
    ));
    facts
}

fn networks(record: &AlternatingRecord) -> String {
    let spread = &record.spread;
    let chosen = spread
        .tried
        .iter()
        .find(|tried| tried.spread_px == spread.spread_px);
    match chosen {
        None => format!("spread {:.0} px, as given", spread.spread_px),
        Some(chosen) => format!(
            "spread {:.0} px, the best of {} at corners left out: {} mm RMS ({} mm at those trained on)",
            spread.spread_px,
            spread.tried.len(),
            short(chosen.left_out_rms_mm),
            short(chosen.training_rms_mm)
        ),
    }
}

fn start(record: &AlternatingRecord) -> String {
    let name = |kind| match kind {
        StartKind::AveragedPinholes => "pinholes with distortion, poses of the cameras averaged",
        StartKind::PinholeRig => "pinholes with distortion, all cameras together",
        StartKind::CubicFields => "the program's own initialization",
    };
    let mut sorted = record.starts.clone();
    sorted.sort_by(|a, b| a.rms_mm.total_cmp(&b.rms_mm));
    let costs: Vec<String> = sorted
        .iter()
        .map(|start| format!("{} ({} mm)", name(start.kind), short(start.rms_mm)))
        .collect();
    match costs.split_first() {
        None => "none".to_owned(),
        Some((first, [])) => first.clone(),
        Some((first, rest)) => format!("{first}; dearer: {}", rest.join(", ")),
    }
}

fn stage(record: &AlternatingRecord) -> String {
    if record.circles.is_empty() {
        return "no steps of the stage: the dataset does not say which placement poses belong to, or \
                they hardly turn"
            .to_owned();
    }
    let used = if record.projected {
        "poses projected onto the circles"
    } else {
        "poses left as they were: projecting them onto circles would have raised the cost"
    };
    let found: Vec<String> = record
        .circles
        .iter()
        .map(|placement| {
            format!(
                "placement {}: corners {} mm RMS off their circles radially, {} mm along the axis",
                placement.placement,
                short(placement.circles.radial_rms_mm),
                short(placement.circles.axial_rms_mm)
            )
        })
        .collect();
    format!("{used}; {}", found.join("; "))
}

/// The page's section; nothing for another method.
pub fn draw(calibration: &Calibration) -> Markup {
    let facts = facts(calibration);
    html! {
        @if !facts.is_empty() {
            section {
                h2 { "The published procedure" }
                p.read { strong { "How to read this. " } "Every view is mapped to its board by a network of its own, every pixel's ray is a line through its points on the boards, and poses and rays are moved in turn. The spread of the networks is chosen by corners left out; the publication's 6000 px is the flat limit, beyond which no spread changes anything. No uncertainty is estimated and the board is taken as flat: the joint estimate (without --method) does both." }
                dl {
                    @for (name, fact) in &facts { dt { (name) } dd { (fact) } }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::example;
    use crate::snapshot::{assert_snapshot, visible_text};
    use calib_estimate::alternating::estimate::StartCost;
    use calib_estimate::alternating::spread::{SpreadChoice, SpreadError};

    #[test]
    fn what_was_chosen_and_what_was_not_is_told() {
        let mut calibration = example::calibration();
        assert!(facts(&calibration).is_empty());
        calibration.alternating = Some(AlternatingRecord {
            spread: SpreadChoice {
                spread_px: 438.0,
                tried: vec![SpreadError {
                    spread_px: 438.0,
                    training_rms_mm: 0.004,
                    left_out_rms_mm: 0.0061,
                }],
            },
            starts: vec![
                StartCost {
                    kind: StartKind::CubicFields,
                    rms_mm: 0.08,
                },
                StartCost {
                    kind: StartKind::PinholeRig,
                    rms_mm: 0.03,
                },
            ],
            circles: Vec::new(),
            projected: false,
            sweeps: 124,
            last_step_mm: 9e-6,
            still_falling: None,
            field_rms_error_px: vec![0.01, 0.02],
        });
        let page = visible_text(&draw(&calibration).into_string());
        assert_snapshot("procedure", &page);
    }
}
