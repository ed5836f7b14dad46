//! What was measured, line by line: for the terminal and for the page.

use super::unseen::BoardFigures;
use super::{DeviceCheck, Measured, UnseenBoards};
use crate::present::numbers::short;
use calib_judge::known_points::KnownPoints;

/// Name and fact, one pair per line.
pub fn lines(measured: &Measured) -> Vec<(String, String)> {
    let mut lines = Vec::new();
    if let Some(unseen) = &measured.unseen_boards {
        lines.push(("unseen boards".to_owned(), of_unseen(unseen)));
    }
    for known in &measured.known_points {
        lines.push((known.file.clone(), of_known(known)));
    }
    for device in &measured.devices {
        lines.push(("device".to_owned(), of_device(device)));
    }
    if let Some(reason) = &measured.no_cortex_m {
        lines.push(("device".to_owned(), format!("no Cortex-M: {reason}")));
    }
    lines
}

fn of_unseen(unseen: &UnseenBoards) -> String {
    let all = of_boards(&unseen.as_recorded, unseen.square_mm);
    let without = match unseen.as_used.pairs {
        pairs if pairs < unseen.as_recorded.pairs => format!(
            "; without the pairs that the calibration leaves out: {}",
            of_boards(&unseen.as_used, unseen.square_mm)
        ),
        _ => String::new(),
    };
    format!(
        "{all}{without}; {} folds by pose, each measured by the runtime (f32) from a blob of its own",
        unseen.folds
    )
}

fn of_boards(figures: &BoardFigures, square_mm: f64) -> String {
    let unmet = match figures.unmet {
        0 => String::new(),
        count => format!(", {count} with rays that do not meet"),
    };
    format!(
        "{} % RMS, {} % median of the {square_mm} mm square between neighboring corners ({} mm \
         RMS), {} mm RMS from the rigid board; {} pairs, {} points, {} outside{unmet}",
        short(figures.neighbor_rms_percent),
        short(figures.neighbor_median_percent),
        short(figures.neighbor_rms_mm),
        short(figures.rigid_rms_mm),
        figures.pairs,
        figures.points,
        figures.outside,
    )
}

fn of_known(known: &KnownPoints) -> String {
    let Some(errors) = &known.errors else {
        return format!("none of {} matches could be compared", known.matches);
    };
    format!(
        "{} mm RMS from the truth in the datum frame ({:.3} of the oracle's {} mm), {} mm after \
         the best rigid placement ({:.3}); {} of {} matches have a point, measured by the \
         runtime (f32)",
        short(errors.direct_rms_mm),
        errors.direct_ratio,
        short(errors.oracle_rms_mm),
        short(errors.placed_rms_mm),
        errors.placed_ratio,
        errors.points,
        known.matches,
    )
}

fn of_device(check: &DeviceCheck) -> String {
    let verdict = match check.different {
        0 => "the host's bits in every answer".to_owned(),
        count => format!("{count} answers DIFFER from the host's"),
    };
    let [equal, tests] = check.self_tests;
    format!(
        "{}: flashed into slot {}, {equal} of {tests} self-tests, {} matches, {} points, {verdict}",
        check.device, check.slot, check.matches, check.points
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demo::page::{Entry, page};
    use crate::snapshot::{assert_snapshot, visible_text};
    use calib_judge::known_points::TruthErrors;

    fn boards(pairs: usize, unmet: usize) -> BoardFigures {
        BoardFigures {
            pairs,
            neighbor_rms_percent: 0.152,
            neighbor_rms_mm: 0.0152,
            neighbor_median_percent: 0.08,
            rigid_rms_mm: 0.0113,
            points: 195 * pairs,
            outside: 7,
            unmet,
        }
    }

    fn known(errors: Option<TruthErrors>) -> KnownPoints {
        KnownPoints {
            file: "matches.csv".to_owned(),
            matches: 500,
            without_point: 2,
            errors,
        }
    }

    fn device(different: usize) -> DeviceCheck {
        DeviceCheck {
            device: "Cortex-M4F".to_owned(),
            slot: 1,
            self_tests: [16, 16],
            matches: 500,
            points: 498,
            different,
        }
    }

    #[test]
    fn all_that_was_measured_in_words() {
        let measured = Measured {
            unseen_boards: Some(UnseenBoards {
                folds: 5,
                square_mm: 10.0,
                as_recorded: boards(34, 3),
                as_used: boards(32, 0),
                blob_error_px: 0.001,
            }),
            known_points: vec![
                known(Some(TruthErrors {
                    points: 498,
                    direct_rms_mm: 0.022,
                    placed_rms_mm: 0.021,
                    oracle_rms_mm: 0.02,
                    direct_ratio: 1.1,
                    placed_ratio: 1.05,
                })),
                known(None),
            ],
            devices: vec![device(0), device(3)],
            no_cortex_m: Some("no QEMU".to_owned()),
        };
        let page = page(&[Entry {
            name: "recording",
            verdict: "pass",
            measured: &measured,
            report: "recording/report.html".to_owned(),
        }]);
        assert!(page.contains("href=\"recording/report.html\""));
        assert_snapshot("demo", &visible_text(&page));
    }
}
