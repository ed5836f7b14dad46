//! The rigid transform between two sets of points (Kabsch; Umeyama without scale).

use super::{RigidTransform, so3};
use nalgebra::{Matrix3, Vector3};

/// The rigid transform that brings `from` nearest to `to` in the least-squares sense (Kabsch).
///
/// `None` for fewer than 3 points.
pub fn best_placement(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Option<RigidTransform> {
    if from.len() < 3 {
        return None;
    }
    let n = from.len() as f64;
    let from_mean = from.iter().sum::<Vector3<f64>>() / n;
    let to_mean = to.iter().sum::<Vector3<f64>>() / n;
    let covariance: Matrix3<f64> = from
        .iter()
        .zip(to)
        .map(|(f, t)| (t - to_mean) * (f - from_mean).transpose())
        .sum();
    let rotation = so3::nearest_rotation(&covariance)?;
    Some(RigidTransform::new(
        rotation,
        to_mean - rotation * from_mean,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_is_found_again_and_two_points_give_none() {
        let truth = RigidTransform::new(
            so3::exp(&Vector3::new(0.3, -1.0, 0.2)),
            Vector3::new(5.0, -7.0, 300.0),
        );
        let from = [
            [0.0, 0.0, 0.0],
            [90.0, 0.0, 0.0],
            [0.0, 60.0, 0.0],
            [50.0, 40.0, 0.0],
        ]
        .map(Vector3::from);
        let to = from.map(|point| truth.point(&point));
        let found = best_placement(&from, &to).unwrap();
        // Round-off at hundreds of millimeters.
        assert!((found.rotation - truth.rotation).norm() < 1e-13);
        assert!((found.translation_mm - truth.translation_mm).norm() < 1e-11);
        assert_eq!(best_placement(&from[..2], &to[..2]), None);
    }
}
