//! The line through the control points of one pixel (paper Eqs. 15 and 16).

use calib_rays::geometry::Ray;
use calib_rays::numerics::SingularValues;
use nalgebra::{MatrixXx3, Vector3};

/// The line with the least sum of squared distances from points, mm, through their mean and along
/// the first right singular vector of their offsets from it; `None` for fewer than two points, or
/// points in one place. The direction points along +z.
pub fn fit_line(points_mm: &[Vector3<f64>]) -> Option<Ray> {
    if points_mm.len() < 2 {
        return None;
    }
    let origin_mm = points_mm.iter().sum::<Vector3<f64>>() / points_mm.len() as f64;
    let offsets = MatrixXx3::from_fn(points_mm.len(), |r, c| points_mm[r][c] - origin_mm[c]);
    let svd = SingularValues::new(offsets)?;
    let direction: Vector3<f64> = svd.right.column(0).into_owned();
    (svd.values[0] > 0.0).then(|| Ray {
        origin_mm,
        direction: direction * 1f64.copysign(direction.z),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_line_give_it_back() {
        let (origin, direction) = (Vector3::new(3.0, -2.0, 50.0), Vector3::new(0.6, 0.0, -0.8));
        let points: Vec<_> = [-40.0, 3.0, 10.0, 77.0]
            .map(|along| origin + direction * along)
            .into();
        let line = fit_line(&points).unwrap();
        // Round-off at 100 mm.
        assert!((line.direction + direction).norm() < 1e-14);
        assert!(line.distance_mm(&origin) < 1e-13);
    }

    /// nalgebra 0.35's decomposition of the offsets, which are each other's opposite but for their
    /// last digits, had its first vector 0.51 and 0.44 rad off these lines.
    #[test]
    fn two_points_have_their_line() {
        for [a, b] in [
            [[39.6, -28.0, 261.4], [105.0, 28.5, 347.8]],
            [
                [-2.8, -87.7, 284.6],
                [51.150000000000006, -125.69999999999999, 344.95],
            ],
        ] {
            let (a, b) = (Vector3::from(a), Vector3::from(b));
            let line = fit_line(&[a, b]).unwrap();
            // Round-off of the mean, of some 300 mm, over the 90 mm between the points; doubled by
            // the decomposition's own.
            let off_rad = line.direction.cross(&(b - a).normalize()).norm();
            assert!(
                off_rad < 4.0 * f64::EPSILON * b.norm() / (b - a).norm(),
                "{off_rad}"
            );
        }
    }

    #[test]
    fn of_points_across_the_line_the_middle_counts() {
        let points = [
            Vector3::new(1.0, 0.0, 0.0),
            Vector3::new(-1.0, 0.0, 0.0),
            Vector3::new(1.0, 0.0, 100.0),
            Vector3::new(-1.0, 0.0, 100.0),
        ];
        let line = fit_line(&points).unwrap();
        assert!((line.direction - Vector3::z()).norm() < 1e-14);
        assert!((line.origin_mm - Vector3::new(0.0, 0.0, 50.0)).norm() < 1e-13);
    }

    #[test]
    fn one_place_has_no_line() {
        assert!(fit_line(&[Vector3::zeros()]).is_none());
        assert!(fit_line(&[Vector3::x(); 3]).is_none());
    }
}
