//! A direction from two numbers, and the two axes across it.
//!
//! The two numbers are the half-angle vector `s = 2 tan(theta/2) * (cos phi, sin phi)` of the
//! direction at angle `theta` from the camera's z axis and azimuth `phi`: the inverse stereographic
//! projection of the plane onto the sphere (METHOD 2.1). For narrow lenses it is
//! the normalized image coordinate to first order; 90 degrees off axis is `|s| = 2`; it is smooth
//! for every direction but straight backwards, so one code path serves narrow lenses and
//! fisheyes. The rotation that carries the z axis to the direction along the great circle is that
//! of the unnormalized quaternion `(2, -s2, s1, 0)`; everything here is rational in `s`, so a
//! device evaluates exactly the function that was fitted, without trigonometry or square root.

use nalgebra::{Matrix3, Matrix3x2, Vector2, Vector3};

/// Largest `|s|` a field may hold: 127 degrees off axis. Beyond it the chart stretches so much
/// that a field cannot be interpolated well.
pub const MAX_HALF_ANGLE_LENGTH: f64 = 4.0;

/// The unnormalized direction `(4 s1, 4 s2, 4 - s.s)`; its length is `4 + s.s`.
pub fn direction(s: &Vector2<f64>) -> Vector3<f64> {
    Vector3::new(4.0 * s.x, 4.0 * s.y, 4.0 - s.norm_squared())
}

/// The rotation that carries z to the direction: columns are the two axes across the ray and the
/// unit direction itself.
pub fn frame(s: &Vector2<f64>) -> Matrix3<f64> {
    let (s1, s2) = (s.x, s.y);
    let (a, b) = (s1 * s1, s2 * s2);
    Matrix3::new(
        4.0 + b - a,
        -2.0 * s1 * s2,
        4.0 * s1,
        -2.0 * s1 * s2,
        4.0 + a - b,
        4.0 * s2,
        -4.0 * s1,
        -4.0 * s2,
        4.0 - a - b,
    ) / (4.0 + a + b)
}

/// The two unit axes across the ray, camera frame: the first two columns of [`frame`].
pub fn across(s: &Vector2<f64>) -> Matrix3x2<f64> {
    frame(s).fixed_columns::<2>(0).into_owned()
}

/// The half-angle vector of a direction of any length.
///
/// `None` straight backwards, for a zero direction, and for one that is not finite.
pub fn half_angle(direction: &Vector3<f64>) -> Option<Vector2<f64>> {
    let denominator = direction.norm() + direction.z;
    let s = Vector2::new(direction.x, direction.y) * (2.0 / denominator);
    (denominator > 0.0 && s.iter().all(|x| x.is_finite())).then_some(s)
}

/// Derivative of `frame(s)^T P` by `s`: the columns are d/ds1 and d/ds2.
///
/// `local = frame(s)^T P`. Turning the frame by `ds` about its own axes changes the local
/// coordinates by `local x omega`, with the body rates of the quaternion `(2, -s2, s1, 0)`.
pub fn local_point_derivative(s: &Vector2<f64>, local: &Vector3<f64>) -> nalgebra::Matrix3x2<f64> {
    // Body angular velocity of q = (w, v), unnormalized: 2 (w dv - dw v - v x dv) / |q|^2, with
    // w = 2, v = (-s2, s1, 0), dw = 0.
    let scale = 2.0 / (4.0 + s.norm_squared());
    let v = Vector3::new(-s.y, s.x, 0.0);
    let rate = |dv: Vector3<f64>| (dv * 2.0 - v.cross(&dv)) * scale;
    let omega_1 = rate(Vector3::y());
    let omega_2 = rate(-Vector3::x());
    nalgebra::Matrix3x2::from_columns(&[local.cross(&omega_1), local.cross(&omega_2)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ninety_degrees_off_axis_has_length_two() {
        let d = direction(&Vector2::new(2.0, 0.0));
        assert_eq!(d, Vector3::new(8.0, 0.0, 0.0));
    }

    #[test]
    fn frame_is_a_rotation_whose_third_axis_is_the_direction() {
        for s in [[0.0, 0.0], [0.3, -0.2], [2.0, 1.0], [-3.0, 2.5]] {
            let s = Vector2::from(s);
            let r = frame(&s);
            assert!((r.transpose() * r - Matrix3::identity()).norm() < 1e-14);
            assert!((r.determinant() - 1.0).abs() < 1e-14);
            assert!((r.column(2) - direction(&s).normalize()).norm() < 1e-14);
            assert!((half_angle(&(direction(&s) * 0.3)).unwrap() - s).norm() < 1e-13);
        }
    }

    #[test]
    fn straight_backwards_has_no_half_angle() {
        assert_eq!(half_angle(&-Vector3::z()), None);
        assert_eq!(half_angle(&Vector3::zeros()), None);
    }

    #[test]
    fn derivative_of_local_coordinates_matches_differences() {
        let point = Vector3::new(30.0, -50.0, 400.0);
        for s in [[0.0, 0.0], [0.4, -0.7], [2.2, 0.1]] {
            let s = Vector2::from(s);
            let analytic = local_point_derivative(&s, &(frame(&s).transpose() * point));
            for k in 0..2 {
                let h = 1e-6;
                let mut step = Vector2::zeros();
                step[k] = h;
                let difference = (frame(&(s + step)).transpose() * point
                    - frame(&(s - step)).transpose() * point)
                    / (2.0 * h);
                assert!((difference - analytic.column(k)).norm() < 1e-6 * point.norm());
            }
        }
    }
}
