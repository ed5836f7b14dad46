//! A calibration by another tool as a record: what is known of it, and that nothing is known of how good it is.

use super::facts::Facts;
use super::record::{
    BoardShape, Calibration, EstimateRecord, Grade, ImportRecord, ImportedCamera, SCHEMA, Verdict,
};
use crate::present::numbers::short;
use calib_exchange::{Converted, ForeignRig};
use calib_rays::board::BoardSpec;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The method in the record of an imported calibration.
pub const METHOD: &str = "imported";

/// The record of a calibration by another tool. `input_sha256` is that of its files.
pub fn record(
    foreign: &ForeignRig,
    converted: &Converted,
    input_sha256: String,
    working_distance_mm: Option<f64>,
) -> Calibration {
    Calibration {
        schema: SCHEMA.to_owned(),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        command: None,
        method: METHOD.to_owned(),
        input_sha256,
        board: BoardSpec {
            rows: 0,
            cols: 0,
            square_mm: 0.0,
            ..BoardSpec::chessboard(0, 0, 0.0)
        },
        certificate: None,
        known_poses: BTreeMap::new(),
        recording: None,
        cameras: Vec::new(),
        board_shape: BoardShape::default(),
        rig: converted.rig.clone(),
        nearest_pinholes: Vec::new(),
        poses: Vec::new(),
        stage_axes: Vec::new(),
        corners: Vec::new(),
        left_out: Vec::new(),
        renumbered: Vec::new(),
        estimate: EstimateRecord {
            cost_per_iteration: Vec::new(),
            stop_reason: format!("imported from {}", foreign.format.name()),
            sigma_px: 0.0,
            rms_px: 0.0,
            corners_used: 0,
            corners_rejected: 0,
        },
        choices: None,
        alternating: None,
        held_out: None,
        checks: None,
        causes: Vec::new(),
        task: None,
        imported: Some(import_record(foreign, converted, working_distance_mm)),
        verdict: Verdict {
            grade: Grade::Doubtful,
            reasons: vec![
                "imported: how good it is nobody has looked at; calib-offline audit does, on images"
                    .to_owned(),
            ],
        },
    }
}

fn import_record(
    foreign: &ForeignRig,
    converted: &Converted,
    working_distance_mm: Option<f64>,
) -> ImportRecord {
    let mut lost = vec![
        "uncertainty: points get no sigma".to_owned(),
        "the images and corners that it was made from: nothing can be verified, audit judges it on new ones"
            .to_owned(),
    ];
    for camera in &converted.cameras {
        if camera.covered_share < 1.0 {
            lost.push(format!(
                "camera {}: {:.1} % of the sensor have no ray (there the model folds or is too steep, or the file calls them invalid)",
                camera.name,
                100.0 * (1.0 - camera.covered_share)
            ));
        }
    }
    lost.extend(foreign.notes.iter().cloned());
    let names = foreign.files.iter().map(|file| {
        let name = file.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    });
    let cameras = foreign.cameras.iter().zip(&converted.cameras);
    ImportRecord {
        format: foreign.format.name().to_owned(),
        files: names.collect(),
        cameras: cameras
            .map(|(camera, loss)| ImportedCamera {
                name: camera.name.clone(),
                model: camera.model_name.clone(),
                rms_px: loss.rms_px,
                max_px: loss.max_px,
            })
            .collect(),
        working_distance_mm,
        lost,
    }
}

/// The summary for a terminal.
pub fn summary(imported: &ImportRecord, facts: &Facts) -> String {
    let mut lines = vec![("verdict", facts.verdict.word().to_owned())];
    lines.extend(facts.reasons.iter().map(|reason| ("", reason.clone())));
    lines.push((
        "imported",
        format!("from {}: {}", imported.format, imported.files.join(", ")),
    ));
    for (camera, fact) in imported.cameras.iter().zip(&facts.cameras) {
        let [width, height] = fact.sensor_px;
        lines.push((
            "camera",
            format!(
                "{}, {width} x {height} px, {}, {:.0} % of the sensor has rays; they differ from the model by {} px RMS, {} at most",
                camera.name,
                camera.model,
                100.0 * fact.covered_share,
                short(camera.rms_px),
                short(camera.max_px)
            ),
        ));
    }
    for (camera, baseline_mm) in facts.cameras.iter().skip(1).zip(&facts.baseline_mm) {
        let first = &facts.cameras[0].name;
        lines.push((
            "baseline",
            format!("{baseline_mm:.2} mm from {first} to {}", camera.name),
        ));
    }
    if let Some(mm) = imported.working_distance_mm {
        lines.push(("distance", format!("{mm} mm, as said")));
    }
    lines.extend(imported.lost.iter().map(|lost| ("lost", lost.clone())));
    lined(&lines)
}

/// A line a fact.
pub(super) fn lined(lines: &[(&str, String)]) -> String {
    lines.iter().fold(String::new(), |mut text, (name, fact)| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{name:<15} {fact}");
        text
    })
}
