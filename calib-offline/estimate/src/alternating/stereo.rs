//! Poses that several cameras found, brought together (paper section 2.1, Eqs. 31 and 32).

use calib_rays::geometry::{RigidTransform, best_placement, so3};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Which mean of poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mean {
    /// Geodesic L2: the Karcher mean, and the mean of positions.
    L2,
    /// Geodesic L1: the median, robust from three cameras on. Of two, every rotation between them
    /// is a median; the first found is taken.
    L1,
}

/// Poses of the boards in the frame of camera `to`, as camera `from` sees them, brought into it by
/// the motion that suits all common poses best: `to_from_from`. `None` without a common pose.
pub fn relative_pose(
    to: &[Option<RigidTransform>],
    from: &[Option<RigidTransform>],
    corners_in_board: &[Vector3<f64>],
) -> Option<RigidTransform> {
    let (mut in_from, mut in_to) = (Vec::new(), Vec::new());
    for (a, b) in to.iter().zip(from) {
        if let (Some(a), Some(b)) = (a, b) {
            for corner in corners_in_board {
                in_to.push(a.point(corner));
                in_from.push(b.point(corner));
            }
        }
    }
    best_placement(&in_from, &in_to)
}

/// The mean of one board's poses, all in one frame: that of their rotations, and that of the
/// positions of the board's middle. `None` of none.
pub fn mean_pose(
    poses: &[RigidTransform],
    middle_in_board: &Vector3<f64>,
    mean: Mean,
) -> Option<RigidTransform> {
    let rotations: Vec<Matrix3<f64>> = poses.iter().map(|pose| pose.rotation).collect();
    let middles: Vec<Vector3<f64>> = poses.iter().map(|p| p.point(middle_in_board)).collect();
    let (rotation, middle) = match mean {
        Mean::L2 => (
            so3::karcher_mean(&rotations)?,
            middles.iter().sum::<Vector3<f64>>() / middles.len() as f64,
        ),
        Mean::L1 => (so3::geodesic_median(&rotations)?, median_point(&middles)?),
    };
    Some(RigidTransform::new(
        rotation,
        middle - rotation * middle_in_board,
    ))
}

/// The point with the least sum of distances (Weiszfeld), from the best of the points on.
fn median_point(points: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    let cost = |p: &Vector3<f64>| points.iter().map(|q| (p - q).norm()).sum::<f64>();
    let mut median = *points.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
    for _ in 0..100 {
        let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
        for point in points {
            let weight = 1.0 / (point - median).norm().max(1e-12);
            sum += point * weight;
            weights += weight;
        }
        let next = sum / weights;
        let step = (next - median).norm();
        median = next;
        if step < 1e-12 {
            break;
        }
    }
    Some(median)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(about: Vector3<f64>, middle: Vector3<f64>, place: Vector3<f64>) -> RigidTransform {
        let rotation = so3::exp(&about);
        RigidTransform::new(rotation, place - rotation * middle)
    }

    #[test]
    fn of_two_poses_the_mean_is_halfway() {
        let middle = Vector3::new(60.0, 70.0, 0.0);
        let poses = [
            turned(Vector3::z() * 0.2, middle, Vector3::new(1.0, 0.0, 300.0)),
            turned(Vector3::z() * 0.6, middle, Vector3::new(3.0, 0.0, 302.0)),
        ];
        let mean = mean_pose(&poses, &middle, Mean::L2).unwrap();
        assert!((mean.rotation - so3::exp(&(Vector3::z() * 0.4))).norm() < 1e-14);
        assert!((mean.point(&middle) - Vector3::new(2.0, 0.0, 301.0)).norm() < 1e-12);
    }

    #[test]
    fn of_three_poses_the_median_ignores_the_odd_one() {
        let middle = Vector3::zeros();
        let right = turned(Vector3::x() * 0.1, middle, Vector3::new(0.0, 0.0, 300.0));
        let wrong = turned(Vector3::x() * 0.5, middle, Vector3::new(9.0, 0.0, 300.0));
        let median = mean_pose(&[right, wrong, right], &middle, Mean::L1).unwrap();
        assert!((median.rotation - right.rotation).norm() < 1e-9);
        assert!((median.translation_mm - right.translation_mm).norm() < 1e-9);
    }

    #[test]
    fn cameras_are_joined_by_their_common_poses_only() {
        let to_from_from = turned(
            Vector3::y() * 0.5,
            Vector3::zeros(),
            Vector3::new(200.0, 0.0, 20.0),
        );
        let boards: Vec<RigidTransform> = (0..3)
            .map(|k| {
                let k = f64::from(k);
                turned(
                    Vector3::x() * 0.2 * k,
                    Vector3::zeros(),
                    Vector3::new(k, -k, 300.0),
                )
            })
            .collect();
        let to: Vec<_> = boards
            .iter()
            .map(|pose| Some(to_from_from * *pose))
            .chain([None])
            .collect();
        let from: Vec<_> = [None]
            .into_iter()
            .chain(boards[1..].iter().map(|p| Some(*p)))
            .chain([Some(boards[0])])
            .collect();
        let corners = [[0.0, 0.0, 0.0], [90.0, 0.0, 0.0], [0.0, 80.0, 0.0]].map(Vector3::from);
        let found = relative_pose(&to, &from, &corners).unwrap();
        assert!((found.rotation - to_from_from.rotation).norm() < 1e-13);
        assert!((found.translation_mm - to_from_from.translation_mm).norm() < 1e-10);
        assert!(relative_pose(&to[..1], &from[..1], &corners).is_none());
    }
}
