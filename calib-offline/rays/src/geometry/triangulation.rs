//! Where rays meet: the host's f64 oracle for the device's f32 triangulation.

use super::Ray;
use nalgebra::{Matrix3, Vector3};

/// Two rays closer to parallel than this sine have no usable intersection: at 0.05 px noise and
/// 1400 px focal length the depth would be uncertain by a third.
pub const MIN_PARALLAX_SIN: f64 = 2e-4;

/// A triangulated point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangulation {
    /// In the frame of the rays, mm.
    pub point_mm: Vector3<f64>,
    /// Two rays: the length of their common perpendicular, mm. More rays: twice the RMS distance
    /// of the point from them, which is the same thing for two.
    pub gap_mm: f64,
}

/// Why rays have no usable intersection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TriangulateError {
    /// Fewer than two rays.
    #[error("a point needs at least two rays, there {}", if *.have == 1 { "is 1" } else { "are none" })]
    TooFewRays {
        /// How many there were.
        have: usize,
    },
    /// The rays are parallel to within [`MIN_PARALLAX_SIN`].
    #[error("the rays are parallel")]
    Parallel,
    /// The point lies behind a camera.
    #[error("the rays meet behind a camera")]
    Behind,
}

/// Midpoint of the common perpendicular of two rays (paper Eqs. 33-35 in closed form).
///
/// # Errors
/// [`TriangulateError::Parallel`], [`TriangulateError::Behind`].
pub fn triangulate_pair(a: &Ray, b: &Ray) -> Result<Triangulation, TriangulateError> {
    let (d1, d2) = (a.direction, b.direction);
    let w = b.origin_mm - a.origin_mm;
    let normal = d1.cross(&d2);
    let normal_squared = normal.norm_squared();
    let lengths_squared = d1.norm_squared() * d2.norm_squared();
    // Written so that NaN counts as parallel.
    if !(normal_squared > MIN_PARALLAX_SIN * MIN_PARALLAX_SIN * lengths_squared) {
        return Err(TriangulateError::Parallel);
    }
    let lambda1 = w.cross(&d2).dot(&normal) / normal_squared;
    let lambda2 = w.cross(&d1).dot(&normal) / normal_squared;
    if !(lambda1 > 0.0 && lambda2 > 0.0) {
        return Err(TriangulateError::Behind);
    }
    let p1 = a.origin_mm + d1 * lambda1;
    let p2 = b.origin_mm + d2 * lambda2;
    Ok(Triangulation {
        point_mm: (p1 + p2) / 2.0,
        gap_mm: (p2 - p1).norm(),
    })
}

/// How the midpoint of two rays moves with a shift of either ray (mm per mm).
///
/// With the common normal `n` and the in-plane normals `e_k = n x d_k`, shifting ray 1 by `eta`
/// moves the midpoint by `n (n.eta) / 2 + d_2 (e_1.eta) / (d_2.e_1)`, and likewise for ray 2:
/// half of the shift out of the rays' plane, and along the other ray within it.
///
/// `None` for parallel rays.
pub fn midpoint_by_shifts(a: &Ray, b: &Ray) -> Option<(Matrix3<f64>, Matrix3<f64>)> {
    let (d1, d2) = (a.direction.normalize(), b.direction.normalize());
    let normal = d1.cross(&d2);
    if !(normal.norm() > MIN_PARALLAX_SIN) {
        return None;
    }
    let n = normal.normalize();
    let by_shift = |own: &Vector3<f64>, other: &Vector3<f64>| {
        let e = n.cross(own);
        n * n.transpose() / 2.0 + other * e.transpose() / other.dot(&e)
    };
    Some((by_shift(&d1, &d2), by_shift(&d2, &d1)))
}

/// The point with the least sum of squared distances from rays taken as whole lines, before or
/// behind their origins, mm; `None` if all are parallel or there are none.
pub fn nearest_point(rays: &[Ray]) -> Option<Vector3<f64>> {
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for ray in rays {
        let d = ray.direction.normalize();
        let projector = Matrix3::identity() - d * d.transpose();
        normal += projector;
        right += projector * ray.origin_mm;
    }
    normal.try_inverse().map(|inverse| inverse * right)
}

/// The point nearest to any number of rays in the least-squares sense.
///
/// Two rays give exactly [`triangulate_pair`]'s point up to round-off.
///
/// # Errors
/// [`TriangulateError::TooFewRays`], [`TriangulateError::Parallel`] if all rays are parallel,
/// [`TriangulateError::Behind`] if the point lies behind any camera.
pub fn triangulate_rays(rays: &[Ray]) -> Result<Triangulation, TriangulateError> {
    if let [a, b] = rays {
        return triangulate_pair(a, b);
    }
    if rays.len() < 2 {
        return Err(TriangulateError::TooFewRays { have: rays.len() });
    }
    let widest = rays
        .iter()
        .enumerate()
        .flat_map(|(i, a)| rays[i + 1..].iter().map(move |b| (a, b)))
        .map(|(a, b)| {
            a.direction.cross(&b.direction).norm_squared()
                / (a.direction.norm_squared() * b.direction.norm_squared())
        })
        .fold(0.0, f64::max);
    if !(widest > MIN_PARALLAX_SIN * MIN_PARALLAX_SIN) {
        return Err(TriangulateError::Parallel);
    }
    let point_mm = nearest_point(rays).ok_or(TriangulateError::Parallel)?;
    let mut distance_squared = 0.0;
    for ray in rays {
        if !((point_mm - ray.origin_mm).dot(&ray.direction) > 0.0) {
            return Err(TriangulateError::Behind);
        }
        distance_squared += ray.distance_mm(&point_mm).powi(2);
    }
    Ok(Triangulation {
        point_mm,
        gap_mm: 2.0 * (distance_squared / rays.len() as f64).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray {
            origin_mm: origin.into(),
            direction: direction.into(),
        }
    }

    #[test]
    fn skew_lines_meet_midway_between_them() {
        // Along x at z = 0 and along y at z = 2: nearest at (1, 0, 0) and (1, 0, 2).
        let a = ray([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        let b = ray([1.0, -1.0, 2.0], [0.0, 3.0, 0.0]);
        let result = triangulate_pair(&a, &b).unwrap();
        assert!((result.point_mm - Vector3::new(1.0, 0.0, 1.0)).norm() < 1e-15);
        assert!((result.gap_mm - 2.0).abs() < 1e-15);
    }

    #[test]
    fn midpoint_moves_as_shifts_of_its_rays_say() {
        let target = Vector3::new(10.0, -20.0, 300.0);
        let rays = [[0.0, 0.0, 0.0], [100.0, 15.0, 7.0]].map(|o| {
            let origin_mm = Vector3::from(o);
            Ray {
                origin_mm,
                direction: target - origin_mm,
            }
        });
        let middle = triangulate_pair(&rays[0], &rays[1]).unwrap().point_mm;
        let (by_a, by_b) = midpoint_by_shifts(&rays[0], &rays[1]).unwrap();
        for (shifted, by) in [(0, by_a), (1, by_b)] {
            for axis in 0..3 {
                let mut shift = Vector3::zeros();
                shift[axis] = 1e-3;
                let mut moved = rays;
                moved[shifted].origin_mm += shift;
                let change = triangulate_pair(&moved[0], &moved[1]).unwrap().point_mm - middle;
                assert!((by * shift - change).norm() < 1e-10);
            }
        }
    }

    #[test]
    fn three_rays_through_one_point_meet_there() {
        let target = Vector3::new(10.0, -20.0, 300.0);
        let rays: Vec<Ray> = [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 80.0, 5.0]]
            .iter()
            .map(|o| {
                let origin_mm = Vector3::from(*o);
                Ray {
                    origin_mm,
                    direction: target - origin_mm,
                }
            })
            .collect();
        let result = triangulate_rays(&rays).unwrap();
        assert!((result.point_mm - target).norm() < 1e-10);
        assert!(result.gap_mm < 1e-10);
    }

    #[test]
    fn parallel_and_behind_are_refused() {
        let a = ray([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let parallel = ray([10.0, 0.0, 0.0], [0.0, 0.0, 2.0]);
        assert_eq!(
            triangulate_pair(&a, &parallel),
            Err(TriangulateError::Parallel)
        );
        let diverging = ray([10.0, 0.0, 0.0], [0.1, 0.0, 1.0]);
        assert_eq!(
            triangulate_pair(&a, &diverging),
            Err(TriangulateError::Behind)
        );
        assert_eq!(
            triangulate_rays(&[a, diverging, ray([0.0, 10.0, 0.0], [0.0, 0.1, 1.0])]),
            Err(TriangulateError::Behind)
        );
        assert_eq!(
            triangulate_rays(&[a]),
            Err(TriangulateError::TooFewRays { have: 1 })
        );
    }
}
