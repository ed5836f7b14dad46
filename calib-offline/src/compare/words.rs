//! A comparison as a table for the terminal, as Markdown, and as CSV.

use super::record::{Comparison, HeldOutFigures, MethodFigures};
use crate::report::text::short;
use std::fmt::Write as _;

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
    let table = table(comparison);
    let widths: Vec<usize> = (0..table[0].len())
        .map(|k| {
            table
                .iter()
                .map(|row| row[k].chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    let mut text = facts(comparison) + "\n\n";
    for row in &table {
        let mut line = String::new();
        for (k, (cell, &width)) in row.iter().zip(&widths).enumerate() {
            // Writing to a String cannot fail.
            let _ = if k == 0 {
                write!(line, "{cell:<width$}")
            } else {
                write!(line, "  {cell:>width$}")
            };
        }
        text += line.trim_end();
        text += "\n";
    }
    text += "\n";
    for line in failures(comparison).iter().chain(&comparison.conclusion) {
        text += line;
        text += "\n";
    }
    text
}

/// As a Markdown document.
pub fn markdown(comparison: &Comparison) -> String {
    let mut text = format!("# Methods compared\n\n{}\n\n", facts(comparison));
    for (k, row) in table(comparison).iter().enumerate() {
        let cells: Vec<String> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
        // Writing to a String cannot fail.
        let _ = writeln!(text, "| {} |", cells.join(" | "));
        if k == 0 {
            let _ = writeln!(text, "| --- |{}", " ---: |".repeat(row.len() - 1));
        }
    }
    text += "\n";
    for line in failures(comparison).iter().chain(&comparison.conclusion) {
        let _ = writeln!(text, "- {line}");
    }
    text
}

/// As CSV, one row per method; a figure that does not apply is empty.
pub fn csv(comparison: &Comparison) -> Vec<u8> {
    let mut text = String::new();
    let files = truth_files(comparison);
    let mut header: Vec<String> = CSV_COLUMNS
        .split(',')
        .map(|name| name.trim().to_owned())
        .collect();
    for file in &files {
        let stem = file.trim_end_matches(".csv");
        header.extend(["rms_mm", "over_oracle", "unanswered"].map(|what| format!("{stem}_{what}")));
    }
    let rows = comparison.methods.iter().map(|m| csv_row(m, &files));
    for row in std::iter::once(header).chain(rows) {
        let fields: Vec<String> = row.iter().map(|field| quoted(field)).collect();
        text += &fields.join(",");
        text += "\n";
    }
    text.into_bytes()
}

/// A field as CSV has it: in quotes where it would be taken for several.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

fn csv_row(method: &MethodFigures, files: &[&str]) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let count = |value: Option<usize>| value.map_or_else(String::new, |value| value.to_string());
    let held = method.held_out.as_ref();
    let training = method.training.as_ref();
    let mut row = vec![
        method.method.to_owned(),
        method.failure.clone().unwrap_or_default(),
        number(training.map(|t| t.rms_px)),
        count(training.map(|t| t.corners)),
        count(training.map(|t| t.rejected)),
        number(held.and_then(|h| h.rms_px)),
        number(held.and_then(|h| h.median_px)),
        number(held.and_then(|h| h.neighbor_rms_percent)),
        number(held.and_then(|h| h.neighbor_rms_mm)),
        number(held.and_then(|h| h.rigid_rms_mm)),
        count(held.map(|h| h.points)),
        count(held.map(|h| h.unanswered)),
    ];
    let ratios = method.against_first.as_ref();
    for ratio in [
        ratios.and_then(|r| r.residual),
        ratios.and_then(|r| r.neighbor),
        ratios.and_then(|r| r.rigid),
    ] {
        row.extend([
            number(ratio.map(|r| r.ratio)),
            number(ratio.map(|r| r.low)),
            number(ratio.map(|r| r.high)),
        ]);
    }
    for file in files {
        let own = method.truth.iter().find(|set| set.file == *file);
        let errors = own.and_then(|set| set.errors.as_ref());
        row.extend([
            number(errors.map(|e| e.placed_rms_mm)),
            number(errors.map(|e| e.placed_ratio)),
            count(own.map(|set| set.unanswered)),
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

/// Header and one row per method.
fn table(comparison: &Comparison) -> Vec<Vec<String>> {
    let files = truth_files(comparison);
    let mut header: Vec<String> = COLUMNS.map(str::to_owned).into();
    header.extend(
        files
            .iter()
            .map(|file| format!("{} mm (x oracle)", file.trim_end_matches(".csv"))),
    );
    let rows = comparison.methods.iter().map(|method| row(method, &files));
    std::iter::once(header).chain(rows).collect()
}

fn row(method: &MethodFigures, files: &[&str]) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), short);
    let count = |value: Option<usize>| value.map_or_else(|| "-".to_owned(), |n| n.to_string());
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
        count(held.map(|h| h.points)),
        count(held.map(|h| h.unanswered)),
        count(method.training.map(|t| t.rejected)),
    ];
    row.extend(files.iter().map(|file| {
        let own = method.truth.iter().find(|set| set.file == *file);
        own.and_then(|set| set.errors.as_ref()).map_or_else(
            || "-".to_owned(),
            |e| format!("{} ({:.3})", short(e.placed_rms_mm), e.placed_ratio),
        )
    }));
    row
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
        let csv = String::from_utf8(csv(&comparison)).unwrap();
        assert_snapshot("comparison_csv", &csv);
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
