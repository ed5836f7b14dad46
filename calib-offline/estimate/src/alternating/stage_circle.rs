//! The rotation stage in the poses of one placement (paper section 1.2, Eqs. 6 to 12).
//!
//! Every corner of the board runs along a circle about the stage's axis. All circles of a placement
//! share one normal, found from all corners together; the publication takes one for each corner,
//! which leaves each to its own noise. Its linear system for center and radius (10, 11) is singular as
//! printed: the points lie in a plane, and the center is free along the normal. Here it is solved
//! in the plane.

use calib_rays::geometry::{RigidTransform, best_placement, so3};
use calib_rays::numerics::SingularValues;
use nalgebra::{Matrix3, Matrix3x2, MatrixXx3, Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fewest poses of a placement: three points always have a circle.
pub const MIN_POSES: usize = 4;
/// Least turn between the outermost poses, rad: circles of shorter arcs have no center.
pub const MIN_SWEEP_RAD: f64 = 0.1;

/// The axis of one placement and what turned about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageCircles {
    /// The point of the axis nearest to the corners' mean, mm.
    #[schemars(with = "[f64; 3]")]
    pub point_mm: Vector3<f64>,
    /// Unit vector along it: the common normal of the circles.
    #[schemars(with = "[f64; 3]")]
    pub direction: Vector3<f64>,
    /// Radius of each corner's circle, mm, in the order of the corners.
    pub radii_mm: Vec<f64>,
    /// Turn of each pose about the axis, from the first, rad, in (-pi, pi].
    pub angles_rad: Vec<f64>,
    /// RMS distance of corners from their circles, mm: radially, and along the axis.
    pub radial_rms_mm: f64,
    /// See [`Self::radial_rms_mm`].
    pub axial_rms_mm: f64,
}

/// A plane with two axes in it.
struct Plane {
    normal: Vector3<f64>,
    axes: Matrix3x2<f64>,
}

/// The common normal of the trajectories (6, 7): the direction in which the corners' places, each
/// corner's mean taken off, extend least. `trajectories[k][i]`: corner k at pose i.
fn common_plane(trajectories: &[Vec<Vector3<f64>>]) -> Option<Plane> {
    let rows: Vec<Vector3<f64>> = trajectories
        .iter()
        .flat_map(|places| {
            let mean = mean(places);
            places.iter().map(move |place| place - mean)
        })
        .collect();
    let svd = SingularValues::new(MatrixXx3::from_fn(rows.len(), |r, c| rows[r][c]))?;
    let normal = svd.null_direction()?;
    let first: Vector3<f64> = svd.right.column_iter().next()?.into_owned();
    Some(Plane {
        normal,
        axes: Matrix3x2::from_columns(&[first, normal.cross(&first)]),
    })
}

/// The circle of points in a plane with the least sum of squared algebraic distances (8 to 11):
/// center and radius.
fn fit_circle(points: &[Vector2<f64>]) -> Option<(Vector2<f64>, f64)> {
    // About the mean, so that no digits are lost.
    let mean = points.iter().sum::<Vector2<f64>>() / points.len() as f64;
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let scale = points.iter().map(|p| (p - mean).norm()).fold(0.0, f64::max);
    for point in points {
        let p = (point - mean) / scale;
        let row = Vector3::new(2.0 * p.x, 2.0 * p.y, 1.0);
        normal += row * row.transpose();
        right += row * p.norm_squared();
    }
    let solution = normal.cholesky()?.solve(&right);
    let center = solution.xy();
    let radius = (solution.z + center.norm_squared()).sqrt();
    (radius.is_finite()).then(|| (mean + center * scale, radius * scale))
}

fn mean(points: &[Vector3<f64>]) -> Vector3<f64> {
    points.iter().sum::<Vector3<f64>>() / points.len() as f64
}

/// Fits the circles of one placement and projects the poses onto them (12).
///
/// `corners_in_board` are any three or more points of the board that do not lie on a line. `None`
/// for fewer than [`MIN_POSES`] poses, a sweep below [`MIN_SWEEP_RAD`], or places that fit no
/// circles.
pub fn project_onto_circles(
    poses: &[RigidTransform],
    corners_in_board: &[Vector3<f64>],
) -> Option<(StageCircles, Vec<RigidTransform>)> {
    let first = poses.first()?;
    if poses.len() < MIN_POSES {
        return None;
    }
    let trajectories: Vec<Vec<Vector3<f64>>> = corners_in_board
        .iter()
        .map(|corner| poses.iter().map(|pose| pose.point(corner)).collect())
        .collect();
    let plane = common_plane(&trajectories)?;
    let turns: Vec<f64> = poses
        .iter()
        .map(|pose| so3::log(&(pose.rotation * first.rotation.transpose())).dot(&plane.normal))
        .collect();
    let sweep = turns.iter().copied().fold(f64::MIN, f64::max)
        - turns.iter().copied().fold(f64::MAX, f64::min);
    if !(sweep >= MIN_SWEEP_RAD) {
        return None;
    }
    let mut circles = StageCircles {
        point_mm: Vector3::zeros(),
        direction: plane.normal,
        radii_mm: Vec::new(),
        angles_rad: turns,
        radial_rms_mm: 0.0,
        axial_rms_mm: 0.0,
    };
    let mut projected = Vec::new();
    let mut centers = Vec::new();
    let (mut radial, mut axial) = (0.0, 0.0);
    for places in &trajectories {
        let in_plane: Vec<Vector2<f64>> = places.iter().map(|p| plane.axes.tr_mul(p)).collect();
        let (center, radius) = fit_circle(&in_plane)?;
        let height = plane.normal.dot(&mean(places));
        let on_circle: Vec<Vector3<f64>> = in_plane
            .iter()
            .map(|p| {
                let across = p - center;
                plane.axes * (center + across * (radius / across.norm())) + plane.normal * height
            })
            .collect();
        for (place, p) in places.iter().zip(&in_plane) {
            radial += ((p - center).norm() - radius).powi(2);
            axial += (plane.normal.dot(place) - height).powi(2);
        }
        centers.push(plane.axes * center + plane.normal * height);
        circles.radii_mm.push(radius);
        projected.push(on_circle);
    }
    let count = (trajectories.len() * poses.len()) as f64;
    circles.radial_rms_mm = f64::sqrt(radial / count);
    circles.axial_rms_mm = f64::sqrt(axial / count);
    circles.point_mm = mean(&centers);
    let moved = (0..poses.len())
        .map(|i| {
            let places: Vec<Vector3<f64>> = projected.iter().map(|corner| corner[i]).collect();
            best_placement(corners_in_board, &places)
        })
        .collect::<Option<Vec<RigidTransform>>>()?;
    Some((circles, moved))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners() -> Vec<Vector3<f64>> {
        [
            [0.0, 0.0],
            [120.0, 0.0],
            [0.0, 140.0],
            [120.0, 140.0],
            [50.0, 30.0],
        ]
        .map(|[x, y]| Vector3::new(x, y, 0.0))
        .into()
    }

    /// Boards about an axis through `point`.
    fn stage(angles_deg: &[f64]) -> (Vector3<f64>, Vector3<f64>, Vec<RigidTransform>) {
        let axis = Vector3::new(0.1, 0.98, -0.05).normalize();
        let point = Vector3::new(55.0, 10.0, 330.0);
        let start = RigidTransform::new(
            so3::exp(&Vector3::new(0.2, -0.1, 0.3)),
            Vector3::new(40.0, -20.0, 250.0),
        );
        let poses = angles_deg
            .iter()
            .map(|angle| {
                let turn = so3::exp(&(axis * angle.to_radians()));
                RigidTransform::new(turn, point - turn * point) * start
            })
            .collect();
        (axis, point, poses)
    }

    #[test]
    fn exact_circles_are_recovered() {
        let angles = [-40.0, -25.0, -10.0, 0.0, 20.0, 35.0];
        let (axis, point, poses) = stage(&angles);
        let (circles, moved) = project_onto_circles(&poses, &corners()).unwrap();
        let sign = circles.direction.dot(&axis).signum();
        assert!((circles.direction * sign - axis).norm() < 1e-9);
        assert!((circles.point_mm - point).cross(&axis).norm() < 1e-9 * 330.0);
        for (found, angle) in circles.angles_rad.iter().zip(angles) {
            assert!((sign * found - (angle + 40.0).to_radians()).abs() < 1e-9);
        }
        for (corner, radius) in corners().iter().zip(&circles.radii_mm) {
            let truth = (poses[0].point(corner) - point).cross(&axis).norm();
            assert!((radius - truth).abs() < 1e-9 * truth, "{radius} {truth}");
        }
        for (moved, pose) in moved.iter().zip(&poses) {
            assert!((moved.rotation - pose.rotation).norm() < 1e-9);
            assert!((moved.translation_mm - pose.translation_mm).norm() < 1e-9 * 330.0);
        }
        assert!(circles.radial_rms_mm < 1e-9 && circles.axial_rms_mm < 1e-9);
    }

    #[test]
    fn a_board_off_its_circle_is_brought_back() {
        let angles: Vec<f64> = (-8..=8).map(|k| 5.0 * f64::from(k)).collect();
        let (axis, _, poses) = stage(&angles);
        let mut disturbed = poses.clone();
        disturbed[8].translation_mm += axis * 0.1;
        let (circles, moved) = project_onto_circles(&disturbed, &corners()).unwrap();
        let gap = (moved[8].translation_mm - poses[8].translation_mm).norm();
        // One of 17 poses pulls the mean height along by a seventeenth, and the plane a little.
        assert!(gap < 0.1 / 17.0 * 2.0, "{gap}");
        assert!(circles.axial_rms_mm > 0.1 / 17f64.sqrt() * 0.9);
    }

    #[test]
    fn without_a_sweep_there_are_no_circles() {
        let (_, _, poses) = stage(&[0.0, 1.0, 2.0, 3.0]);
        assert!(project_onto_circles(&poses, &corners()).is_none());
        let (_, _, poses) = stage(&[-30.0, 0.0, 30.0]);
        assert!(project_onto_circles(&poses, &corners()).is_none());
    }
}
