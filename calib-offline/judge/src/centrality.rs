//! How far a camera is from having one center of projection, in millimeters.

use calib_rays::field::{CalibratedCamera, RayField};
use calib_rays::geometry::{PixelPoint, Ray, nearest_point};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Distances of a camera's rays from the point that is nearest to all of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Centrality {
    /// Whether the model is central: then the distances are 0 by choice and not by measurement.
    pub central: bool,
    /// The point with the least sum of squared distances from the rays of the calibrated area,
    /// camera frame, mm. (0, 0, 0) of a central camera.
    #[schemars(with = "[f64; 3]")]
    pub point_in_camera_mm: Vector3<f64>,
    /// RMS distance of those rays from it, mm.
    pub rms_mm: f64,
    /// The largest distance, mm.
    pub max_mm: f64,
    /// RMS distance of the same rays in each of two estimates from half of the poses: how far
    /// they lie apart says how well `rms_mm` is known. `None` for a central
    /// camera and without a half-data check.
    pub halves_rms_mm: Option<[f64; 2]>,
}

/// Centrality of a camera over its calibrated area: the middles of the mask's cells.
pub fn centrality(camera: &CalibratedCamera) -> Centrality {
    over(&camera.field, &camera.coverage.covered_middles())
}

impl Centrality {
    /// Adds what two other estimates say of the same pixels.
    pub fn with_halves(self, camera: &CalibratedCamera, halves: [&RayField; 2]) -> Self {
        if self.central {
            return self;
        }
        let pixels = camera.coverage.covered_middles();
        Self {
            halves_rms_mm: Some(halves.map(|field| over(field, &pixels).rms_mm)),
            ..self
        }
    }
}

fn over(field: &RayField, pixels: &[PixelPoint]) -> Centrality {
    let rays: Vec<Ray> = if field.is_central() {
        Vec::new()
    } else {
        pixels.iter().map(|pixel| field.ray(*pixel)).collect()
    };
    let point_in_camera_mm = nearest_point(&rays).unwrap_or_else(Vector3::zeros);
    let distances = rays.iter().map(|ray| ray.distance_mm(&point_in_camera_mm));
    let (squared, max_mm) = distances.fold((0.0, 0.0_f64), |(sum, most), distance| {
        (sum + distance * distance, most.max(distance))
    });
    Centrality {
        central: field.is_central(),
        point_in_camera_mm,
        rms_mm: (squared / rays.len().max(1) as f64).sqrt(),
        max_mm,
        halves_rms_mm: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::field::{BaseLens, Projection, SmoothMap};
    use calib_rays::geometry::SensorSize;
    use nalgebra::Vector2;

    fn narrow_lens(offset: impl Fn(usize) -> Vector2<f64>) -> Centrality {
        let base = BaseLens::ideal(Projection::Perspective, 50_000.0);
        let sensor = SensorSize::new(800, 800);
        let mut field = RayField::ideal(sensor, base, 3);
        let mut map = SmoothMap::zero(2);
        for (k, coefficient) in map.polynomial.coefficients.iter_mut().enumerate() {
            *coefficient = offset(k);
        }
        field.offset = Some(map);
        let pixels: Vec<_> = (0..400)
            .map(|k| {
                let place = |k: i32| f64::from(k) * 40.0 + 19.5;
                PixelPoint::new(place(k % 20), place(k / 20))
            })
            .collect();
        over(&field, &pixels)
    }

    #[test]
    fn a_constant_offset_is_a_center_elsewhere() {
        let found = narrow_lens(|k| match k {
            0 => Vector2::new(3.0, -4.0),
            _ => Vector2::zeros(),
        });
        // Across a beam of +-0.5 degrees a shift of the point is an offset up to the angle squared.
        assert!((found.point_in_camera_mm.norm() - 5.0).abs() < 1e-3);
        assert!(found.rms_mm < 5.0 * 0.01 * 0.01, "{found:?}");
        assert!(!found.central);
    }

    #[test]
    fn an_offset_that_no_point_explains_stays() {
        // u and v from -1 to 1: the curl (-v, u) has an RMS of sqrt(2/3) and turns about the axis,
        // where a point on the axis is nearest.
        let found = narrow_lens(|k| match k {
            1 => Vector2::new(0.0, 0.6),
            2 => Vector2::new(-0.6, 0.0),
            _ => Vector2::zeros(),
        });
        let pixels_rms = 0.6 * (2.0_f64 / 3.0).sqrt();
        // The 20 x 20 pixels end half a step inside: 1/400 less in the mean square.
        assert!((found.rms_mm / pixels_rms - 1.0).abs() < 2e-3, "{found:?}");
        assert!(found.max_mm < 0.6 * 2f64.sqrt());
        assert!(found.point_in_camera_mm.xy().norm() < 1e-3);
    }
}
