//! Points on the sensor and its size.
//!
//! The center of the top-left pixel is (0, 0); u points right, v down. A full image spans
//! (-0.5, -0.5) to (width - 0.5, height - 0.5).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A point on the sensor, px.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PixelPoint {
    /// To the right; 0 is the center of the leftmost pixel.
    pub u: f64,
    /// Down; 0 is the center of the topmost pixel.
    pub v: f64,
}

impl PixelPoint {
    /// The point (u, v), px.
    pub const fn new(u: f64, v: f64) -> Self {
        Self { u, v }
    }

    /// Distance to another point, px.
    pub fn distance_px(self, other: Self) -> f64 {
        (self.u - other.u).hypot(self.v - other.v)
    }
}

/// Width and height of a sensor (or of the image region calibrated), in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
pub struct SensorSize {
    /// Columns of pixels.
    pub width: u32,
    /// Rows of pixels.
    pub height: u32,
}

impl SensorSize {
    /// A sensor of `width` x `height` pixels.
    pub const fn new(width: u32, height: u32) -> Self {
        Self { width, height }
    }

    /// The point midway between the outer edges, px.
    pub fn center(self) -> PixelPoint {
        PixelPoint::new(
            f64::from(self.width) / 2.0 - 0.5,
            f64::from(self.height) / 2.0 - 0.5,
        )
    }

    /// Whether the point lies on the sensor, its outer pixels included to their edges.
    pub fn contains(self, pixel: PixelPoint) -> bool {
        (-0.5..=f64::from(self.width) - 0.5).contains(&pixel.u)
            && (-0.5..=f64::from(self.height) - 0.5).contains(&pixel.v)
    }
}

impl std::fmt::Display for SensorSize {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn center_of_four_pixels_is_between_them() {
        assert_eq!(SensorSize::new(4, 2).center(), PixelPoint::new(1.5, 0.5));
    }

    #[test]
    fn a_sensor_ends_half_a_pixel_beyond_the_last_center() {
        let sensor = SensorSize::new(640, 480);
        assert!(sensor.contains(PixelPoint::new(639.5, 479.5)));
        assert!(!sensor.contains(PixelPoint::new(639.6, 0.0)));
        assert!(!sensor.contains(PixelPoint::new(f64::NAN, 0.0)));
    }
}
