//! What goes in and what comes out: a pixel, and the line in space that it sees.

/// A point on the sensor, px: the center of the top-left pixel is (0, 0), u right, v down.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PixelPoint {
    /// To the right.
    pub u: f32,
    /// Down.
    pub v: f32,
}

impl PixelPoint {
    /// The point (u, v), px.
    pub const fn new(u: f32, v: f32) -> Self {
        Self { u, v }
    }
}

/// The points `origin_mm + lambda * direction`, lambda > 0 in front of the camera; rig frame.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ray {
    /// The point of the ray nearest to its camera's reference point (its foot point), mm. The
    /// rays of a central camera all start in the same point.
    pub origin_mm: [f32; 3],
    /// From the camera into the scene, not normalized: its length is between 1 and 5.
    pub direction: [f32; 3],
}

impl Ray {
    /// What stands in a row of rays for a pixel that is not calibrated: no numbers.
    pub const OUTSIDE: Self = Self {
        origin_mm: [f32::NAN; 3],
        direction: [f32::NAN; 3],
    };

    /// Whether it is [`OUTSIDE`](Self::OUTSIDE): no ray.
    pub fn is_outside(&self) -> bool {
        let [x, _, _] = self.direction;
        x.is_nan()
    }
}
