//! The target of rings: a grid of black rings, some of them larger.

use crate::print::artwork::{Artwork, Shape};

/// Inner against outer radius of a ring.
pub const INNER: f64 = 0.5;

/// A grid of rings, mm; `outer_radius_mm` says how large the ring in a row and column is.
pub fn artwork(
    (rows, cols): (usize, usize),
    pitch_mm: f64,
    outer_radius_mm: impl Fn(usize, usize) -> f64,
) -> Artwork {
    let mut shapes = Vec::new();
    for row in 0..rows {
        for col in 0..cols {
            let at = [col as f64 * pitch_mm, row as f64 * pitch_mm];
            let radius = outer_radius_mm(row, col);
            for (radius, black) in [(radius, true), (INNER * radius, false)] {
                shapes.push(Shape::Disk { at, radius, black });
            }
        }
    }
    let end = |count: usize| count as f64 * pitch_mm;
    Artwork::new([-pitch_mm, end(cols), -pitch_mm, end(rows)], shapes)
}
