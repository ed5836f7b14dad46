//! Reprojection error of a corner without projecting it, and its derivatives.
//!
//! The corner's position P in the camera frame is seen in the axes of the ray that the field gives
//! to the observed pixel: `Y = R(s)^T P`, `e = Y_12 - m`, the offset of the corner from the ray in
//! mm. With `J = de/dx`, mm per px, the observed pixel minus the one that would have seen the
//! corner is `A e`, `A = J^-1`, to first order (METHOD 2.2).

use calib_rays::field::{FieldSample, transport};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

/// A residual with its derivatives; `A` counts as constant, its change is multiplied by the noise.
#[derive(Debug, Clone, Copy)]
pub struct Linearization {
    /// Observed minus predicted, px.
    pub residual_px: Vector2<f64>,
    /// By the half-angle vector s, px.
    pub by_s: Matrix2<f64>,
    /// By the offset m, px/mm.
    pub by_m: Matrix2<f64>,
    /// By the corner's position in the camera frame, px/mm.
    pub by_point: Matrix2x3<f64>,
}

/// The residual of a corner at `point_in_camera` (mm) on the ray of `sample`.
///
/// `None` if the corner lies behind the ray's origin plane or the field is singular there.
pub fn linearize(sample: &FieldSample, point_in_camera: &Vector3<f64>) -> Option<Linearization> {
    let frame = transport::frame(&sample.s);
    let local = frame.tr_mul(point_in_camera);
    if !(local.z > 0.0) {
        return None;
    }
    let by_s_mm = transport::local_point_derivative(&sample.s, &local)
        .fixed_rows::<2>(0)
        .into_owned();
    let error_mm = local.xy() - sample.m_mm;
    let px_from_mm = (by_s_mm * sample.ds - sample.dm).try_inverse()?;
    Some(Linearization {
        residual_px: px_from_mm * error_mm,
        by_s: px_from_mm * by_s_mm,
        by_m: -px_from_mm,
        by_point: px_from_mm * frame.fixed_columns::<2>(0).transpose(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::field::{BaseLens, Projection, RayField, SmoothMap};
    use calib_rays::geometry::{PixelPoint, SensorSize};

    fn field() -> RayField {
        let base = BaseLens::ideal(Projection::Perspective, 700.0);
        let mut field = RayField::ideal(SensorSize::new(640, 480), base, 3);
        field.direction.polynomial.coefficients[7] = Vector2::new(1e-3, -2e-3);
        let mut offset = SmoothMap::zero(1);
        offset.polynomial.coefficients[1] = Vector2::new(2.0, 0.5);
        field.offset = Some(offset);
        field
    }

    #[test]
    fn residual_is_the_pixel_difference_to_first_order() {
        let field = field();
        let (predicted, observed) = (PixelPoint::new(200.0, 310.0), PixelPoint::new(200.3, 309.8));
        let ray = field.ray(predicted);
        let corner = ray.origin_mm + ray.direction * 120.0;
        let residual = linearize(&field.sample(observed), &corner)
            .unwrap()
            .residual_px;
        // Second order in 0.4 px over a focal length of 700 px.
        assert!((residual - Vector2::new(0.3, -0.2)).norm() < 2e-3);
        let exact = linearize(&field.sample(predicted), &corner)
            .unwrap()
            .residual_px;
        assert!(exact.norm() < 1e-9);
    }

    #[test]
    fn derivatives_match_differences_at_zero_residual() {
        let field = field();
        let sample = field.sample(PixelPoint::new(500.0, 100.0));
        let ray = sample.ray();
        let corner = ray.origin_mm + ray.direction * 100.0;
        let at = |sample: &FieldSample, corner: &Vector3<f64>| {
            linearize(sample, corner).unwrap().residual_px
        };
        let analytic = linearize(&sample, &corner).unwrap();
        for k in 0..2 {
            let h = 1e-7;
            let moved = |sign: f64| {
                let mut moved = sample;
                moved.s[k] += sign * h;
                at(&moved, &corner)
            };
            let difference = (moved(1.0) - moved(-1.0)) / (2.0 * h);
            assert!((difference - analytic.by_s.column(k)).norm() < 1e-4 * analytic.by_s.norm());
            let moved = |sign: f64| {
                let mut moved = sample;
                moved.m_mm[k] += sign * h;
                at(&moved, &corner)
            };
            let difference = (moved(1.0) - moved(-1.0)) / (2.0 * h);
            assert!((difference - analytic.by_m.column(k)).norm() < 1e-4 * analytic.by_m.norm());
        }
        for k in 0..3 {
            let h = 1e-5;
            let mut step = Vector3::zeros();
            step[k] = h;
            let difference =
                (at(&sample, &(corner + step)) - at(&sample, &(corner - step))) / (2.0 * h);
            assert!(
                (difference - analytic.by_point.column(k)).norm() < 1e-4 * analytic.by_point.norm()
            );
        }
    }

    #[test]
    fn a_corner_behind_the_camera_has_no_residual() {
        let sample = field().sample(PixelPoint::new(320.0, 240.0));
        assert!(linearize(&sample, &Vector3::new(0.0, 0.0, -100.0)).is_none());
    }
}
