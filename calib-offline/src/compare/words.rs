//! A comparison as a table for the terminal, as Markdown, and as CSV.

use super::record::{Comparison, HeldOutFigures, MethodFigures};
use crate::present::numbers::{or_dash, or_empty, short};
use crate::present::table::Table;

/// Columns of the table, before those of the truth.
const COLUMNS: [&str; 10] = [
    "method",
    "fitted px",
    "held-out px",
    "median px",
    "neighbor %",
    "neighbor mm",
    "rigid mm",
    "points",
    "outside",
    "rejected",
];

/// Header of the CSV; after it come `FILE_rms_mm,FILE_over_oracle,FILE_unanswered` per file of matches
/// whose truth is known.
const CSV_COLUMNS: &str = "method,failure,fitted_rms_px,fitted_corners,rejected,held_out_rms_px,held_out_median_px,\
                           neighbor_rms_percent,neighbor_rms_mm,rigid_rms_mm,points,unanswered,residual_ratio,\
                           residual_ratio_low,residual_ratio_high,neighbor_ratio,neighbor_ratio_low,\
                           neighbor_ratio_high,rigid_ratio,rigid_ratio_low,rigid_ratio_high";

/// For the terminal.
pub fn text(comparison: &Comparison) -> String {
    let lines: String = remarks(comparison).map(|line| line + "\n").collect();
    let table = table(comparison).text();
    format!("{}\n\n{table}\n{lines}", facts(comparison))
}

/// As a Markdown document.
pub fn markdown(comparison: &Comparison) -> String {
    let lines: String = remarks(comparison)
        .map(|line| "- ".to_owned() + &line + "\n")
        .collect();
    let table = table(comparison).markdown();
    format!(
        "# Methods compared\n\n{}\n\n{table}\n{lines}",
        facts(comparison)
    )
}

/// As CSV, one row per method; a figure that does not apply is empty.
pub fn csv(comparison: &Comparison) -> String {
    let files = truth_files(comparison);
    let of_files = files.iter().flat_map(|file| {
        let stem = file.trim_end_matches(".csv");
        ["rms_mm", "over_oracle", "unanswered"].map(|what| format!("{stem}_{what}"))
    });
    let header = CSV_COLUMNS.split(',').map(str::to_owned);
    let mut table = Table::new(header.chain(of_files));
    for method in &comparison.methods {
        table.push(csv_row(method, &files));
    }
    table.csv()
}

fn csv_row(method: &MethodFigures, files: &[&str]) -> Vec<String> {
    let held = method.held_out.as_ref();
    let training = method.training.as_ref();
    let mut row = vec![
        method.method.to_owned(),
        method.failure.clone().unwrap_or_default(),
        or_empty(training.map(|t| t.rms_px)),
        or_empty(training.map(|t| t.corners)),
        or_empty(training.map(|t| t.rejected)),
        or_empty(held.and_then(|h| h.rms_px)),
        or_empty(held.and_then(|h| h.median_px)),
        or_empty(held.and_then(|h| h.neighbor_rms_percent)),
        or_empty(held.and_then(|h| h.neighbor_rms_mm)),
        or_empty(held.and_then(|h| h.rigid_rms_mm)),
        or_empty(held.map(|h| h.points)),
        or_empty(held.map(|h| h.unanswered)),
    ];
    let ratios = method.against_first.as_ref();
    for ratio in [
        ratios.and_then(|r| r.residual),
        ratios.and_then(|r| r.neighbor),
        ratios.and_then(|r| r.rigid),
    ] {
        row.extend([
            or_empty(ratio.map(|r| r.ratio)),
            or_empty(ratio.map(|r| r.low)),
            or_empty(ratio.map(|r| r.high)),
        ]);
    }
    for file in files {
        let own = method.truth.iter().find(|set| set.file == *file);
        let errors = own.and_then(|set| set.errors.as_ref());
        row.extend([
            or_empty(errors.map(|e| e.placed_rms_mm)),
            or_empty(errors.map(|e| e.placed_ratio)),
            or_empty(own.map(|set| set.unanswered)),
        ]);
    }
    row
}

/// What was compared.
fn facts(comparison: &Comparison) -> String {
    let distance = comparison
        .working_distance_mm
        .map_or_else(String::new, |d| {
            format!(", {d:.0} mm from the first camera")
        });
    let held_out = if comparison.folds == 0 {
        "no held-out boards".to_owned()
    } else {
        format!(
            "held-out: {} boards in {} folds, {} of their {} corners that every method can answer{}",
            comparison.boards,
            comparison.folds,
            comparison.common_corners,
            comparison.held_out_corners,
            match comparison.outliers {
                0 => String::new(),
                count => format!(" ({count} wrong ones, which every method rejects, are left out)"),
            }
        )
    };
    format!(
        "{} poses, {} views, {} corners, squares of {} mm{distance}; {held_out}",
        comparison.poses, comparison.views, comparison.corners, comparison.square_mm
    )
}

/// Files of matches whose truth is known.
fn truth_files(comparison: &Comparison) -> Vec<&str> {
    let mut files: Vec<&str> = Vec::new();
    for set in comparison.methods.iter().flat_map(|method| &method.truth) {
        if !files.contains(&set.file.as_str()) {
            files.push(&set.file);
        }
    }
    files
}

/// One row per method.
fn table(comparison: &Comparison) -> Table {
    let files = truth_files(comparison);
    let of_file = |file: &&str| format!("{} mm (x oracle)", file.trim_end_matches(".csv"));
    let header = COLUMNS.map(str::to_owned).into_iter();
    let mut table = Table::new(header.chain(files.iter().map(of_file)));
    for method in &comparison.methods {
        table.push(row(method, &files));
    }
    table
}

fn row(method: &MethodFigures, files: &[&str]) -> Vec<String> {
    let number = |value: Option<f64>| or_dash(value.map(short));
    let held = method.held_out.as_ref();
    let of = |value: fn(&HeldOutFigures) -> Option<f64>| number(held.and_then(value));
    let mut row = vec![
        method.title.to_owned(),
        number(method.training.map(|t| t.rms_px)),
        of(|h| h.rms_px),
        of(|h| h.median_px),
        of(|h| h.neighbor_rms_percent),
        of(|h| h.neighbor_rms_mm),
        of(|h| h.rigid_rms_mm),
        or_dash(held.map(|h| h.points)),
        or_dash(held.map(|h| h.unanswered)),
        or_dash(method.training.map(|t| t.rejected)),
    ];
    row.extend(files.iter().map(|file| {
        let own = method.truth.iter().find(|set| set.file == *file);
        let errors = own.and_then(|set| set.errors.as_ref());
        or_dash(errors.map(|e| format!("{} ({:.3})", short(e.placed_rms_mm), e.placed_ratio)))
    }));
    row
}

/// What stands below the table.
fn remarks(comparison: &Comparison) -> impl Iterator<Item = String> {
    let conclusion = comparison.conclusion.iter().cloned();
    failures(comparison).into_iter().chain(conclusion)
}

/// Methods and folds without an answer, and why.
fn failures(comparison: &Comparison) -> Vec<String> {
    let mut lines = Vec::new();
    for method in &comparison.methods {
        if let Some(reason) = &method.failure {
            lines.push(format!("{}: no answer: {reason}", method.title));
        }
        if let Some(fold) = method.failed_folds.first() {
            lines.push(format!(
                "{}: {} fold(s) without an answer; fold {}: {}",
                method.title,
                method.failed_folds.len(),
                fold.fold,
                fold.reason
            ));
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::super::example::example;
    use super::*;
    use crate::snapshot::assert_snapshot;
    use std::time::Duration;

    #[test]
    fn every_form_has_every_method_and_the_conclusion() {
        let comparison = example();
        assert_snapshot("comparison_text", &text(&comparison));
        assert_snapshot("comparison_markdown", &markdown(&comparison));
        assert_snapshot("comparison_csv", &csv(&comparison));
    }

    #[test]
    fn a_method_without_an_answer_has_a_row_of_dashes_and_its_reason() {
        let mut comparison = example();
        comparison.methods[0] = MethodFigures {
            failure: Some("no pinhole".to_owned()),
            training: None,
            held_out: None,
            truth: Vec::new(),
            ..comparison.methods[0].clone()
        };
        assert_snapshot("comparison_with_a_failure", &text(&comparison));
    }

    #[test]
    fn times_are_in_no_file() {
        let mut slower = example();
        slower.methods[0].time = Duration::from_secs(301);
        let json = |comparison: &Comparison| serde_json::to_string(comparison).unwrap();
        assert_eq!(json(&slower), json(&example()));
    }
}
