//! The numbers behind the figures as CSV.

use super::Evaluation;
use super::known::{Bin, KnownExperiment};
use super::spread::SpreadExperiment;
use super::stage::StageExperiment;
use super::target::TargetExperiment;
use std::fmt::Write as _;

/// Name and content of a table per figure that there is.
pub fn tables(evaluation: &Evaluation) -> Vec<(&'static str, String)> {
    let mut tables = Vec::new();
    if let Some(spread) = &evaluation.spread {
        tables.push(("fig7_spread.csv", spread_table(spread)));
    }
    if let Some(stage) = &evaluation.stage_angles {
        tables.push(("fig8_stage_angles.csv", stage_table(stage)));
    }
    if let Some(target) = &evaluation.target {
        tables.push(("fig10_point_cloud.csv", cloud_table(target)));
    }
    if evaluation.target.is_some() || evaluation.known_points.is_some() {
        let text = distance_table(evaluation.target.as_ref(), evaluation.known_points.as_ref());
        tables.push(("fig11_error_over_distance.csv", text));
    }
    tables
}

// Writing to a String cannot fail: the results of writeln are of no interest below.

fn spread_table(spread: &SpreadExperiment) -> String {
    let mut text = String::from("range,spread_px,training_rms_mm,left_out_rms_mm,marker_rms_mm\n");
    for (range, points) in [("published", &spread.published), ("wide", &spread.wide)] {
        for point in points {
            let marker = point
                .marker_rms_mm
                .map_or_else(String::new, |v| v.to_string());
            let _ = writeln!(
                text,
                "{range},{},{},{},{marker}",
                point.spread_px, point.training_rms_mm, point.left_out_rms_mm
            );
        }
    }
    text
}

fn stage_table(stage: &StageExperiment) -> String {
    let mut text = String::from("method,placement,pose,dial_deg,error_deg\n");
    for method in &stage.methods {
        for angle in &method.angles {
            let _ = writeln!(
                text,
                "{},{},{},{},{}",
                method.method, angle.placement, angle.pose, angle.dial_deg, angle.error_deg
            );
        }
    }
    text
}

fn cloud_table(target: &TargetExperiment) -> String {
    let mut text = String::from("pose,row,col,x,y,z,x_nominal,y_nominal,z_nominal\n");
    for point in &target.cloud {
        let (m, n) = (point.measured_mm, point.nominal_mm);
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{}",
            point.pose, point.row, point.col, m.x, m.y, m.z, n.x, n.y, n.z
        );
    }
    text
}

fn distance_table(target: Option<&TargetExperiment>, known: Option<&KnownExperiment>) -> String {
    let mut text = String::from(
        "kind,method,pose,distance_mm,points,rms_mm,mean_mm,deviation_mm,neighbor_rms_mm,true_rms_mm\n",
    );
    for method in target.iter().flat_map(|t| &t.methods) {
        for pose in &method.poses {
            let errors = &pose.errors;
            let [neighbor, truth] = [pose.neighbor_rms_mm, pose.true_rms_mm]
                .map(|rms_mm| rms_mm.map_or_else(String::new, |v| v.to_string()));
            let _ = writeln!(
                text,
                "target,{},{},{},{},{},{},{},{neighbor},{truth}",
                method.method,
                pose.pose,
                pose.distance_mm,
                errors.count,
                errors.rms_mm,
                errors.mean_mm,
                errors.deviation_mm
            );
        }
    }
    let mut known_rows = |name: &str, bins: &[Bin]| {
        for bin in bins {
            let _ = writeln!(
                text,
                "known,{name},,{},{},,,,{}",
                bin.distance_mm, bin.points, bin.placed_rms_mm
            );
        }
    };
    if let Some(known) = known {
        for method in &known.methods {
            known_rows(method.method, &method.bins);
        }
        known_rows("oracle", &known.oracle);
    }
    text
}
