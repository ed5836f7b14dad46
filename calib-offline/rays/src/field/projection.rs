//! Which pixel sees a point: the ray field inverted by Newton's method.

use super::{RayField, transport};
use crate::geometry::PixelPoint;
use nalgebra::{Vector2, Vector3};

/// Nodes along the sensor's longer side among which the start is picked.
const START_NODES: usize = 12;
const STEPS: usize = 30;
/// Longest step, as a share of the sensor's longer side.
const LONGEST_STEP_SHARE: f64 = 0.25;
/// A step shorter than this ends the search, px.
const SETTLED_PX: f64 = 1e-9;

impl RayField {
    /// The pixel whose ray passes through a point of the camera frame, mm; `None` if there is none
    /// on the sensor.
    ///
    /// Cost: a coarse search over the sensor (about 100 samples), then a few Newton steps.
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<PixelPoint> {
        let mut pixel = self.nearest_node(point_in_camera)?;
        let longest_px = LONGEST_STEP_SHARE * f64::from(self.sensor.width.max(self.sensor.height));
        for _ in 0..STEPS {
            let sample = self.sample(pixel);
            let local = transport::frame(&sample.s).tr_mul(point_in_camera);
            if !(local.z > 0.0) {
                return None;
            }
            let by_s = transport::local_point_derivative(&sample.s, &local);
            let mm_per_px = by_s.fixed_rows::<2>(0) * sample.ds - sample.dm;
            let mut step: Vector2<f64> = -(mm_per_px.try_inverse()? * (local.xy() - sample.m_mm));
            if !step.norm().is_finite() {
                return None;
            }
            if step.norm() > longest_px {
                step *= longest_px / step.norm();
            }
            pixel = PixelPoint::new(pixel.u + step.x, pixel.v + step.y);
            if step.norm() < SETTLED_PX {
                break;
            }
        }
        self.sensor.contains(pixel).then_some(pixel)
    }

    /// The node of a coarse lattice whose ray passes nearest by angle.
    fn nearest_node(&self, point_in_camera: &Vector3<f64>) -> Option<PixelPoint> {
        let (width, height) = (f64::from(self.sensor.width), f64::from(self.sensor.height));
        let spacing_px = width.max(height) / START_NODES as f64;
        let (nu, nv) = ((width / spacing_px).ceil(), (height / spacing_px).ceil());
        (0..(nu * nv) as usize)
            .map(|k| {
                let (i, j) = ((k % nu as usize) as f64, (k / nu as usize) as f64);
                PixelPoint::new((i + 0.5) * width / nu - 0.5, (j + 0.5) * height / nv - 0.5)
            })
            .map(|pixel| {
                let ray = self.ray(pixel);
                let seen = point_in_camera - ray.origin_mm;
                (seen.angle(&ray.direction), pixel)
            })
            .filter(|(angle, _)| angle.is_finite())
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, pixel)| pixel)
    }
}

#[cfg(test)]
mod tests {
    use crate::field::{BaseLens, Projection, RayField, SmoothMap};
    use crate::geometry::{PixelPoint, SensorSize};
    use nalgebra::{Vector2, Vector3};

    #[test]
    fn a_point_on_a_ray_is_seen_by_its_pixel() {
        for (projection, focal_px) in [
            (Projection::Perspective, 700.0),
            (Projection::Equidistant, 230.0),
        ] {
            let base = BaseLens::ideal(projection, focal_px);
            let mut field = RayField::ideal(SensorSize::new(640, 480), base, 3);
            field.direction.polynomial.coefficients[7] = Vector2::new(5e-3, -2e-3);
            let mut offset = SmoothMap::zero(1);
            offset.polynomial.coefficients[1] = Vector2::new(2.0, 0.5);
            field.offset = Some(offset);
            for (u, v) in [(0.0, 0.0), (320.0, 240.0), (600.3, 17.9), (639.0, 479.0)] {
                let ray = field.ray(PixelPoint::new(u, v));
                let point = ray.origin_mm + ray.direction.normalize() * 300.0;
                let pixel = field.project(&point).unwrap();
                assert!(
                    (pixel.u - u).hypot(pixel.v - v) < 1e-7,
                    "{projection:?} {u} {v}"
                );
            }
            assert!(field.project(&Vector3::new(0.0, 0.0, -100.0)).is_none());
        }
    }
}
