//! The axis of the rotation stage, from the estimated poses alone: boards that turned about one
//! axis differ by rotations about it, and the axis is where those rotations leave points at rest.

use calib_rays::geometry::{RigidTransform, so3};
use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Turns smaller than this say nothing of their axis, rad.
const MIN_TURN_RAD: f64 = 1e-3;

/// The axis that the boards of one placement turned about, rig frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageAxis {
    /// Number of the placement.
    pub placement: usize,
    /// Poses that it was found from.
    pub poses: usize,
    /// The point of the axis nearest to the boards' middle, mm.
    #[schemars(with = "[f64; 3]")]
    pub point_mm: Vector3<f64>,
    /// Unit vector along it.
    #[schemars(with = "[f64; 3]")]
    pub direction: Vector3<f64>,
    /// RMS over pairs of poses of the part of their turn that is not about the axis, rad.
    pub wobble_rms_rad: f64,
}

/// One axis per placement, for the placements that have one.
///
/// `rig_from_board` has the number of each pose and where its board was; `placement_of` says which placement
/// a pose number belongs to, and poses without one are left out.
/// A placement with fewer than three poses, or that hardly turned, has no axis.
pub fn fit_stage_axes(
    rig_from_board: &[(usize, RigidTransform)],
    placement_of: impl Fn(usize) -> Option<usize>,
) -> Vec<StageAxis> {
    let mut placements: BTreeMap<usize, Vec<RigidTransform>> = BTreeMap::new();
    for (pose, board) in rig_from_board {
        if let Some(placement) = placement_of(*pose) {
            placements.entry(placement).or_default().push(*board);
        }
    }
    placements
        .into_iter()
        .filter_map(|(placement, poses)| fit(placement, &poses))
        .collect()
}

fn fit(placement: usize, poses: &[RigidTransform]) -> Option<StageAxis> {
    if poses.len() < 3 {
        return None;
    }
    let pairs = || {
        poses
            .iter()
            .enumerate()
            .flat_map(|(i, a)| poses[i + 1..].iter().map(move |b| *b * a.inverse()))
    };
    // Rotation vectors of all pairs, turned to one side: long ones know the direction best.
    let turns: Vec<Vector3<f64>> = pairs().map(|turn| so3::log(&turn.rotation)).collect();
    let longest = turns
        .iter()
        .copied()
        .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    let sum: Vector3<f64> = turns
        .iter()
        .map(|t| if t.dot(&longest) < 0.0 { -t } else { *t })
        .sum();
    let direction = sum.try_normalize(MIN_TURN_RAD)?;
    let point_mm = resting_point(pairs(), &direction, &centroid(poses))?;
    let off_axis: f64 = turns
        .iter()
        .map(|t| (t - direction * t.dot(&direction)).norm_squared())
        .sum();
    Some(StageAxis {
        placement,
        poses: poses.len(),
        point_mm,
        direction,
        wobble_rms_rad: (off_axis / turns.len() as f64).sqrt(),
    })
}

/// The point of the axis nearest to `near`: the turns leave it where it is, but for a shift along
/// the axis.
fn resting_point(
    turns: impl Iterator<Item = RigidTransform>,
    direction: &Vector3<f64>,
    near: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    // (I - R) p = t across the axis; along the axis p = near, as the one equation that is free.
    let across = Matrix3::identity() - direction * direction.transpose();
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for turn in turns {
        let a = across * (Matrix3::identity() - turn.rotation);
        normal += a.transpose() * a;
        right += a.transpose() * (across * turn.translation_mm);
    }
    let pin = direction * direction.transpose() * (normal.trace() + f64::MIN_POSITIVE);
    let solution = (normal + pin).try_inverse()? * (right + pin * near);
    solution.iter().all(|v| v.is_finite()).then_some(solution)
}

fn centroid(poses: &[RigidTransform]) -> Vector3<f64> {
    poses
        .iter()
        .map(|pose| pose.translation_mm)
        .sum::<Vector3<f64>>()
        / poses.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(axis_point: Vector3<f64>, axis: Vector3<f64>, angle: f64) -> RigidTransform {
        let rotation = so3::exp(&(axis * angle));
        let start = RigidTransform::new(
            so3::exp(&Vector3::new(0.2, -0.1, 0.3)),
            Vector3::new(40.0, -20.0, 300.0),
        );
        RigidTransform::new(rotation, axis_point - rotation * axis_point) * start
    }

    #[test]
    fn the_axis_that_boards_turned_about_is_found() {
        let axis = Vector3::new(0.1, 0.98, -0.05).normalize();
        let point = Vector3::new(55.0, 10.0, 330.0);
        let poses: Vec<_> = (0..9)
            .map(|k| (k, turned(point, axis, 0.17 * (k as f64 - 4.0))))
            .collect();
        let axes = fit_stage_axes(&poses, |pose| (pose < 8).then_some(3));
        assert_eq!(axes.len(), 1);
        let found = &axes[0];
        assert_eq!((found.placement, found.poses), (3, 8));
        // Round-off of a 3 x 3 inverse at hundreds of millimeters.
        assert!(found.direction.cross(&axis).norm() < 1e-12);
        assert!((found.point_mm - point).cross(&axis).norm() < 1e-9);
        assert!(found.wobble_rms_rad < 1e-12);
    }

    #[test]
    fn boards_that_did_not_turn_have_no_axis() {
        let axis = Vector3::y();
        let still: Vec<_> = (0..5)
            .map(|k| (k, turned(Vector3::zeros(), axis, 0.0)))
            .collect();
        assert!(fit_stage_axes(&still, |_| Some(0)).is_empty());
        assert!(fit_stage_axes(&still[..2], |_| Some(0)).is_empty());
        assert!(fit_stage_axes(&still, |_| None).is_empty());
    }
}
