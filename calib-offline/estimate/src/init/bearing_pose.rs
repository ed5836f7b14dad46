//! Where a target is, from the bearings of its corners: valid for any field of view. A printed face is flat
//! and lies at z = 0; points with known places may lie anywhere.

use super::solid_pose::solid_pose;
use calib_rays::geometry::{RigidTransform, Scatter, so3};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Corners closer to one line than this share of their extent do not place a board.
const MIN_FLATNESS: f64 = 1e-3;
/// Points that lie within this share of their extent of the plane z = 0 are a printed face, bent or not.
const FACE: f64 = 0.03;

/// Whether points lie on one line (or in one spot), so that they cannot place a target.
pub fn is_collinear(points: &[Vector3<f64>]) -> bool {
    if is_face(points) {
        return centroid_and_spread(points)
            .is_none_or(|(_, scale, spread)| spread <= MIN_FLATNESS * scale);
    }
    Scatter::of(points).is_line()
}

fn is_face(points: &[Vector3<f64>]) -> bool {
    let highest = points.iter().map(|p| p.z.abs()).fold(0.0, f64::max);
    centroid_and_spread(points).is_some_and(|(_, scale, _)| highest <= FACE * scale)
}

/// Centroid, RMS extent, and RMS extent across the best line through the points.
fn centroid_and_spread(points: &[Vector3<f64>]) -> Option<(Vector3<f64>, f64, f64)> {
    let n = points.len() as f64;
    let centroid = points.iter().sum::<Vector3<f64>>() / n;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let d = p - centroid;
        xx += d.x * d.x / n;
        xy += d.x * d.y / n;
        yy += d.y * d.y / n;
    }
    let mean = f64::midpoint(xx, yy);
    let half = ((xx - yy) / 2.0).hypot(xy);
    let scale = (xx + yy).sqrt();
    (scale > 0.0).then(|| (centroid, scale, (mean - half).max(0.0).sqrt()))
}

/// How a flat board appears to a camera: `H (X, Y, 1)^T` is along the bearing of the board's point
/// (X, Y), and points to it, not away from it. One common factor is open.
#[derive(Debug, Clone, Copy)]
pub struct BoardHomography {
    /// Of `((X, Y) - centroid) / scale` instead of (X, Y): so the equations are well conditioned.
    columns: Matrix3<f64>,
    centroid_in_board: Vector3<f64>,
    scale_mm: f64,
}

impl BoardHomography {
    /// Direct linear transform: `d x (H (X, Y, 1)^T) = 0` for each corner, d being its bearing of
    /// any length; the smallest eigenvector of the 9 x 9 normal matrix.
    ///
    /// `None` if the corners lie on a line.
    pub fn fit(bearings: &[Vector3<f64>], points_in_board: &[Vector3<f64>]) -> Option<Self> {
        let (centroid, scale, spread) = centroid_and_spread(points_in_board)?;
        if spread <= MIN_FLATNESS * scale {
            return None;
        }
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        for (bearing, point) in bearings.iter().zip(points_in_board) {
            let d = bearing.normalize();
            let p = (point - centroid) / scale;
            let x = Vector3::new(p.x, p.y, 1.0);
            // d x (H x): row i of [d] times H x, with H column by column in the unknown.
            let cross = so3::skew(&d);
            for row in 0..3 {
                let equation = SVector::<f64, 9>::from_fn(|k, _| cross[(row, k % 3)] * x[k / 3]);
                normal += equation * equation.transpose();
            }
        }
        let eigen = normal.symmetric_eigen();
        let smallest = eigen.eigenvalues.imin();
        let mut h = Matrix3::from_column_slice(eigen.eigenvectors.column(smallest).as_slice());
        let in_front: f64 = bearings
            .iter()
            .zip(points_in_board)
            .map(|(bearing, point)| {
                let p = (point - centroid) / scale;
                bearing.dot(&(h * Vector3::new(p.x, p.y, 1.0))).signum()
            })
            .sum();
        if in_front < 0.0 {
            h = -h;
        }
        Some(Self {
            columns: h,
            centroid_in_board: centroid,
            scale_mm: scale,
        })
    }

    /// The same with every bearing mapped by a matrix, as by a camera matrix or its inverse.
    pub fn then(&self, map: &Matrix3<f64>) -> Self {
        Self {
            columns: map * self.columns,
            ..*self
        }
    }

    /// H itself, for points (X, Y, 1) of the board in mm.
    pub fn matrix(&self) -> Matrix3<f64> {
        let centroid = &self.centroid_in_board;
        let (h1, h2) = (
            self.columns.column(0) / self.scale_mm,
            self.columns.column(1) / self.scale_mm,
        );
        let h3 = self.columns.column(2) - h1 * centroid.x - h2 * centroid.y;
        Matrix3::from_columns(&[h1, h2, h3])
    }

    /// `camera_from_board`: the nearest orthonormal pair to the first two columns, and the third by
    /// the mean of their lengths (METHOD (5), where the length is that of the first alone).
    ///
    /// `None` if the homography is degenerate.
    pub fn pose(&self) -> Option<RigidTransform> {
        let h = &self.columns;
        // Columns of H are r1, r2 (times scale) and t at the centroid, all by one factor.
        let length = f64::midpoint(h.column(0).norm(), h.column(1).norm());
        if !(length > 0.0) {
            return None;
        }
        let (h1, h2) = (h.column(0).into_owned(), h.column(1).into_owned());
        let rotation = so3::nearest_rotation(&Matrix3::from_columns(&[
            h1 / length,
            h2 / length,
            h1.cross(&h2) / (length * length),
        ]))?;
        let translation_of_centroid = h.column(2) * (self.scale_mm / length);
        Some(RigidTransform::new(
            rotation,
            translation_of_centroid - rotation * self.centroid_in_board,
        ))
    }
}

/// `camera_from_board` of a target and the RMS angle (rad) that its corners miss their
/// bearings by.
///
/// From the [`BoardHomography`] of the bearings, which need not be unit vectors, in the target's best plane, or
/// from all three coordinates where its points lie in none. `None` if the corners lie on a line or the system is
/// degenerate.
pub fn bearing_pose(
    bearings: &[Vector3<f64>],
    points_in_board: &[Vector3<f64>],
) -> Option<(RigidTransform, f64)> {
    if is_face(points_in_board) {
        let pose = BoardHomography::fit(bearings, points_in_board)?.pose()?;
        return with_rms_angle(pose, bearings, points_in_board);
    }
    let scatter = Scatter::of(points_in_board);
    let plane_from_target = scatter.plane_from_points();
    let in_plane: Vec<_> = points_in_board
        .iter()
        .map(|p| plane_from_target.point(p))
        .collect();
    let flat = || {
        let pose = BoardHomography::fit(bearings, &in_plane)?.pose()?;
        with_rms_angle(pose * plane_from_target, bearings, points_in_board)
    };
    let solid = || {
        let pose = solid_pose(bearings, &in_plane)?;
        with_rms_angle(pose * plane_from_target, bearings, points_in_board)
    };
    let found = [flat(), scatter.is_solid().then(solid).flatten()];
    let found = found.into_iter().flatten();
    found.min_by(|a, b| a.1.total_cmp(&b.1))
}

fn with_rms_angle(
    pose: RigidTransform,
    bearings: &[Vector3<f64>],
    points_in_board: &[Vector3<f64>],
) -> Option<(RigidTransform, f64)> {
    let squared: f64 = bearings
        .iter()
        .zip(points_in_board)
        .map(|(bearing, point)| {
            let seen = pose.point(point);
            seen.cross(bearing).norm().atan2(seen.dot(bearing)).powi(2)
        })
        .sum();
    let rms_rad = (squared / bearings.len() as f64).sqrt();
    rms_rad.is_finite().then_some((pose, rms_rad))
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::board::BoardSpec;

    fn corners() -> Vec<Vector3<f64>> {
        let board = BoardSpec::chessboard(7, 9, 12.0);
        (0..63)
            .map(|k| board.corner_in_board(k / 9, k % 9))
            .collect()
    }

    #[test]
    fn exact_bearings_give_the_pose_even_beyond_ninety_degrees() {
        let points = corners();
        for (phi, t) in [
            ([0.3, -0.4, 0.1], [-30.0, -20.0, 400.0]),
            ([-0.2, 0.9, 2.0], [40.0, 10.0, 250.0]),
            // Partly behind the camera's plane: a fisheye's view.
            ([0.1, 1.4, 0.0], [90.0, -20.0, 30.0]),
        ] {
            let truth = RigidTransform::new(so3::exp(&phi.into()), t.into());
            let bearings: Vec<_> = points.iter().map(|p| truth.point(p) * 0.01).collect();
            let (pose, rms_rad) = bearing_pose(&bearings, &points).unwrap();
            assert!((pose.translation_mm - truth.translation_mm).norm() < 1e-6);
            assert!((pose.rotation - truth.rotation).norm() < 1e-9);
            assert!(rms_rad < 1e-9);
        }
    }

    #[test]
    fn corners_on_a_line_place_no_board() {
        let points: Vec<_> = (0..9)
            .map(|k| Vector3::new(f64::from(k), 2.0, 0.0))
            .collect();
        let bearings: Vec<_> = points
            .iter()
            .map(|p| p + Vector3::new(0.0, 0.0, 50.0))
            .collect();
        assert!(bearing_pose(&bearings, &points).is_none());
        assert!(is_collinear(&points));
        assert!(!is_collinear(&corners()));
    }
}
