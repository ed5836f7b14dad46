//! A target found in an image: its labelled markers, and how it is turned.

use super::ring_fit::FittedRing;
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// A marker with its label.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabelledMarker {
    /// Row on the target.
    pub row: usize,
    /// Column on the target.
    pub col: usize,
    /// The fit; its pixel is the image of the marker's center.
    pub ring: FittedRing,
    /// What the fit gave without the perspective: the middle of the ring's image.
    pub uncorrected: PixelPoint,
}

/// A target found in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Located {
    /// By row and column.
    pub markers: Vec<LabelledMarker>,
    /// Quarter turns, clockwise on screen, from upright to how the target is seen: 0 to 3.
    pub quarter_turns: u8,
}

/// How the target is turned on screen: from the mean direction of its columns.
pub(super) fn quarter_turns(labelled: &BTreeMap<(usize, usize), FittedRing>) -> u8 {
    let along_columns: Vector2<f64> = labelled
        .iter()
        .filter_map(|(&(row, col), ring)| {
            let next = labelled.get(&(row, col + 1))?;
            Some(at(next.pixel) - at(ring.pixel))
        })
        .sum();
    let angle_rad = along_columns.y.atan2(along_columns.x);
    let quarters = (angle_rad / std::f64::consts::FRAC_PI_2).round() as i32;
    quarters.rem_euclid(4) as u8
}

/// A pixel as a vector.
pub(super) fn at(pixel: PixelPoint) -> Vector2<f64> {
    Vector2::new(pixel.u, pixel.v)
}
