//! How an outcome is judged, and the figures of all of them.

use crate::arguments::Case;
use crate::program::{Outcome, Program};
use calib_simulate::faults::Poses;

/// A fault costs something where errors are so many times those of the faultless recording.
const COSTS: f64 = 4.0;

/// What there is to say of an outcome.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Judged {
    /// The faultless recording, or one that is none the worse and measures as well.
    Harmless,
    /// No program could see it.
    Unseen,
    /// It can be seen, and costs.
    Costs,
}

/// Judges one outcome by the RMS error of the faultless recordings, mm.
pub fn judged(case: &Case, outcome: &Outcome, faultless_mm: f64) -> Judged {
    if !case.fault.is_visible {
        return Judged::Unseen;
    }
    let costs = match outcome.error {
        Some(error) => error.rms > COSTS * faultless_mm,
        None => true,
    };
    if costs && !is_faultless(case) {
        Judged::Costs
    } else {
        Judged::Harmless
    }
}

/// Whether nothing is wrong.
pub fn is_faultless(case: &Case) -> bool {
    case.fault.codes.is_empty() && case.fault.is_visible
}

/// Whether the verdict is right; `None` where any is.
pub fn is_right(case: &Case, outcome: &Outcome, faultless_mm: f64) -> Option<bool> {
    match judged(case, outcome, faultless_mm) {
        _ if is_faultless(case) => Some(outcome.is_silent()),
        Judged::Costs => Some(!outcome.is_silent()),
        Judged::Harmless | Judged::Unseen => None,
    }
}

/// Whether the first cause is one of those that the fault may be called by.
pub fn is_named(case: &Case, outcome: &Outcome) -> bool {
    let code = outcome.cause.as_ref().map(|(code, _)| code.as_str());
    code.is_some_and(|code| case.fault.codes.contains(&code))
}

/// RMS error of a program over the faultless recordings that are shown as a case's is, mm.
pub fn faultless_mm(case: &Case, program: usize, cases: &[Case], all: &[Vec<Outcome>]) -> f64 {
    let squares: Vec<f64> = cases
        .iter()
        .zip(all)
        .filter(|(other, _)| is_like(other, case.rig.name(), case.poses) && is_faultless(other))
        .filter_map(|(_, outcomes)| outcomes[program].error)
        .map(|error| error.rms * error.rms)
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn is_like(case: &Case, rig: &str, poses: Poses) -> bool {
    case.rig.name() == rig && case.poses == poses
}

/// Prints the figures of every program.
pub fn print(programs: &[Program], cases: &[Case], all: &[Vec<Outcome>]) {
    let names: Vec<_> = programs.iter().map(|program| program.name).collect();
    println!("\n| figure | {} |", names.join(" | "));
    println!("| --- |{}", " --- |".repeat(names.len()));
    let row = |title: &str, figure: &dyn Fn(&[Row]) -> String| {
        let figures = (0..programs.len()).map(|program| {
            let rows: Vec<Row> = cases
                .iter()
                .zip(all)
                .map(|(case, outcomes)| Row {
                    case,
                    outcome: &outcomes[program],
                    judged: judged(
                        case,
                        &outcomes[program],
                        faultless_mm(case, program, cases, all),
                    ),
                })
                .collect();
            figure(&rows)
        });
        println!("| {title} | {} |", figures.collect::<Vec<_>>().join(" | "));
    };
    let costs = |row: &&Row| row.judged == Judged::Costs;
    row(
        "can be seen, costs more than 4 times the faultless error, passed silently",
        &|rows| {
            let all: Vec<_> = rows.iter().filter(costs).collect();
            let silent = all.iter().filter(|row| row.outcome.is_silent()).count();
            format!("{silent} of {}", all.len())
        },
    );
    row("the same: true cause named first", &|rows| {
        let all: Vec<_> = rows.iter().filter(costs).collect();
        let named = all.iter().filter(|row| is_named(row.case, row.outcome));
        share(named.count(), all.len())
    });
    row(
        "can be seen, whatever it costs: true cause named first",
        &|rows| {
            let all: Vec<_> = rows
                .iter()
                .filter(|row| row.case.fault.is_visible && !is_faultless(row.case))
                .collect();
            let named = all.iter().filter(|row| is_named(row.case, row.outcome));
            share(named.count(), all.len())
        },
    );
    row("change half way, named: since its first pose", &|rows| {
        let named = |row: &&Row| row.case.fault.is_half_way && is_named(row.case, row.outcome);
        let all: Vec<_> = rows.iter().filter(named).collect();
        let since = |row: &&&Row| {
            let cause = row.outcome.cause.as_ref();
            let half = row.case.poses.count() / 2;
            cause.and_then(|(_, since)| *since) == Some(half as u64)
        };
        share(all.iter().filter(since).count(), all.len())
    });
    row("faultless: not \"pass\"", &|rows| {
        let all: Vec<_> = rows.iter().filter(|row| is_faultless(row.case)).collect();
        let not = all.iter().filter(|row| !row.outcome.is_silent()).count();
        share(not, all.len())
    });
    row("faultless: a cause named", &|rows| {
        let all: Vec<_> = rows.iter().filter(|row| is_faultless(row.case)).collect();
        let named = all.iter().filter(|row| row.outcome.cause.is_some()).count();
        share(named, all.len())
    });
}

struct Row<'a> {
    case: &'a Case,
    outcome: &'a Outcome,
    judged: Judged,
}

fn share(count: usize, of: usize) -> String {
    format!(
        "{count} of {of}, {:.0} %",
        100.0 * count as f64 / of.max(1) as f64
    )
}
