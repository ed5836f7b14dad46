//! Rotations: exponential, logarithm, the nearest rotation, and the geodesic median of several.

use crate::numerics::SingularValues;
use nalgebra::{Matrix3, Vector3};

/// The matrix `[a]` with `[a] b = a x b`.
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// Rotation by the angle `|phi|` (rad) about the axis `phi / |phi|`.
///
/// Rodrigues' formula; near zero the coefficients come from their Taylor series, so there is no
/// division by a vanishing angle.
pub fn exp(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle_squared = phi.norm_squared();
    let (a, b) = if angle_squared < 1e-8 {
        (1.0 - angle_squared / 6.0, 0.5 - angle_squared / 24.0)
    } else {
        let angle = angle_squared.sqrt();
        let half_sin = (angle / 2.0).sin();
        (
            angle.sin() / angle,
            2.0 * half_sin * half_sin / angle_squared,
        )
    };
    let k = skew(phi);
    Matrix3::identity() + k * a + k * k * b
}

/// The rotation vector (rad) of a rotation matrix, of length at most pi.
///
/// Goes through the quaternion with the largest component, so it keeps its digits near 0 and
/// near pi. At exactly pi the sign of the axis is arbitrary.
pub fn log(rotation: &Matrix3<f64>) -> Vector3<f64> {
    let r = rotation;
    // The four squared quaternion components, times four.
    let candidates = [
        1.0 + r[(0, 0)] + r[(1, 1)] + r[(2, 2)],
        1.0 + r[(0, 0)] - r[(1, 1)] - r[(2, 2)],
        1.0 - r[(0, 0)] + r[(1, 1)] - r[(2, 2)],
        1.0 - r[(0, 0)] - r[(1, 1)] + r[(2, 2)],
    ];
    let largest = (0..4).fold(0, |best, i| {
        if candidates[i] > candidates[best] {
            i
        } else {
            best
        }
    });
    let twice = candidates[largest].max(0.0).sqrt();
    let (wx, wy, wz) = (
        r[(2, 1)] - r[(1, 2)],
        r[(0, 2)] - r[(2, 0)],
        r[(1, 0)] - r[(0, 1)],
    );
    let (xy, xz, yz) = (
        r[(0, 1)] + r[(1, 0)],
        r[(0, 2)] + r[(2, 0)],
        r[(1, 2)] + r[(2, 1)],
    );
    // (w, x, y, z), all scaled by the same positive factor.
    let (w, v) = match largest {
        0 => (twice * twice, Vector3::new(wx, wy, wz)),
        1 => (wx, Vector3::new(twice * twice, xy, xz)),
        2 => (wy, Vector3::new(xy, twice * twice, yz)),
        _ => (wz, Vector3::new(xz, yz, twice * twice)),
    };
    let (w, v) = if w < 0.0 { (-w, -v) } else { (w, v) };
    let norm = v.norm();
    if norm == 0.0 {
        return Vector3::zeros();
    }
    v * (2.0 * norm.atan2(w) / norm)
}

/// Angle of a rotation, rad, in [0, pi].
pub fn angle_rad(rotation: &Matrix3<f64>) -> f64 {
    log(rotation).norm()
}

/// The rotation nearest to a matrix in the Frobenius norm (SVD; Kabsch's sign rule).
///
/// `None` if the matrix is not finite.
pub fn nearest_rotation(matrix: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let svd = SingularValues::new(*matrix)?;
    let (u, v_t) = (svd.left(), svd.right.transpose());
    let sign = (u * v_t).determinant().signum();
    Some(u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t)
}

/// Geodesic L1 mean (median) of rotations by Weiszfeld's iteration; robust against a minority of
/// wrong ones. `None` if there is none.
pub fn geodesic_median(rotations: &[Matrix3<f64>]) -> Option<Matrix3<f64>> {
    // Start at the member with the smallest sum of distances to the others: it cannot be one of a
    // wrong minority, and the iteration converges from there.
    let mut mean = *rotations.iter().min_by(|a, b| {
        let cost = |r: &Matrix3<f64>| -> f64 {
            rotations
                .iter()
                .map(|s| angle_rad(&(r.transpose() * s)))
                .sum()
        };
        cost(a).total_cmp(&cost(b))
    })?;
    for _ in 0..100 {
        let mut step = Vector3::zeros();
        let mut weight_sum = 0.0;
        for rotation in rotations {
            let delta = log(&(mean.transpose() * rotation));
            let weight = 1.0 / delta.norm().max(1e-12);
            step += delta * weight;
            weight_sum += weight;
        }
        step /= weight_sum;
        mean *= exp(&step);
        if step.norm() < 1e-13 {
            break;
        }
    }
    nearest_rotation(&mean)
}

/// Geodesic L2 mean (Karcher mean) of rotations: the one from which the logarithms to all sum to zero
/// (Hartley et al. 2013; paper Eqs. 31 and 32). Unique for rotations less than 90 degrees from it.
/// `None` if there is none.
pub fn karcher_mean(rotations: &[Matrix3<f64>]) -> Option<Matrix3<f64>> {
    let mut mean = *rotations.first()?;
    for _ in 0..100 {
        let step = rotations
            .iter()
            .map(|rotation| log(&mean.tr_mul(rotation)))
            .sum::<Vector3<f64>>()
            / rotations.len() as f64;
        mean *= exp(&step);
        if step.norm() < 1e-14 {
            break;
        }
    }
    nearest_rotation(&mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_about_z_takes_x_to_y() {
        let turned = exp(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2)) * Vector3::x();
        assert!((turned - Vector3::y()).norm() < 1e-15);
    }

    #[test]
    fn logarithm_undoes_exponential_from_zero_to_pi() {
        let axis = Vector3::new(0.3, -0.8, 0.52).normalize();
        for angle in [
            0.0,
            1e-12,
            1e-8,
            1e-4,
            0.1,
            1.0,
            3.0,
            std::f64::consts::PI - 1e-6,
        ] {
            let phi = axis * angle;
            let error = (log(&exp(&phi)) - phi).norm();
            assert!(error < 1e-12, "angle {angle}: error {error}");
        }
    }

    #[test]
    fn nearest_rotation_is_proper_even_for_a_reflection() {
        let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
        let nearest = nearest_rotation(&mirror).unwrap();
        assert!((nearest.determinant() - 1.0).abs() < 1e-12);
    }

    /// The covariance of points within 1e-5 of a line, in a plane. nalgebra 0.35 takes a 3 x 3 matrix's
    /// decomposition from the eigenvectors of its square, which left the turn about the line open to
    /// 3.6e-7 rad here, and to 3e-6 in others.
    #[test]
    fn nearest_rotation_of_nearly_one_line_keeps_the_turn_about_it() {
        let (left, right) = (
            exp(&Vector3::new(0.4, -0.9, 0.2)),
            exp(&Vector3::new(-0.3, 0.5, 1.1)),
        );
        let narrow = Matrix3::from_diagonal(&Vector3::new(1.0, 1e-5, 0.0));
        let nearest = nearest_rotation(&(left * narrow * right.transpose())).unwrap();
        // Round-off of nine products, over the second value.
        let off = (nearest - left * right.transpose()).norm();
        assert!(off < 9.0 * f64::EPSILON / 1e-5, "{off}");
    }

    #[test]
    fn median_ignores_one_wrong_rotation_in_five() {
        let truth = exp(&Vector3::new(0.2, -0.1, 0.4));
        let mut rotations = vec![truth; 4];
        rotations.push(exp(&Vector3::new(0.0, 0.0, 3.0)));
        let median = geodesic_median(&rotations).unwrap();
        assert!(angle_rad(&(median.transpose() * truth)) < 1e-9);
    }

    #[test]
    fn mean_about_one_axis_is_that_of_the_angles() {
        let axis = Vector3::new(0.3, -0.8, 0.52).normalize();
        let about = |angle: f64| exp(&(axis * angle));
        let mean = karcher_mean(&[about(0.1), about(-0.4), about(0.9)]).unwrap();
        assert!((log(&mean) - axis * 0.2).norm() < 1e-14);
        let half = karcher_mean(&[about(0.1), about(0.7)]).unwrap();
        assert!((log(&half) - axis * 0.4).norm() < 1e-14);
        assert_eq!(karcher_mean(&[]), None);
    }

    #[test]
    fn mean_of_rotations_about_all_axes_is_the_one_they_surround() {
        let middle = exp(&Vector3::new(0.4, 0.2, -0.7));
        let around: Vec<Matrix3<f64>> = (0..3)
            .flat_map(|k| [0.5, -0.5].map(|a| middle * exp(&(Vector3::ith(k, 1.0) * a))))
            .collect();
        let mean = karcher_mean(&around).unwrap();
        assert!((mean - middle).norm() < 1e-14);
    }
}
