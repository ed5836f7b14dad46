//! The line through the control points of one pixel (paper Eqs. 15 and 16).

use calib_rays::geometry::Ray;
use nalgebra::{DMatrix, Vector3};

/// The line with the least sum of squared distances from points, mm, through their mean and along
/// the first left singular vector of their offsets from it; `None` for fewer than two points, or
/// points in one place. The direction points along +z.
pub fn fit_line(points_mm: &[Vector3<f64>]) -> Option<Ray> {
    if points_mm.len() < 2 {
        return None;
    }
    let origin_mm = points_mm.iter().sum::<Vector3<f64>>() / points_mm.len() as f64;
    let offsets = DMatrix::from_fn(3, points_mm.len(), |r, c| points_mm[c][r] - origin_mm[r]);
    let svd = offsets.svd(true, false);
    let largest = svd.singular_values.imax();
    let u = svd.u?;
    let direction = Vector3::new(u[(0, largest)], u[(1, largest)], u[(2, largest)]);
    (svd.singular_values[largest] > 0.0 && direction.iter().all(|x| x.is_finite())).then(|| Ray {
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
