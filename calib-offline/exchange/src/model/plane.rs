//! From the numbers of a model to pixels: focal lengths and the principal point.

use calib_rays::geometry::PixelPoint;
use nalgebra::Vector2;

/// Where a model's plane lies on the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImagePlane {
    /// `[fx, fy]`, px.
    pub focal_px: [f64; 2],
    /// `[cx, cy]`, px, the center of the top-left pixel being (0, 0).
    pub center_px: [f64; 2],
}

impl ImagePlane {
    /// From `fx, fy, cx, cy`.
    pub const fn new([fx, fy, cx, cy]: [f64; 4]) -> Self {
        Self {
            focal_px: [fx, fy],
            center_px: [cx, cy],
        }
    }

    /// The pixel of a place; `None` if it is no number.
    pub(super) fn pixel(&self, place: &Vector2<f64>) -> Option<PixelPoint> {
        let pixel = PixelPoint::new(
            self.center_px[0] + self.focal_px[0] * place.x,
            self.center_px[1] + self.focal_px[1] * place.y,
        );
        (pixel.u.is_finite() && pixel.v.is_finite()).then_some(pixel)
    }

    /// The place of a pixel.
    pub(super) fn place(&self, pixel: PixelPoint) -> Vector2<f64> {
        Vector2::new(
            (pixel.u - self.center_px[0]) / self.focal_px[0],
            (pixel.v - self.center_px[1]) / self.focal_px[1],
        )
    }
}
