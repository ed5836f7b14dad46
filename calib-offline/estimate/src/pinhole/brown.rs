//! The pinhole camera with Brown-Conrady distortion, in `OpenCV`'s order and convention.

use calib_rays::geometry::{PixelPoint, Ray, SensorSize};
use nalgebra::{Matrix2, Matrix2x3, SMatrix, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Numbers of a camera: focal lengths, principal point, distortion.
pub const INTRINSICS: usize = 9;

/// Newton steps to undistort; from a lens's own pixel some six are enough.
const STEPS: usize = 60;
/// A misfit below this is round-off, in focal lengths (1e-12 is 1e-9 px).
const ROUND_OFF: f64 = 1e-12;

/// A pinhole with radial and tangential distortion.
///
/// With `x = X/Z`, `y = Y/Z`, `r^2 = x^2 + y^2`, `g = 1 + k1 r^2 + k2 r^4 + k3 r^6`:
///
/// ```text
/// u = cx + fx (g x + 2 p1 x y + p2 (r^2 + 2 x^2))
/// v = cy + fy (g y + p1 (r^2 + 2 y^2) + 2 p2 x y)
/// ```
///
/// Frame: origin at the center of projection, z along the axis, x right, y down; mm. The center of
/// the top-left pixel is (0, 0), in `OpenCV` as here.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BrownCamera {
    /// The sensor.
    pub sensor: SensorSize,
    /// `[fx, fy]`, px.
    pub focal_px: [f64; 2],
    /// Principal point `[cx, cy]`, px.
    pub center_px: [f64; 2],
    /// `[k1, k2, p1, p2, k3]`, without unit.
    pub distortion: [f64; 5],
}

/// Where a point is seen, and how that changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// The pixel.
    pub pixel: PixelPoint,
    /// By the point in the camera frame, px/mm.
    pub by_point: Matrix2x3<f64>,
    /// By `fx, fy, cx, cy, k1, k2, p1, p2, k3`.
    pub by_intrinsics: SMatrix<f64, 2, INTRINSICS>,
}

impl BrownCamera {
    /// A camera without distortion.
    pub fn ideal(sensor: SensorSize, focal_px: [f64; 2], center: PixelPoint) -> Self {
        Self {
            sensor,
            focal_px,
            center_px: [center.u, center.v],
            distortion: [0.0; 5],
        }
    }

    /// The pixel that sees a point of the camera frame (mm), on the sensor or beyond its edge.
    ///
    /// `None` behind the camera and beyond the angle at which the distortion folds back: there the
    /// formula gives pixels that see something else.
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<PixelPoint> {
        let ideal = ideal(point_in_camera)?;
        let (distorted, slope) = self.distort(&ideal);
        self.is_before_fold(&ideal, &slope)
            .then(|| self.pixel(&distorted))
    }

    /// [`Self::project`] beyond the fold as well: an adjustment has to find its way back from there.
    pub fn unfolded(&self, point_in_camera: &Vector3<f64>) -> Option<PixelPoint> {
        let ideal = ideal(point_in_camera)?;
        Some(self.pixel(&self.distort(&ideal).0))
    }

    /// [`Self::unfolded`] with derivatives.
    /// `None` behind the camera.
    pub fn linearize(&self, point_in_camera: &Vector3<f64>) -> Option<Projection> {
        let ideal = ideal(point_in_camera)?;
        let (distorted, slope) = self.distort(&ideal);
        let [fx, fy] = self.focal_px;
        let (x, y) = (ideal.x, ideal.y);
        let z = point_in_camera.z;
        let by_ideal = Matrix2::from_diagonal(&Vector2::new(fx, fy)) * slope;
        let ideal_by_point = Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / z;
        let r2 = x * x + y * y;
        let (r4, r6) = (r2 * r2, r2 * r2 * r2);
        #[rustfmt::skip]
        let by_intrinsics = SMatrix::<f64, 2, INTRINSICS>::from_row_slice(&[
            distorted.x, 0.0, 1.0, 0.0,
            fx * x * r2, fx * x * r4, fx * 2.0 * x * y, fx * (r2 + 2.0 * x * x), fx * x * r6,
            0.0, distorted.y, 0.0, 1.0,
            fy * y * r2, fy * y * r4, fy * (r2 + 2.0 * y * y), fy * 2.0 * x * y, fy * y * r6,
        ]);
        Some(Projection {
            pixel: self.pixel(&distorted),
            by_point: by_ideal * ideal_by_point,
            by_intrinsics,
        })
    }

    /// The ray of a pixel, from the center of projection; its direction has z = 1.
    ///
    /// Undistorted by Newton's method to round-off. `None` where no ray on this side of the fold
    /// has that pixel.
    pub fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let target = Vector2::new(
            (pixel.u - self.center_px[0]) / self.focal_px[0],
            (pixel.v - self.center_px[1]) / self.focal_px[1],
        );
        let scale = 1.0 + target.norm();
        let mut ideal = target;
        let mut last_step = f64::INFINITY;
        for _ in 0..STEPS {
            let (distorted, slope) = self.distort(&ideal);
            let step = slope.try_inverse()? * (target - distorted);
            // Written so that NaN is refused.
            if !(step.norm() < f64::MAX) {
                return None;
            }
            ideal += step;
            // Steps shrink quadratically until round-off stops them.
            let is_settled = step.norm() <= ROUND_OFF * scale && step.norm() >= last_step / 2.0;
            if is_settled || step.norm() == 0.0 {
                break;
            }
            last_step = step.norm();
        }
        let (distorted, slope) = self.distort(&ideal);
        let is_found = (distorted - target).norm() <= ROUND_OFF * scale;
        (is_found && self.is_before_fold(&ideal, &slope)).then(|| Ray {
            origin_mm: Vector3::zeros(),
            direction: Vector3::new(ideal.x, ideal.y, 1.0),
        })
    }

    /// The numbers in the order of [`Projection::by_intrinsics`].
    pub fn intrinsics(&self) -> [f64; INTRINSICS] {
        let ([fx, fy], [cx, cy]) = (self.focal_px, self.center_px);
        let [k1, k2, p1, p2, k3] = self.distortion;
        [fx, fy, cx, cy, k1, k2, p1, p2, k3]
    }

    /// The same camera with other numbers.
    pub fn with_intrinsics(&self, values: [f64; INTRINSICS]) -> Self {
        let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = values;
        Self {
            sensor: self.sensor,
            focal_px: [fx, fy],
            center_px: [cx, cy],
            distortion: [k1, k2, p1, p2, k3],
        }
    }

    fn pixel(&self, distorted: &Vector2<f64>) -> PixelPoint {
        PixelPoint::new(
            self.center_px[0] + self.focal_px[0] * distorted.x,
            self.center_px[1] + self.focal_px[1] * distorted.y,
        )
    }

    /// Distorted image plane coordinates (focal lengths) and their derivative by the ideal ones.
    fn distort(&self, ideal: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let (x, y) = (ideal.x, ideal.y);
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let gain = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        // By r^2.
        let gain_slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
        let distorted = Vector2::new(
            gain * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            gain * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let mixed = 2.0 * (gain_slope * x * y + p1 * x + p2 * y);
        let slope = Matrix2::new(
            gain + 2.0 * gain_slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            gain + 2.0 * gain_slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
        );
        (distorted, slope)
    }

    /// Whether the mapping keeps its sense from the axis out to here: the radial part by its slope
    /// `1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3` in `s = r^2`, all of it by the determinant here.
    fn is_before_fold(&self, ideal: &Vector2<f64>, slope: &Matrix2<f64>) -> bool {
        let [k1, k2, _, _, k3] = self.distortion;
        let (a, b, c) = (3.0 * k1, 5.0 * k2, 7.0 * k3);
        let end = ideal.norm_squared();
        let at = |s: f64| 1.0 + s * (a + s * (b + s * c));
        // The least value lies at an end or where a + 2 b s + 3 c s^2 = 0; the roots are written so
        // that c = 0 needs no case of its own.
        let root = (b * b - 3.0 * a * c).max(0.0).sqrt();
        let q = -(b + root.copysign(b));
        let is_rising = [end, q / (3.0 * c), a / q]
            .into_iter()
            .filter(|s| (0.0..=end).contains(s))
            .all(|s| at(s) > 0.0);
        is_rising && slope.determinant() > 0.0
    }
}

/// `(X/Z, Y/Z)`; `None` behind the camera.
fn ideal(point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
    let z = point_in_camera.z;
    (z > 0.0).then(|| point_in_camera.xy() / z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: BrownCamera = BrownCamera {
        sensor: SensorSize::new(1280, 1024),
        focal_px: [1200.0, 1190.0],
        center_px: [651.0, 498.0],
        distortion: [-0.28, 0.12, 6e-4, -4e-4, -0.03],
    };

    #[test]
    fn projection_by_hand() {
        let camera = BrownCamera {
            distortion: [0.5, 0.0, 0.01, 0.02, 0.0],
            ..CAMERA
        };
        // x = 0.3, y = 0.4, r^2 = 0.25, g = 1.125;
        // 1.125 * 0.3 + 0.01 * 2 * 0.12 + 0.02 * (0.25 + 0.18) = 0.3485,
        // 1.125 * 0.4 + 0.01 * (0.25 + 0.32) + 0.02 * 2 * 0.12 = 0.4605.
        let pixel = camera.project(&Vector3::new(30.0, 40.0, 100.0)).unwrap();
        assert!((pixel.u - (651.0 + 1200.0 * 0.3485)).abs() < 1e-10);
        assert!((pixel.v - (498.0 + 1190.0 * 0.4605)).abs() < 1e-10);
    }

    #[test]
    fn derivatives_match_differences() {
        let point = Vector3::new(60.0, -45.0, 130.0);
        let exact = CAMERA.linearize(&point).unwrap();
        let change = |a: PixelPoint, b: PixelPoint, step: f64| {
            Vector2::new(a.u - b.u, a.v - b.v) / (2.0 * step)
        };
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = 1e-3;
            let [more, less] = [point + step, point - step].map(|p| CAMERA.project(&p).unwrap());
            let difference = change(more, less, 1e-3);
            assert!((difference - exact.by_point.column(axis)).norm() < 1e-7);
        }
        for k in 0..INTRINSICS {
            let at = |sign: f64| {
                let mut values = CAMERA.intrinsics();
                values[k] += sign * 1e-4;
                CAMERA.with_intrinsics(values).project(&point).unwrap()
            };
            // Linear in each of them: only round-off of 1000 px over the step remains.
            let difference = change(at(1.0), at(-1.0), 1e-4);
            assert!(
                (difference - exact.by_intrinsics.column(k)).norm() < 1e-7,
                "{k}"
            );
        }
    }

    #[test]
    fn a_ray_is_seen_at_its_pixel() {
        let strong = BrownCamera {
            focal_px: [520.0, 521.0],
            distortion: [0.4, 0.3, 2e-3, -3e-3, 0.1],
            ..CAMERA
        };
        for camera in [CAMERA, strong] {
            for (u, v) in [(0.0, 0.0), (651.0, 498.0), (1279.0, 3.5), (700.0, 1023.0)] {
                let ray = camera.ray(PixelPoint::new(u, v)).unwrap();
                let seen = camera.project(&(ray.direction * 250.0)).unwrap();
                assert!((seen.u - u).hypot(seen.v - v) < 1e-9, "{u} {v}");
            }
        }
    }

    #[test]
    fn beyond_the_fold_there_is_neither_pixel_nor_ray() {
        // r (1 - r^2 / 3) rises up to r = 1, where it is 2/3.
        let camera = BrownCamera {
            distortion: [-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0],
            center_px: [0.0, 0.0],
            ..CAMERA
        };
        let at = |r: f64| camera.project(&Vector3::new(r, 0.0, 1.0));
        assert!(at(0.999).is_some());
        assert!(at(1.001).is_none());
        // Here the formula is past its second zero and rises no more; a pixel it gives is another's.
        assert!(at(1.9).is_none());
        let ray = |share: f64| camera.ray(PixelPoint::new(1200.0 * share, 0.0));
        assert!(ray(0.666).is_some());
        assert!(ray(0.667).is_none());
        assert!(ray(5.0).is_none());
        assert!(camera.ray(PixelPoint::new(f64::NAN, 0.0)).is_none());
        assert!(camera.project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
    }

    #[test]
    fn a_camera_survives_being_written() {
        let text = serde_json::to_string(&CAMERA).unwrap();
        assert_eq!(serde_json::from_str::<BrownCamera>(&text).unwrap(), CAMERA);
    }
}
