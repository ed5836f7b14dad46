//! Dial readings against the turns of the boards: found minus dialed. A dial may count either way, and
//! from any zero; what is no dial of that stage at all is said, though nothing is computed from it.

use super::finding::cause;
use crate::cause::{Cause, Code};
use crate::stage_axis::fit_stage_axes;
use crate::verdict::Grade;
use calib_rays::geometry::{RigidTransform, so3};
use calib_rays::numerics::rms;
use calib_recording::dataset::stage::StageEntry;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Readings that scatter by less than this against the turns found, degrees RMS, are believed: half a
/// degree is more than any stage misses, and more than a board's pose does.
const BELIEVED_DEG: f64 = 0.5;
/// Readings understood otherwise must fit better by this factor.
const CLEAR: f64 = 3.0;
/// Readings are tried as those of so many poses before or after.
const MOST_STEPS: i64 = 2;
/// Fewer readings say nothing.
const LEAST: usize = 4;

/// How the dial counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Dial {
    /// Whether a larger reading turns the board counterclockwise, seen from where the axis points up
    /// (in the first camera's image).
    pub counterclockwise: bool,
    /// Found minus dialed, RMS, degrees; each placement has a zero of its own.
    pub rms_deg: f64,
    /// The largest, degrees.
    pub largest_deg: f64,
}

impl Dial {
    /// The sense in a word.
    pub const fn sense(&self) -> &'static str {
        if self.counterclockwise {
            "counterclockwise"
        } else {
            "clockwise"
        }
    }
}

/// One pose: turn found, reading, placement.
struct Reading {
    found_deg: f64,
    dialed_deg: f64,
    placement: usize,
}

/// The dial, and what is wrong with it; `None` without readings or turns to compare.
///
/// `rig_from_board` has the number of each pose, in order; `up_in_rig` is the first camera's upward
/// direction. Poses without placement count as one.
pub fn dial(
    rig_from_board: &[(usize, RigidTransform)],
    up_in_rig: &Vector3<f64>,
    entry: impl Fn(usize) -> StageEntry,
) -> Option<(Dial, Option<Cause>)> {
    let placement = |pose: usize| entry(pose).placement.unwrap_or(0);
    let axes = fit_stage_axes(rig_from_board, |pose| Some(placement(pose)));
    let directions: BTreeMap<usize, Vector3<f64>> = axes
        .iter()
        .map(|axis| {
            let up = axis.direction.dot(up_in_rig);
            (
                axis.placement,
                if up < 0.0 {
                    -axis.direction
                } else {
                    axis.direction
                },
            )
        })
        .collect();
    let mut first: BTreeMap<usize, RigidTransform> = BTreeMap::new();
    let readings: Vec<Reading> = rig_from_board
        .iter()
        .filter_map(|(pose, board)| {
            let placement = placement(*pose);
            let direction = directions.get(&placement)?;
            let start = *first.entry(placement).or_insert(*board);
            let turn = so3::log(&(board.rotation * start.rotation.transpose()));
            Some(Reading {
                found_deg: turn.dot(direction).to_degrees(),
                dialed_deg: entry(*pose).angle_deg?,
                placement,
            })
        })
        .collect();
    if readings.len() < LEAST {
        return None;
    }
    let as_read = [1.0, -1.0].map(|sense| misfit(&readings, sense, 0));
    let [plus, minus] = as_read.map(|m| m.map_or((f64::INFINITY, 0.0), |m| m));
    let counterclockwise = plus.0 <= minus.0;
    let (rms_deg, largest_deg) = if counterclockwise { plus } else { minus };
    let dial = Dial {
        counterclockwise,
        rms_deg,
        largest_deg,
    };
    Some((
        dial,
        (rms_deg > BELIEVED_DEG).then(|| wrong(&readings, &dial)),
    ))
}

/// RMS and largest of found minus `scale` times the reading of the pose so many on, every placement
/// with a zero of its own, degrees.
fn misfit(readings: &[Reading], scale: f64, steps: i64) -> Option<(f64, f64)> {
    let mut of_placement: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for (k, reading) in readings.iter().enumerate() {
        let other = i64::try_from(k).ok()?.checked_add(steps)?;
        let Some(other) = usize::try_from(other).ok().and_then(|k| readings.get(k)) else {
            continue;
        };
        let apart = reading.found_deg - scale * other.dialed_deg;
        of_placement
            .entry(reading.placement)
            .or_default()
            .push(apart);
    }
    let mut apart = Vec::new();
    for differences in of_placement.values() {
        let zero = differences[0];
        let wrapped = differences
            .iter()
            .map(|d| (d - zero + 180.0).rem_euclid(360.0) - 180.0);
        let wrapped: Vec<f64> = wrapped.collect();
        let mean = wrapped.iter().sum::<f64>() / wrapped.len() as f64;
        apart.extend(wrapped.into_iter().map(|d| d - mean));
    }
    let largest = apart.iter().fold(0.0, |most: f64, d| most.max(d.abs()));
    (apart.len() >= LEAST).then_some((rms(&apart)?, largest))
}

/// What the readings may be instead.
fn wrong(readings: &[Reading], dial: &Dial) -> Cause {
    let sense = if dial.counterclockwise { 1.0 } else { -1.0 };
    let in_radians = [1.0, -1.0].map(|sense: f64| (sense.to_degrees(), 0));
    let out_of_step = (-MOST_STEPS..=MOST_STEPS)
        .filter(|steps| *steps != 0)
        .flat_map(|steps| [(1.0, steps), (-1.0, steps)]);
    // The scale that fits best: least squares through the placements' means.
    let scaled = best_scale(readings).map(|scale| (scale, 0));
    let tried = in_radians.into_iter().chain(out_of_step).chain(scaled);
    let best = tried
        .filter_map(|(scale, steps)| Some((scale, steps, misfit(readings, scale, steps)?.0)))
        .min_by(|a, b| a.2.total_cmp(&b.2))
        .filter(|(_, _, rms_deg)| CLEAR * rms_deg < dial.rms_deg);
    let why = match best {
        Some((_, steps, rms_deg)) if steps != 0 => format!(
            "taken as those of the pose {} {} they fit to {rms_deg:.2} degrees",
            steps.abs(),
            if steps > 0 { "after" } else { "before" }
        ),
        Some((scale, _, rms_deg)) if (scale.abs().to_radians() - 1.0).abs() < 0.02 => {
            format!("taken as radians they fit to {rms_deg:.2} degrees")
        }
        Some((scale, _, rms_deg)) => {
            format!(
                "times {:.4} they fit to {rms_deg:.2} degrees",
                scale * sense
            )
        }
        None => "nothing simple makes them fit".to_owned(),
    };
    cause(
        Code::StageAngles,
        Grade::Pass,
        format!("{:.1} degrees RMS", dial.rms_deg),
        0.0,
        format!(
            "angles_deg and the turns of the boards differ by {:.1} degrees RMS (largest {:.1}): {why}; no \
             result depends on them",
            dial.rms_deg, dial.largest_deg
        ),
    )
}

fn best_scale(readings: &[Reading]) -> Option<f64> {
    let mut of_placement: BTreeMap<usize, Vec<&Reading>> = BTreeMap::new();
    for reading in readings {
        of_placement
            .entry(reading.placement)
            .or_default()
            .push(reading);
    }
    let (mut product, mut square) = (0.0, 0.0);
    for group in of_placement.values() {
        let count = group.len() as f64;
        let found = group.iter().map(|r| r.found_deg).sum::<f64>() / count;
        let dialed = group.iter().map(|r| r.dialed_deg).sum::<f64>() / count;
        for r in group {
            product += (r.dialed_deg - dialed) * (r.found_deg - found);
            square += (r.dialed_deg - dialed).powi(2);
        }
    }
    (square > 0.0).then(|| product / square)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two placements of six turns about axes that stand up, counted by a dial.
    fn checked(dialed: impl Fn(usize, f64) -> f64) -> (Dial, Option<Cause>) {
        let boards: Vec<_> = (0..12)
            .map(|k| {
                let turn = (15.0 * (k % 6) as f64 - 40.0).to_radians();
                let start = so3::exp(&Vector3::new(0.1, 0.2, 0.05 * (k / 6) as f64));
                let rotation = so3::exp(&Vector3::new(0.0, -turn, 0.0)) * start;
                (
                    k,
                    RigidTransform::new(rotation, Vector3::new(0.0, 0.0, 500.0)),
                )
            })
            .collect();
        let entry = |k: usize| StageEntry {
            angle_deg: Some(dialed(k, 15.0 * (k % 6) as f64 - 40.0)),
            placement: Some(k / 6),
        };
        dial(&boards, &Vector3::new(0.0, -1.0, 0.0), entry).unwrap()
    }

    #[test]
    fn either_sense_is_right_and_said() {
        let (forth, cause) = checked(|_, angle| angle);
        assert_eq!(cause, None);
        let (back, cause) = checked(|_, angle| 7.0 - angle);
        assert_eq!(cause, None);
        assert!(forth.counterclockwise && !back.counterclockwise);
        assert!(forth.rms_deg < 1e-9 && back.rms_deg < 1e-9);
    }

    #[test]
    fn radians_steps_and_scales_are_told() {
        let text = |dialed: fn(usize, f64) -> f64| checked(dialed).1.unwrap().text;
        assert!(text(|_, angle| angle.to_radians()).contains("radians"));
        assert!(text(|k, _| 15.0 * ((k + 1) % 6) as f64).contains("1 before"));
        assert!(text(|_, angle| 0.5 * angle).contains("times 2.0000"));
        assert!(text(|k, _| [0.0, 31.0, 7.0, 90.0, 12.0][k % 5]).contains("nothing simple"));
    }
}
