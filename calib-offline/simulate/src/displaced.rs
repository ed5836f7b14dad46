//! Images whose corners are off by what their noise says, without noise in any pixel: as unsteady air or a
//! shaking stand displaces them. Such images compress as well as clean ones.

use calib_rays::board::BoardSpec;
use nalgebra::Vector2;

/// By how much the print of a board is displaced on its plate: at each corner by what moves its image by the
/// noise, with a level place around it, and smoothly in between.
#[derive(Debug, Clone)]
pub struct Displaced {
    board: BoardSpec,
    /// Row by row, mm.
    corners_mm: Vec<Vector2<f64>>,
}

impl Displaced {
    /// `corners_mm` are the displacements of all corners, row by row.
    pub(super) fn new(board: BoardSpec, corners_mm: Vec<Vector2<f64>>) -> Self {
        Self { board, corners_mm }
    }

    /// Of the print that is seen at a point of the plate, mm.
    pub(super) fn at(&self, point_mm: &Vector2<f64>) -> Vector2<f64> {
        let BoardSpec {
            rows,
            cols,
            square_mm,
            ..
        } = self.board;
        let place = |x_mm: f64, count: usize| {
            let x = (x_mm / square_mm).clamp(0.0, (count - 1) as f64);
            let first = (x.floor() as usize).min(count - 2);
            let t = x - first as f64;
            // Level at both ends, curvature included.
            (first, t * t * t * (t * (6.0 * t - 15.0) + 10.0))
        };
        let (col, a) = place(point_mm.x, cols);
        let (row, b) = place(point_mm.y, rows);
        let corner = |row: usize, col: usize| self.corners_mm[row * cols + col];
        let along = |row: usize| corner(row, col).lerp(&corner(row, col + 1), a);
        along(row).lerp(&along(row + 1), b)
    }
}
