//! The table of outcomes: a row per fault.

use crate::arguments::Case;
use crate::program::{Outcome, Program};
use crate::summary::{Judged, faultless_mm, is_named, is_right, judged};
use calib_simulate::faults::{Poses, Rig};

/// Unanswered matches that are worth a word, as a share.
const UNANSWERED: f64 = 0.05;
/// Letters of a reason that a row has room for.
const REASON: usize = 90;

/// Prints the rows of a rig.
pub fn print(rig: Rig, programs: &[Program], cases: &[Case], all: &[Vec<Outcome>]) {
    let mut head = String::from("| fault | shown | to be named |");
    for program in programs {
        let name = program.name;
        head.extend([
            " ",
            name,
            ": error RMS (max), mm | verdict | first cause | right | why |",
        ]);
    }
    println!("{head}");
    println!("|{}", " --- |".repeat(head.matches('|').count() - 1));
    let mut done: Vec<(&str, Poses)> = Vec::new();
    for case in cases.iter().filter(|case| case.rig == rig) {
        let key = (case.fault.name, case.poses);
        if done.contains(&key) {
            continue;
        }
        done.push(key);
        let draws: Vec<usize> = (0..cases.len())
            .filter(|&k| cases[k].rig == rig && (cases[k].fault.name, cases[k].poses) == key)
            .collect();
        let codes = match case.fault.codes {
            [] => "-".to_owned(),
            codes => codes.join(", "),
        };
        let mut row = format!("| {} | {} | {codes} |", case.fault.name, case.poses.name());
        for program in 0..programs.len() {
            let faultless = faultless_mm(case, program, cases, all);
            let outcomes: Vec<_> = draws
                .iter()
                .map(|&k| (&cases[k], &all[k][program]))
                .collect();
            row += &cells(&outcomes, faultless);
        }
        println!("{row}");
    }
}

/// Error, verdict, cause, whether right, and why, of the draws of a fault.
fn cells(outcomes: &[(&Case, &Outcome)], faultless_mm: f64) -> String {
    let verdicts = counted(outcomes.iter().map(|(_, outcome)| outcome.verdict.clone()));
    let causes = counted(outcomes.iter().map(|(_, outcome)| match &outcome.cause {
        None => "-".to_owned(),
        Some((code, Some(pose))) if outcomes.len() == 1 => format!("{code} from {pose}"),
        Some((code, _)) => code.clone(),
    }));
    let right = counted(outcomes.iter().map(|(case, outcome)| {
        let named = if is_named(case, outcome) {
            ", named"
        } else {
            ""
        };
        match (
            is_right(case, outcome, faultless_mm),
            judged(case, outcome, faultless_mm),
        ) {
            (Some(true), _) => format!("yes{named}"),
            (Some(false), _) => format!("**no**{named}"),
            (None, Judged::Unseen) => "cannot be seen".to_owned(),
            (None, _) => format!("harmless{named}"),
        }
    }));
    let mut reason: String = outcomes[0].1.reason.replace('|', "/");
    if reason.chars().count() > REASON {
        reason = reason.chars().take(REASON).chain("...".chars()).collect();
    }
    format!(
        " {} | {verdicts} | {causes} | {right} | {reason} |",
        errors(outcomes)
    )
}

/// RMS over all draws, and the worst point of any.
fn errors(outcomes: &[(&Case, &Outcome)]) -> String {
    let errors: Vec<_> = outcomes
        .iter()
        .filter_map(|(_, outcome)| outcome.error)
        .collect();
    if errors.is_empty() {
        return "-".to_owned();
    }
    let count = errors.len() as f64;
    let rms = (errors.iter().map(|e| e.rms * e.rms).sum::<f64>() / count).sqrt();
    let most = errors.iter().map(|e| e.most).fold(0.0, f64::max);
    let unanswered = errors.iter().map(|e| e.unanswered).sum::<f64>() / count;
    let missing = if unanswered > UNANSWERED {
        format!(", {:.0} % unanswered", 100.0 * unanswered)
    } else {
        String::new()
    };
    format!("{} ({}){missing}", digits(rms), digits(most))
}

/// Two digits that count.
fn digits(value: f64) -> String {
    let places = (1.0 - value.abs().log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.places$}")
}

/// Each text once, with its number where there are several.
fn counted(texts: impl Iterator<Item = String>) -> String {
    let mut counts: Vec<(String, usize)> = Vec::new();
    for text in texts {
        match counts.iter_mut().find(|(other, _)| *other == text) {
            Some((_, count)) => *count += 1,
            None => counts.push((text, 1)),
        }
    }
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    if let [(text, _)] = &counts[..] {
        return text.clone();
    }
    let parts = counts.iter().map(|(text, count)| format!("{count} {text}"));
    parts.collect::<Vec<_>>().join(", ")
}
