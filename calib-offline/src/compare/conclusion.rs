//! What a comparison comes to, in plain words.

use super::bootstrap::Ratio;
use super::record::{Comparison, HeldOutFigures, MethodFigures, Ratios};
use crate::present::numbers::short;

/// A difference by less than this share matters to nobody, however certain it is.
const MATTERS: f64 = 0.05;

/// What is compared on held-out boards.
struct Measure {
    name: &'static str,
    unit: &'static str,
    ratio: fn(&Ratios) -> Option<Ratio>,
    value: fn(&HeldOutFigures) -> Option<f64>,
}

/// From what users care about most.
const MEASURES: [Measure; 3] = [
    Measure {
        name: "distance from the rigid board",
        unit: "mm",
        ratio: |ratios| ratios.rigid,
        value: |figures| figures.rigid_rms_mm,
    },
    Measure {
        name: "error of neighbor distances",
        unit: "mm",
        ratio: |ratios| ratios.neighbor,
        value: |figures| figures.neighbor_rms_mm,
    },
    Measure {
        name: "residual",
        unit: "px",
        ratio: |ratios| ratios.residual,
        value: |figures| figures.rms_px,
    },
];

/// What a ratio says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Says {
    Better,
    Same,
    Worse,
}

fn says(ratio: &Ratio) -> Says {
    if ratio.high < 1.0 && ratio.ratio <= 1.0 - MATTERS {
        Says::Better
    } else if ratio.low > 1.0 && ratio.ratio >= 1.0 + MATTERS {
        Says::Worse
    } else {
        Says::Same
    }
}

/// A sentence for each method against the first, and one that sums up.
pub fn conclude(comparison: &Comparison) -> Vec<String> {
    let Some((first, others)) = comparison.methods.split_first() else {
        return Vec::new();
    };
    let mut lines = Vec::new();
    if let Some(reason) = &first.failure {
        lines.push(format!("A {} is no model here: {reason}.", first.title));
        lines.extend(others.iter().filter_map(alone));
        return lines;
    }
    for other in others {
        lines.push(match (&other.failure, &other.against_first) {
            (Some(reason), _) => format!("{}: no answer: {reason}.", other.title),
            (None, Some(ratios)) => against(other, first, ratios),
            (None, None) => format!(
                "{}: not compared on boards it never saw: too few poses for folds, or too many folds \
                 without an answer.",
                other.title
            ),
        });
    }
    if let Some((ratios, last)) = others
        .iter()
        .rev()
        .find_map(|other| Some((other.against_first.as_ref()?, other)))
    {
        lines.push(summary(ratios, first, last));
    }
    lines.extend(truth(comparison));
    lines
}

/// Of a method without the first beside it.
fn alone(method: &MethodFigures) -> Option<String> {
    let held_out = method.held_out.as_ref()?;
    let facts: Vec<String> = MEASURES
        .iter()
        .filter_map(|m| {
            Some(format!(
                "{} {} {}",
                m.name,
                short((m.value)(held_out)?),
                m.unit
            ))
        })
        .collect();
    Some(format!(
        "{}, on boards it never saw: {}.",
        method.title,
        facts.join(", ")
    ))
}

fn against(other: &MethodFigures, first: &MethodFigures, ratios: &Ratios) -> String {
    let facts: Vec<String> = MEASURES
        .iter()
        .filter_map(|m| {
            let ratio = (m.ratio)(ratios)?;
            Some(format!(
                "{} {:.3} of it ({:.3} to {:.3})",
                m.name, ratio.ratio, ratio.low, ratio.high
            ))
        })
        .collect();
    format!(
        "{} against {}, on boards that neither saw, with 95 % intervals: {}.",
        other.title,
        first.title,
        facts.join(", ")
    )
}

fn summary(ratios: &Ratios, first: &MethodFigures, other: &MethodFigures) -> String {
    let found: Vec<(&Measure, Says)> = MEASURES
        .iter()
        .filter_map(|m| Some((m, says(&(m.ratio)(ratios)?))))
        .collect();
    let change = |m: &Measure| {
        let value = |figures: &MethodFigures| {
            figures
                .held_out
                .as_ref()
                .and_then(m.value)
                .map_or_else(String::new, short)
        };
        let percent = (m.ratio)(ratios).map_or(0.0, |ratio| 100.0 * (1.0 - ratio.ratio));
        let direction = if percent > 0.0 { "less" } else { "more" };
        format!(
            "{} is {} {unit} instead of {} {unit}, {:.0} % {direction}",
            m.name,
            value(other),
            value(first),
            percent.abs(),
            unit = m.unit
        )
    };
    let changes = |wanted: &[Says]| -> String {
        let named = found.iter().filter(|(_, says)| wanted.contains(says));
        named
            .map(|(m, _)| change(m))
            .collect::<Vec<_>>()
            .join(", the ")
    };
    let is = |wanted: Says| found.iter().any(|(_, says)| *says == wanted);
    match (is(Says::Better), is(Says::Worse)) {
        (false, false) => format!(
            "A pinhole is enough here: {} changes no error by more than chance or {:.0} %.",
            other.title,
            100.0 * MATTERS
        ),
        (true, false) => format!(
            "A pinhole is not enough here: with {} the {}.",
            other.title,
            changes(&[Says::Better, Says::Same])
        ),
        (false, true) => format!(
            "A pinhole is better here: with {} the {}.",
            other.title,
            changes(&[Says::Worse, Says::Same])
        ),
        (true, true) => format!(
            "Neither is better throughout: with {} the {}, but the {}.",
            other.title,
            changes(&[Says::Better]),
            changes(&[Says::Worse])
        ),
    }
}

/// What the truth says, where it is known.
fn truth(comparison: &Comparison) -> Option<String> {
    let facts: Vec<String> = comparison
        .methods
        .iter()
        .filter_map(|method| {
            let ratios: Vec<String> = method
                .truth
                .iter()
                .filter_map(|set| Some(format!("{:.3}", set.errors.as_ref()?.placed_ratio)))
                .collect();
            let is_known = !ratios.is_empty();
            is_known.then(|| format!("{} {}", method.title, ratios.join(" | ")))
        })
        .collect();
    (!facts.is_empty()).then(|| {
        format!(
            "Error against the truth over that of the true rays (points | holdout): {}.",
            facts.join("; ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::example::example;

    fn with_ratio(ratio: f64, low: f64, high: f64) -> String {
        let mut comparison = example();
        let ratio = Ratio {
            ratio,
            low,
            high,
            boards: 20,
        };
        comparison.methods[1].against_first = Some(Ratios {
            residual: Some(ratio),
            neighbor: None,
            rigid: None,
        });
        conclude(&comparison).join("\n")
    }

    #[test]
    fn only_what_is_certain_and_matters_is_called_a_difference() {
        assert!(with_ratio(0.8, 0.7, 0.9).contains("not enough here"));
        assert!(with_ratio(0.8, 0.7, 1.1).contains("enough here: ray field"));
        assert!(with_ratio(0.98, 0.97, 0.99).contains("enough here: ray field"));
        assert!(with_ratio(1.2, 1.1, 1.3).contains("A pinhole is better here"));
    }

    #[test]
    fn measures_that_disagree_are_both_named() {
        let mut comparison = example();
        let ratio = |ratio: f64| {
            Some(Ratio {
                ratio,
                low: ratio - 0.01,
                high: ratio + 0.01,
                boards: 20,
            })
        };
        comparison.methods[1].against_first = Some(Ratios {
            residual: ratio(0.5),
            neighbor: ratio(1.5),
            rigid: ratio(1.0),
        });
        let text = conclude(&comparison).join("\n");
        assert!(text.contains("Neither is better throughout"), "{text}");
        assert!(
            text.contains("50 % less") && text.contains("50 % more"),
            "{text}"
        );
    }

    #[test]
    fn a_method_without_an_answer_says_why_and_the_other_stands() {
        let mut comparison = example();
        comparison.methods[0].failure = Some("it sees more than a half space".to_owned());
        let text = conclude(&comparison).join("\n");
        assert!(text.contains("no model here: it sees more than a half space"));
        assert!(
            text.contains("ray field, joint, on boards it never saw"),
            "{text}"
        );
        let mut comparison = example();
        comparison.methods[1].failure = Some("singular".to_owned());
        let text = conclude(&comparison).join("\n");
        assert!(
            text.contains("ray field, joint: no answer: singular."),
            "{text}"
        );
    }
}
