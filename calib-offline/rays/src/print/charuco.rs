//! The `ChArUco` board: a chessboard with a coded marker in each white square.
//!
//! As `OpenCV` draws it: squares in rows from the top, the one at the upper left black, and markers
//! numbered in reading order over the white squares. The pattern of `OpenCV` before 4.6, where it has an
//! even number of rows of squares, has a white square at the upper left (`legacy`).

use crate::print::artwork::{Artwork, Shape};
use crate::print::codes::Codes;

/// A `ChArUco` board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Charuco {
    /// Rows of inner corners.
    pub rows: usize,
    /// Columns of inner corners.
    pub cols: usize,
    /// Side of a square, mm.
    pub square_mm: f64,
    /// Side of a marker with its black border, mm.
    pub marker_mm: f64,
    /// The markers.
    pub codes: Codes,
    /// Whether the pattern is that of `OpenCV` before 4.6.
    pub legacy: bool,
    /// Number of the first marker.
    pub first_id: usize,
}

impl Charuco {
    /// Whether a square is black; squares count from 0 at the upper left.
    pub fn is_black(&self, square_row: usize, square_col: usize) -> bool {
        let shifted = self.legacy && (self.rows + 1).is_multiple_of(2);
        (square_row + square_col + usize::from(shifted)).is_multiple_of(2)
    }

    /// Number of the marker in a square; `None` in black ones and beyond the board.
    pub fn marker_in(&self, square_row: usize, square_col: usize) -> Option<usize> {
        let on_board = square_row <= self.rows && square_col <= self.cols;
        (on_board && !self.is_black(square_row, square_col)).then(|| {
            let whites_before = |row: usize, until: usize| {
                let first = usize::from(self.is_black(row, 0));
                (until + 1 - first) / 2
            };
            let above: usize = (0..square_row)
                .map(|row| whites_before(row, self.cols + 1))
                .sum();
            self.first_id + above + whites_before(square_row, square_col)
        })
    }

    /// How many markers the board has.
    pub fn marker_count(&self) -> usize {
        let squares = (self.rows + 1) * (self.cols + 1);
        if self.is_black(0, 0) {
            squares / 2
        } else {
            squares.div_ceil(2)
        }
    }

    /// What is printed, with a white margin of half a square.
    pub fn artwork(&self) -> Artwork {
        let s = self.square_mm;
        let margin = (s - self.marker_mm) / 2.0;
        let mut shapes = Vec::new();
        for row in 0..=self.rows {
            for col in 0..=self.cols {
                let (x, y) = ((col as f64 - 1.0) * s, (row as f64 - 1.0) * s);
                match self.marker_in(row, col) {
                    None => shapes.push(Shape::square(x, y, s, true)),
                    Some(id) => {
                        let marker = Marker {
                            codes: &self.codes,
                            id,
                            side_mm: self.marker_mm,
                            border_cells: 1,
                            is_half_turned: false,
                        };
                        draw_marker(&marker, [x + margin, y + margin], &mut shapes);
                    }
                }
            }
        }
        let beyond = 1.5 * s;
        let plate = [
            -beyond,
            (self.cols as f64 - 1.0) * s + beyond,
            -beyond,
            (self.rows as f64 - 1.0) * s + beyond,
        ];
        Artwork::new(plate, shapes)
    }
}

/// A marker as it is printed.
pub(crate) struct Marker<'a> {
    pub codes: &'a Codes,
    pub id: usize,
    /// With its border.
    pub side_mm: f64,
    pub border_cells: usize,
    /// Turned by half a turn against its dictionary.
    pub is_half_turned: bool,
}

/// Draws a marker: a black square, and white cells in runs along its rows.
pub(crate) fn draw_marker(marker: &Marker<'_>, [x, y]: [f64; 2], shapes: &mut Vec<Shape>) {
    shapes.push(Shape::square(x, y, marker.side_mm, true));
    let side = marker.codes.side() as i64;
    let border = marker.border_cells as i64;
    let cell = marker.side_mm / (side + 2 * border) as f64;
    let is_black = |row: i64, col: i64| {
        let (row, col) = if marker.is_half_turned {
            (side - 1 - row, side - 1 - col)
        } else {
            (row, col)
        };
        marker.codes.is_black(marker.id, row, col)
    };
    for row in 0..side {
        let mut col = 0;
        while col < side {
            let start = col;
            while col < side && !is_black(row, col) {
                col += 1;
            }
            if col > start {
                shapes.push(Shape::Rect {
                    from: [
                        x + (start + border) as f64 * cell,
                        y + (row + border) as f64 * cell,
                    ],
                    to: [
                        x + (col + border) as f64 * cell,
                        y + (row + border + 1) as f64 * cell,
                    ],
                    black: false,
                });
            }
            col += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board(rows: usize, cols: usize, legacy: bool) -> Charuco {
        Charuco {
            rows,
            cols,
            square_mm: 20.0,
            marker_mm: 15.0,
            codes: Codes::named("DICT_4X4_100").unwrap(),
            legacy,
            first_id: 5,
        }
    }

    #[test]
    fn markers_count_in_reading_order_over_white_squares() {
        // 4 x 3 squares.
        let new = board(3, 2, false);
        let ids: Vec<_> = (0..4)
            .flat_map(|row| (0..3).map(move |col| new.marker_in(row, col)))
            .collect();
        let expected = [
            None,
            Some(5),
            None,
            Some(6),
            None,
            Some(7),
            None,
            Some(8),
            None,
            Some(9),
            None,
            Some(10),
        ];
        assert_eq!(ids, expected);
        assert_eq!(new.marker_count(), 6);
        let old = board(3, 2, true);
        assert_eq!(old.marker_in(0, 0), Some(5));
        assert_eq!(old.marker_in(1, 1), Some(7));
        // An odd number of rows of squares is the same in both.
        assert_eq!(board(4, 2, true).marker_in(0, 0), None);
        assert_eq!(board(4, 2, true).marker_count(), 7);
    }

    #[test]
    fn a_corner_is_where_black_squares_meet() {
        let art = board(3, 2, false).artwork();
        assert!(art.shade(-1.0, -1.0).black && art.shade(1.0, 1.0).black);
        assert!(!art.shade(1.0, -1.0).black && !art.shade(-1.0, 1.0).black);
        // The border of a marker begins 2.5 mm inside its square.
        assert!(art.shade(3.0, -3.0).black);
    }
}
