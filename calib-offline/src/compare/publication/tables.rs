//! The numbers behind the figures as CSV.

use super::Evaluation;
use super::known::{Bin, KnownExperiment};
use super::spread::SpreadExperiment;
use super::stage::StageExperiment;
use super::target::TargetExperiment;
use crate::present::numbers::or_empty;
use crate::present::table::Table;

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

fn spread_table(spread: &SpreadExperiment) -> String {
    let header = "range,spread_px,training_rms_mm,left_out_rms_mm,marker_rms_mm";
    let mut table = Table::new(header.split(','));
    for (range, points) in [("published", &spread.published), ("wide", &spread.wide)] {
        for point in points {
            table.row(&[
                &range,
                &point.spread_px,
                &point.training_rms_mm,
                &point.left_out_rms_mm,
                &or_empty(point.marker_rms_mm),
            ]);
        }
    }
    table.csv()
}

fn stage_table(stage: &StageExperiment) -> String {
    let mut table = Table::new("method,placement,pose,dial_deg,error_deg".split(','));
    for method in &stage.methods {
        for angle in &method.angles {
            table.row(&[
                &method.method,
                &angle.placement,
                &angle.pose,
                &angle.dial_deg,
                &angle.error_deg,
            ]);
        }
    }
    table.csv()
}

fn cloud_table(target: &TargetExperiment) -> String {
    let header = "pose,row,col,x,y,z,x_nominal,y_nominal,z_nominal";
    let mut table = Table::new(header.split(','));
    for point in &target.cloud {
        let (m, n) = (point.measured_mm, point.nominal_mm);
        table.row(&[
            &point.pose,
            &point.row,
            &point.col,
            &m.x,
            &m.y,
            &m.z,
            &n.x,
            &n.y,
            &n.z,
        ]);
    }
    table.csv()
}

fn distance_table(target: Option<&TargetExperiment>, known: Option<&KnownExperiment>) -> String {
    let header = "kind,method,pose,distance_mm,points,rms_mm,mean_mm,deviation_mm,\
                  neighbor_rms_mm,true_rms_mm";
    let mut table = Table::new(header.split(','));
    for method in target.iter().flat_map(|t| &t.methods) {
        for pose in &method.poses {
            let errors = &pose.errors;
            table.row(&[
                &"target",
                &method.method,
                &pose.pose,
                &pose.distance_mm,
                &errors.count,
                &errors.rms_mm,
                &errors.mean_mm,
                &errors.deviation_mm,
                &or_empty(pose.neighbor_rms_mm),
                &or_empty(pose.true_rms_mm),
            ]);
        }
    }
    let mut known_rows = |name: &str, bins: &[Bin]| {
        for bin in bins {
            let (distance, points, error) = (bin.distance_mm, bin.points, bin.placed_rms_mm);
            table.row(&[
                &"known", &name, &"", &distance, &points, &"", &"", &"", &"", &error,
            ]);
        }
    };
    if let Some(known) = known {
        for method in &known.methods {
            known_rows(method.method, &method.bins);
        }
        known_rows("oracle", &known.oracle);
    }
    table.csv()
}
