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
    use crate::snapshot::assert_snapshot;

    fn ratio(ratio: f64, low: f64, high: f64) -> Ratio {
        Ratio {
            ratio,
            low,
            high,
            boards: 20,
        }
    }

    #[test]
    fn only_what_is_certain_and_matters_is_called_a_difference() {
        for (found, expected) in [
            (ratio(0.8, 0.7, 0.9), Says::Better),
            (ratio(0.8, 0.7, 1.1), Says::Same),
            (ratio(0.98, 0.97, 0.99), Says::Same),
            (ratio(1.2, 1.1, 1.3), Says::Worse),
        ] {
            assert_eq!(says(&found), expected, "{found:?}");
        }
    }

    #[test]
    fn every_conclusion_in_words() {
        let with_ratios = |residual, neighbor, rigid| {
            let mut comparison = example();
            comparison.methods[1].against_first = Some(Ratios {
                residual: Some(residual),
                neighbor,
                rigid,
            });
            comparison
        };
        let failed = |method: usize, why: &str| {
            let mut comparison = example();
            comparison.methods[method].failure = Some(why.to_owned());
            comparison.methods[1].against_first = None;
            comparison
        };
        let about = |at: f64| ratio(at, at - 0.01, at + 0.01);
        let cases = [
            ("better", with_ratios(about(0.8), None, None)),
            ("the same", with_ratios(ratio(0.8, 0.7, 1.1), None, None)),
            ("worse", with_ratios(about(1.2), None, None)),
            (
                "measures that disagree",
                with_ratios(about(0.5), Some(about(1.5)), Some(about(1.0))),
            ),
            (
                "without the first",
                failed(0, "it sees more than a half space"),
            ),
            ("without the second", failed(1, "singular")),
        ];
        let text = cases.map(|(name, comparison)| {
            let lines = conclude(&comparison);
            assert!(!lines.is_empty(), "{name}");
            format!("{name}:\n{}\n", lines.join("\n"))
        });
        assert_snapshot("conclusions", &text.join("\n"));
    }
}
