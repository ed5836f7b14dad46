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

    /// Where a circle goes when the grid is turned by quarter turns onto itself; `None` if that turn does not map it
    /// onto itself.
    pub fn turned(&self, (row, col): (usize, usize), quarters: u8) -> Option<(usize, usize)> {
        let (last_row, last_col) = (self.rows.checked_sub(1)?, self.cols.checked_sub(1)?);
        let is_square = self.rows == self.cols && !self.asymmetric;
        match quarters % 4 {
            0 => Some((row, col)),
            2 if self.asymmetric && !self.rows.is_multiple_of(2) => None,
            2 => Some((last_row.checked_sub(row)?, last_col.checked_sub(col)?)),
            1 if is_square => Some((col, last_row.checked_sub(row)?)),
            3 if is_square => Some((last_col.checked_sub(col)?, row)),
            _ => None,
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_maps_the_grid_onto_itself_or_is_none() {
        let grid = |rows, cols, asymmetric| Circles {
            rows,
            cols,
            pitch_mm: 1.0,
            diameter_mm: 0.5,
            asymmetric,
            direction: Vec::new(),
        };
        for (grid, quarters, is_turn) in [
            (grid(4, 6, false), 2, true),
            (grid(4, 6, false), 1, false),
            (grid(5, 5, false), 3, true),
            (grid(9, 4, true), 2, false),
            (grid(8, 4, true), 2, true),
        ] {
            let middle = |k: usize| {
                let all = (0..grid.rows).flat_map(|r| (0..grid.cols).map(move |c| (r, c)));
                let sum: f64 = all.map(|(r, c)| grid.center_mm(r, c)[k]).sum();
                sum / (grid.rows * grid.cols) as f64
            };
            let (x0, y0) = (middle(0), middle(1));
            for row in 0..grid.rows {
                for col in 0..grid.cols {
                    let to = grid.turned((row, col), quarters);
                    assert_eq!(to.is_some(), is_turn);
                    let Some((to_row, to_col)) = to else { continue };
                    let [x, y] = grid.center_mm(row, col);
                    let turn = |(x, y): (f64, f64)| (-y, x);
                    let (dx, dy) = (0..quarters).fold((x - x0, y - y0), |at, _| turn(at));
                    let [u, v] = grid.center_mm(to_row, to_col);
                    assert!((u - x0 - dx).abs() + (v - y0 - dy).abs() < 1e-9);
                }
            }
        }
    }
}
