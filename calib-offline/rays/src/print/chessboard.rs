//! The chessboard, with or without marked squares.

use crate::print::artwork::{Artwork, Shape};

/// Diameter of the dot in a marked square as a share of its side.
pub const DOT: f64 = 0.5;

/// Squares around `rows` x `cols` inner corners, the one at the upper left black, with a dot of the
/// other color in each marked square; (row, col) of squares count from 0 at the upper left.
pub fn artwork(
    (rows, cols): (usize, usize),
    [width_mm, height_mm]: [f64; 2],
    marked: &[(usize, usize)],
) -> Artwork {
    let mut shapes = Vec::new();
    for row in 0..=rows {
        for col in 0..=cols {
            let black = (row + col).is_multiple_of(2);
            let (x, y) = (
                (col as f64 - 1.0) * width_mm,
                (row as f64 - 1.0) * height_mm,
            );
            if black {
                shapes.push(Shape::Rect {
                    from: [x, y],
                    to: [x + width_mm, y + height_mm],
                    black,
                });
            }
            if marked.contains(&(row, col)) {
                shapes.push(Shape::Disk {
                    at: [x + width_mm / 2.0, y + height_mm / 2.0],
                    radius: DOT / 2.0 * width_mm.min(height_mm),
                    black: !black,
                });
            }
        }
    }
    let (w, h) = (1.5 * width_mm, 1.5 * height_mm);
    let end = |count: usize, side: f64| (count as f64 - 1.0) * side;
    let plate = [-w, end(cols, width_mm) + w, -h, end(rows, height_mm) + h];
    Artwork::new(plate, shapes)
}
