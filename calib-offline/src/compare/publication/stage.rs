//! Angle of each pose about the stage's axis against the dial (publication, Fig. 8).

use super::runs::{InDatum, MethodRun, solved};
use calib_judge::fit_stage_axes;
use calib_rays::geometry::RigidTransform;
use calib_rays::geometry::so3;
use calib_rays::numerics::rms;
use calib_recording::dataset::stage::StageEntry;
use nalgebra::Vector3;
use serde::Serialize;

/// One pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StageAngle {
    /// Its number.
    pub pose: usize,
    /// Its placement.
    pub placement: usize,
    /// The dial, degrees.
    pub dial_deg: f64,
    /// Found minus dialed, the mean of the placement taken out, degrees: where the dial's zero lies
    /// is not known.
    pub error_deg: f64,
}

/// What a method found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodAngles {
    /// Its name.
    pub method: &'static str,
    /// RMS over all poses, degrees.
    pub rms_deg: f64,
    /// RMS per placement of what is not a turn about the axis, degrees.
    pub wobble_rms_deg: Vec<f64>,
    /// Per pose.
    pub angles: Vec<StageAngle>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageExperiment {
    /// Of the methods that have a calibration.
    pub methods: Vec<MethodAngles>,
}

/// Compares with the dial.
///
/// # Errors
/// In words, if the dataset has no dial readings or no placement with three of them.
pub fn run(
    runs: &[MethodRun],
    entry: &dyn Fn(usize) -> StageEntry,
) -> Result<StageExperiment, String> {
    let methods: Vec<MethodAngles> = solved(runs)
        .filter_map(|(method, found)| angles(method, found, entry))
        .collect();
    if methods.is_empty() {
        return Err(
            "it needs [stage] with angles_deg and placement, and a placement with three poses"
                .to_owned(),
        );
    }
    Ok(StageExperiment { methods })
}

fn angles(
    method: &'static str,
    found: &InDatum,
    entry: &dyn Fn(usize) -> StageEntry,
) -> Option<MethodAngles> {
    let poses = &found.datum_from_board;
    let axes = fit_stage_axes(poses, |pose| {
        entry(pose).angle_deg.and(entry(pose).placement)
    });
    let mut angles = Vec::new();
    for axis in &axes {
        let dialed: Vec<(usize, f64, RigidTransform)> = poses
            .iter()
            .filter(|(pose, _)| entry(*pose).placement == Some(axis.placement))
            .filter_map(|(pose, board)| Some((*pose, entry(*pose).angle_deg?, *board)))
            .collect();
        for (pose, dial_deg, error_deg) in errors_deg(&dialed, &axis.direction) {
            angles.push(StageAngle {
                pose,
                placement: axis.placement,
                dial_deg,
                error_deg,
            });
        }
    }
    let errors: Vec<f64> = angles.iter().map(|angle| angle.error_deg).collect();
    Some(MethodAngles {
        method,
        rms_deg: rms(&errors)?,
        wobble_rms_deg: axes.iter().map(|a| a.wobble_rms_rad.to_degrees()).collect(),
        angles,
    })
}

/// Number, dial and error of poses that turned about one axis.
fn errors_deg(
    poses: &[(usize, f64, RigidTransform)],
    axis: &Vector3<f64>,
) -> Vec<(usize, f64, f64)> {
    let mut by_dial: Vec<&(usize, f64, RigidTransform)> = poses.iter().collect();
    by_dial.sort_by(|a, b| a.1.total_cmp(&b.1));
    // Turns are counted from the middle of the dial: the shortest, and far from half a turn.
    let Some((_, zero_deg, zero)) = by_dial.get(by_dial.len() / 2) else {
        return Vec::new();
    };
    let turns: Vec<f64> = poses
        .iter()
        .map(|(_, _, pose)| {
            let turn = so3::log(&(pose.rotation * zero.rotation.transpose()));
            turn.dot(axis).to_degrees()
        })
        .collect();
    // Which way round the axis points is not known.
    let sum: f64 = poses
        .iter()
        .zip(&turns)
        .map(|((_, dial, _), turn)| (dial - zero_deg) * turn)
        .sum();
    let sign = 1f64.copysign(sum);
    let raw: Vec<f64> = poses
        .iter()
        .zip(&turns)
        .map(|((_, dial, _), turn)| {
            let off = sign * turn - (dial - zero_deg);
            off - 360.0 * (off / 360.0).round()
        })
        .collect();
    let mean = raw.iter().sum::<f64>() / raw.len() as f64;
    poses
        .iter()
        .zip(raw)
        .map(|((pose, dial, _), error)| (*pose, *dial, error - mean))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_by_the_dial_have_no_error_and_one_that_slipped_has() {
        let axis = Vector3::new(0.1, 0.99, -0.05).normalize();
        let start = so3::exp(&Vector3::new(0.2, -0.1, 0.3));
        let pose = |k: usize, slip_deg: f64| {
            let dial = 17.0 * k as f64 - 130.0;
            let turn = so3::exp(&(axis * (-dial - slip_deg).to_radians()));
            (k, dial, RigidTransform::new(turn * start, Vector3::zeros()))
        };
        let exact: Vec<_> = (0..16).map(|k| pose(k, 0.0)).collect();
        // Round-off of a logarithm far from zero.
        assert!(errors_deg(&exact, &axis).iter().all(|e| e.2.abs() < 1e-10));
        let slipped: Vec<_> = (0..16)
            .map(|k| pose(k, f64::from(u8::from(k == 3))))
            .collect();
        let errors = errors_deg(&slipped, &axis);
        assert!((errors[3].2 - 15.0 / 16.0).abs() < 1e-10);
        assert!((errors[4].2 + 1.0 / 16.0).abs() < 1e-10);
    }
}
