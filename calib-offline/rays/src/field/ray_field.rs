//! The ray field of one camera: the type that estimation, evaluation and packing share.

use super::base_lens::BaseLens;
use super::polynomial::Polynomial;
use super::spline::Spline;
use super::transport;
use crate::geometry::{PixelPoint, Ray, SensorSize};
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A smooth map from the sensor to two numbers: polynomial plus spline deviation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SmoothMap {
    /// The part of low degree.
    pub polynomial: Polynomial,
    /// The local deviation; `None` is zero everywhere.
    pub spline: Option<Spline>,
}

impl SmoothMap {
    /// The map that is zero everywhere.
    pub fn zero(degree: usize) -> Self {
        Self {
            polynomial: Polynomial::zero(degree),
            spline: None,
        }
    }

    /// Value, and derivative by (u, v) per px (columns).
    pub fn evaluate(&self, sensor: SensorSize, pixel: PixelPoint) -> (Vector2<f64>, Matrix2<f64>) {
        let (mut value, mut derivative) = self.polynomial.evaluate(sensor, pixel);
        if let Some(spline) = &self.spline {
            let (v, d) = spline.evaluate(pixel);
            value += v;
            derivative += d;
        }
        (value, derivative)
    }
}

/// The ray field of one camera, in the camera's frame.
///
/// Pixel x sees the line `{ E m + lambda d }` with the direction `d` of the half-angle vector
/// `s(x)` ([`transport`]), the two axes `E` across it, and the offset `m(x)` in mm. `E m` is the
/// foot point of the camera's reference point on the ray. All rays of a central camera meet in
/// the reference point: it has no offset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RayField {
    /// The sensor that the field covers.
    pub sensor: SensorSize,
    /// The ideal lens underneath.
    pub base: BaseLens,
    /// Deviation of the half-angle vector from the base lens.
    pub direction: SmoothMap,
    /// Offset across the ray, mm; `None` for a central camera.
    pub offset: Option<SmoothMap>,
}

/// The field's two 2-vectors at one pixel, with their derivatives by (u, v) per px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldSample {
    /// Half-angle vector of the direction.
    pub s: Vector2<f64>,
    /// Its derivative, 1/px.
    pub ds: Matrix2<f64>,
    /// Offset across the ray, mm.
    pub m_mm: Vector2<f64>,
    /// Its derivative, mm/px.
    pub dm: Matrix2<f64>,
}

impl FieldSample {
    /// The ray, camera frame; unnormalized direction, origin at the foot point of the camera's
    /// reference point.
    pub fn ray(&self) -> Ray {
        Ray {
            origin_mm: transport::across(&self.s) * self.m_mm,
            direction: transport::direction(&self.s),
        }
    }
}

impl RayField {
    /// The field of an ideal lens.
    pub fn ideal(sensor: SensorSize, base: BaseLens, degree: usize) -> Self {
        Self {
            sensor,
            base,
            direction: SmoothMap::zero(degree),
            offset: None,
        }
    }

    /// The field's numbers at a pixel. Off the sensor they are extrapolated.
    pub fn sample(&self, pixel: PixelPoint) -> FieldSample {
        let center = self.sensor.center();
        let (base, base_derivative) = self
            .base
            .evaluate(&Vector2::new(pixel.u - center.u, pixel.v - center.v));
        let (deviation, deviation_derivative) = self.direction.evaluate(self.sensor, pixel);
        let (m_mm, dm) = self.offset.as_ref().map_or_else(
            || (Vector2::zeros(), Matrix2::zeros()),
            |offset| offset.evaluate(self.sensor, pixel),
        );
        FieldSample {
            s: base + deviation,
            ds: base_derivative + deviation_derivative,
            m_mm,
            dm,
        }
    }

    /// What the pixel sees, camera frame.
    pub fn ray(&self, pixel: PixelPoint) -> Ray {
        self.sample(pixel).ray()
    }

    /// Whether all rays meet in one point by construction.
    pub fn is_central(&self) -> bool {
        self.offset.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Projection;

    #[test]
    fn offset_moves_the_origin_across_the_ray() {
        let base = BaseLens::ideal(Projection::Perspective, 500.0);
        let mut field = RayField::ideal(SensorSize::new(640, 480), base, 3);
        let mut offset = SmoothMap::zero(0);
        offset.polynomial.coefficients[0] = Vector2::new(3.0, 4.0);
        field.offset = Some(offset);
        let ray = field.ray(PixelPoint::new(600.0, 20.0));
        assert!((ray.origin_mm.norm() - 5.0).abs() < 1e-14);
        assert!(ray.origin_mm.dot(&ray.direction).abs() < 1e-12);
    }
}
