//! Measuring in integers, on a device whose core has no floating-point unit.

use ray_runtime::integer::{self, Unsuited};
use ray_runtime::{MeasureError, RayBlob};

use super::measure::sightings;
use crate::protocol::{
    Arithmetic, MAX_CAMERAS_LISTED, Match, Measured, Point, Refusal, SelfTestReport,
};

/// A blob prepared: as many cameras as a device's status lists.
pub type Rig<'a> = integer::Rig<'a, MAX_CAMERAS_LISTED>;

/// The blob in use, where integers are asked for, or why they cannot look it up.
pub fn prepared<'a>(
    arithmetic: Arithmetic,
    blob: &Result<RayBlob<'a>, u8>,
) -> Option<Result<Rig<'a>, u8>> {
    let blob = blob.as_ref().ok()?;
    (arithmetic == Arithmetic::Integer).then(|| Rig::prepare(blob).map_err(Unsuited::code))
}

/// What is prepared, if anything is to be.
pub fn of<'r, 'a>(rig: Option<&'r Result<Rig<'a>, u8>>) -> Result<Option<&'r Rig<'a>>, Refusal> {
    match rig {
        None => Ok(None),
        Some(Ok(rig)) => Ok(Some(rig)),
        Some(Err(open_error)) => Err(Refusal::NoBlob {
            open_error: *open_error,
        }),
    }
}

/// The answer to a match.
pub fn measure(rig: &Rig<'_>, asked: &Match) -> Measured {
    let [first, second] = sightings(asked);
    let outcome = rig.triangulate(first, second);
    Measured {
        id: asked.id,
        outcome: outcome.map(Point::from).map_err(MeasureError::code),
    }
}

/// The self-tests for which the blob states what integers answer: none, if it was packed without.
#[inline(never)]
pub fn report(rig: &Rig<'_>, blob: &RayBlob<'_>) -> SelfTestReport {
    let mut report = SelfTestReport {
        tests: 0,
        equal: 0,
        unanswered: 0,
        worst_mm: 0.0,
        worst_direction: 0.0,
    };
    for (question, expected) in integer::expected_answers(blob) {
        if expected.is_empty() {
            continue;
        }
        report.tests = report.tests.saturating_add(1);
        let Some(answer) = rig.answer(&question) else {
            report.unanswered = report.unanswered.saturating_add(1);
            continue;
        };
        let found = answer.numbers().iter().copied();
        let expected = expected.iter().map(|bytes| f32::from_le_bytes(*bytes));
        let is_equal = found
            .clone()
            .map(f32::to_bits)
            .eq(expected.clone().map(f32::to_bits));
        if is_equal {
            report.equal = report.equal.saturating_add(1);
        }
        // Three lengths first; of a ray three parts of a direction behind them.
        for (at, (found, expected)) in found.zip(expected).enumerate() {
            let difference = (found - expected).abs();
            match at {
                0..3 => report.worst_mm = report.worst_mm.max(difference),
                _ if answer.numbers().len() == 6 => {
                    report.worst_direction = report.worst_direction.max(difference);
                }
                _ => {}
            }
        }
    }
    report
}
