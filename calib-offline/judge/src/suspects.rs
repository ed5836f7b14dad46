//! What explains the residuals of a calibration, as causes: named, dated, and with what they cost.

use super::cause::Cause;
use super::grade::Grade;
use super::half_data::rays_apart;
use super::held_out::Dealt;
use super::suspect_words::{Told, advice, told};
use super::working_volume::{compare, lattice, matches_at, span};
use calib_estimate::explain::{Explanation, Since, explain};
use calib_estimate::joint::Estimate;
use calib_rays::field::Rig;

/// A fault costs the verdict if it moves points by more than so many times what the calibration leaves
/// open anyway: below, another recording would differ by as much.
pub(crate) const COSTLY: f64 = 2.0;

/// Causes that the residuals of an estimate show, most important first. `rig` is that of the estimate.
///
/// Cost: one to three times that of the estimate.
pub fn suspects(estimate: &Estimate, rig: &Rig) -> Vec<Cause> {
    // Known places have no other reading, and few poses no before and after.
    if Dealt::of(&estimate.observations) == Some(Dealt::Points) {
        return Vec::new();
    }
    let names: Vec<String> = rig.cameras.iter().map(|c| c.name.clone()).collect();
    let distances = span(&estimate.board_distances_mm(rig));
    let mut before = rig.clone();
    let mut causes = Vec::new();
    for (found, mut explained) in explain(estimate) {
        let after = explained.rig(&names);
        let cost_mm = difference_mm(&before, &after, &distances).unwrap_or(0.0);
        let open_mm = left_open_mm(&mut explained, &after, &distances).unwrap_or(0.0);
        let is_costly = cost_mm > COSTLY * open_mm;
        causes.push(cause(&found, estimate, &names, cost_mm, is_costly));
        before = after;
    }
    causes
}

/// RMS distance between what two rigs measure at some distances, the best rigid motion taken out, mm: of
/// points, or of a camera alone, of its rays where they pass there. `None` if they have nothing in common.
pub fn difference_mm(first: &Rig, second: &Rig, distances_mm: &[f64]) -> Option<f64> {
    if first.cameras.len() > 1 {
        let matches = matches_at(first, distances_mm);
        return compare(first, second, &matches).map(|compared| compared.difference.rms_mm);
    }
    let (a, b) = (first.cameras.first()?, second.cameras.first()?);
    let mut pixels = lattice(&a.coverage, 1.0);
    pixels.retain(|pixel| b.coverage.contains(*pixel));
    let distance_mm = *distances_mm.get(1)?;
    let apart = rays_apart(&a.field, &b.field, &pixels, distance_mm)?;
    Some((apart.norm_squared() / pixels.len() as f64).sqrt())
}

/// What an estimate leaves open of the same, RMS, mm.
pub fn left_open_mm(estimate: &mut Estimate, rig: &Rig, distances_mm: &[f64]) -> Option<f64> {
    if rig.cameras.len() > 1 {
        let matches = matches_at(rig, distances_mm);
        let covariance = estimate.point_covariance(rig, &matches).ok()??;
        return Some((covariance.trace() / matches.len() as f64).sqrt());
    }
    let pixels = lattice(&rig.cameras.first()?.coverage, 1.0);
    let distance_mm = *distances_mm.get(1)?;
    let covariance = estimate
        .ray_covariance(rig, 0, &pixels, distance_mm)
        .ok()??;
    Some((covariance.trace() / pixels.len() as f64).sqrt())
}

/// An explanation in words.
fn cause(
    found: &Explanation,
    estimate: &Estimate,
    names: &[String],
    cost_mm: f64,
    is_costly: bool,
) -> Cause {
    let since_pose = match &found.since {
        Since::Before(idx) => estimate.observations.poses.get(*idx).copied(),
        Since::From(_) | Since::Always => None,
    };
    let Told { code, size, what } = told(found, estimate, names);
    let when = since_pose.map_or(String::new(), |pose| format!(" since pose {pose}"));
    Cause {
        code,
        since_pose,
        text: format!(
            "{what}{when}: {size}; it moves measured points by {cost_mm:.3} mm RMS; {}",
            advice(code)
        ),
        size,
        cost_mm,
        grade: if is_costly {
            Grade::Doubtful
        } else {
            Grade::Pass
        },
    }
}
