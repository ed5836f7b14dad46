//! Where a target is whose points do not lie in a plane: the direct linear transform of its bearings.

use calib_rays::geometry::{RigidTransform, so3};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector4};

/// Fewest points that determine the twelve numbers of the map.
const MIN_POINTS: usize = 6;
/// Steps that turn the map into a pose; it is good to a percent.
const STEPS: usize = 6;

/// `camera_from_target` from bearings of any length: `d x (A X + b) = 0` for each point, `(A, b)` being the
/// smallest eigenvector of the 12 x 12 normal matrix, A brought to the nearest rotation, then Gauss-Newton steps
/// on the angles.
///
/// `None` if the points determine no such map.
pub fn solid_pose(bearings: &[Vector3<f64>], points: &[Vector3<f64>]) -> Option<RigidTransform> {
    if points.len() < MIN_POINTS {
        return None;
    }
    let count = points.len() as f64;
    let centroid = points.iter().sum::<Vector3<f64>>() / count;
    let squared: f64 = points.iter().map(|p| (p - centroid).norm_squared()).sum();
    let scale = (squared / count).sqrt();
    if !(scale > 0.0) {
        return None;
    }
    let mut normal = SMatrix::<f64, 12, 12>::zeros();
    for (bearing, point) in bearings.iter().zip(points) {
        let p = (point - centroid) / scale;
        let x = Vector4::new(p.x, p.y, p.z, 1.0);
        let cross = so3::skew(&bearing.normalize());
        for row in 0..3 {
            let equation = SVector::<f64, 12>::from_fn(|k, _| cross[(row, k % 3)] * x[k / 3]);
            normal += equation * equation.transpose();
        }
    }
    let eigen = normal.symmetric_eigen();
    let smallest = eigen.eigenvalues.imin();
    let found = eigen.eigenvectors.column(smallest);
    let column = |k: usize| Vector3::new(found[3 * k], found[3 * k + 1], found[3 * k + 2]);
    let mut map = Matrix3::from_columns(&[column(0), column(1), column(2)]);
    let mut shift = column(3);
    let in_front: f64 = bearings
        .iter()
        .zip(points)
        .map(|(bearing, point)| {
            let seen = map * ((point - centroid) / scale) + shift;
            bearing.dot(&seen).signum()
        })
        .sum();
    if in_front < 0.0 {
        map = -map;
        shift = -shift;
    }
    let length = map.determinant().abs().cbrt();
    if !(length > 0.0) {
        return None;
    }
    let rotation = so3::nearest_rotation(&(map / length))?;
    let translation = shift * (scale / length) - rotation * centroid;
    Some(refined(
        RigidTransform::new(rotation, translation),
        bearings,
        points,
    ))
}

/// Gauss-Newton steps on the sines of the angles between points and bearings, as long as they get smaller.
fn refined(
    start: RigidTransform,
    bearings: &[Vector3<f64>],
    points: &[Vector3<f64>],
) -> RigidTransform {
    let mut pose = start;
    let mut cost = f64::INFINITY;
    let mut best = start;
    for _ in 0..STEPS {
        let mut normal = SMatrix::<f64, 6, 6>::zeros();
        let mut gradient = SVector::<f64, 6>::zeros();
        let mut sum = 0.0;
        for (bearing, point) in bearings.iter().zip(points) {
            let d = bearing.normalize();
            let turned = pose.rotation * point;
            let seen = turned + pose.translation_mm;
            let far = seen.norm();
            // What of the point lies across the bearing, per unit of its distance.
            let across = Matrix3::identity() - d * d.transpose();
            let miss = across * seen / far;
            let by_point = across / far;
            let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
            by_pose
                .fixed_view_mut::<3, 3>(0, 0)
                .copy_from(&-(by_point * so3::skew(&turned)));
            by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&by_point);
            normal += by_pose.transpose() * by_pose;
            gradient += by_pose.transpose() * miss;
            sum += miss.norm_squared();
        }
        if !(sum < cost) {
            break;
        }
        cost = sum;
        best = pose;
        let Some(factor) = normal.cholesky() else {
            break;
        };
        pose = pose.stepped(&factor.solve(&-gradient)).orthonormalized();
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_bearings_of_a_solid_give_its_pose() {
        let points: Vec<Vector3<f64>> = (0..27)
            .map(|k| {
                let [x, y, z] = [k % 3, k / 3 % 3, k / 9].map(f64::from);
                Vector3::new(40.0 * x, 30.0 * y, 50.0 * z + 7.0 * x)
            })
            .collect();
        for (phi, t) in [
            ([0.3, -0.4, 0.1], [-30.0, -20.0, 400.0]),
            ([0.1, 2.4, 0.7], [40.0, 10.0, 350.0]),
        ] {
            let truth = RigidTransform::new(so3::exp(&phi.into()), t.into());
            let bearings: Vec<_> = points.iter().map(|p| truth.point(p) * 0.01).collect();
            let pose = solid_pose(&bearings, &points).unwrap();
            assert!((pose.translation_mm - truth.translation_mm).norm() < 1e-6);
            assert!((pose.rotation - truth.rotation).norm() < 1e-9);
        }
    }
}
