//! Grids of circles: symmetric, or asymmetric with every other row shifted.
//!
//! The asymmetric grid is `OpenCV`'s: the circle in row r and column c lies at
//! `((2 c + r % 2) pitch, r pitch)`. Marked circles have a hole.

use crate::print::artwork::{Artwork, Shape};

/// A grid of circles.
#[derive(Debug, Clone, PartialEq)]
pub struct Circles {
    /// Rows.
    pub rows: usize,
    /// Columns: circles in a row.
    pub cols: usize,
    /// Distance of neighbors along a row and a column; in an asymmetric grid, of neighboring rows.
    pub pitch_mm: f64,
    /// Diameter of a circle, mm.
    pub diameter_mm: f64,
    /// Whether every other row is shifted.
    pub asymmetric: bool,
    /// (row, col) of the marked circles.
    pub direction: Vec<(usize, usize)>,
}

/// Diameter of a marked circle's hole as a share of its own.
pub const HOLE: f64 = 0.45;

impl Circles {
    /// Where a circle's center lies in pitches: along x and y, whole numbers.
    pub fn place(&self, row: usize, col: usize) -> (i64, i64) {
        let x = if self.asymmetric {
            2 * col + row % 2
        } else {
            col
        };
        (x as i64, row as i64)
    }

    /// Where a circle's center lies, mm.
    pub fn center_mm(&self, row: usize, col: usize) -> [f64; 2] {
        let (x, y) = self.place(row, col);
        [x as f64 * self.pitch_mm, y as f64 * self.pitch_mm]
    }

    /// Whether a circle is marked.
    pub fn is_marked(&self, row: usize, col: usize) -> bool {
        self.direction.contains(&(row, col))
    }

    /// What is printed, with a white margin of a pitch around the outermost circles.
    pub fn artwork(&self) -> Artwork {
        let mut shapes = Vec::new();
        let radius = self.diameter_mm / 2.0;
        for row in 0..self.rows {
            for col in 0..self.cols {
                let at = self.center_mm(row, col);
                shapes.push(Shape::Disk {
                    at,
                    radius,
                    black: true,
                });
                if self.is_marked(row, col) {
                    shapes.push(Shape::Disk {
                        at,
                        radius: HOLE * radius,
                        black: false,
                    });
                }
            }
        }
        let margin = radius + self.pitch_mm;
        let last = |at: usize| {
            let places = (0..self.rows).map(|row| self.center_mm(row, self.cols - 1)[at]);
            places.fold(0.0, f64::max) + margin
        };
        Artwork::new([-margin, last(0), -margin, last(1)], shapes)
    }
}
