//! The grid of `AprilTags`: tags in rows and columns, and between their corners small black squares,
//! so that a corner of a tag is the crossing of two edges.

use crate::print::artwork::{Artwork, Shape};
use crate::print::charuco::{Marker, draw_marker};
use crate::print::codes::Codes;

/// Which way the numbers of tags grow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TagOrder {
    /// Along the rows, and upwards from row to row: the first tag is at the lower left (Kalibr).
    Upwards,
    /// In reading order: the first tag is at the upper left.
    Downwards,
}

/// A grid of `AprilTags`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AprilGrid {
    /// Rows of tags.
    pub rows: usize,
    /// Columns of tags.
    pub cols: usize,
    /// Side of a tag with its black border, mm.
    pub tag_mm: f64,
    /// Space between tags, as a share of their side.
    pub spacing: f64,
    /// The tags.
    pub codes: Codes,
    /// Number of the first tag.
    pub first_id: usize,
    /// The black around a tag's code, in print; in an image either is found.
    pub border: TagBorder,
}

/// The black around a tag's code, in cells of the code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TagBorder {
    /// One cell, as `AprilTag` defines it and `OpenCV` prints it.
    One,
    /// Two cells: Kalibr's grids.
    Two,
}

impl TagBorder {
    /// How many cells.
    pub fn cells(self) -> usize {
        match self {
            Self::One => 1,
            Self::Two => 2,
        }
    }
}

impl AprilGrid {
    /// `OpenCV`'s name of the dictionary of a family such as `36h11`.
    pub fn dictionary_of(family: &str) -> String {
        format!("DICT_APRILTAG_{family}")
    }

    /// From one tag to the next, mm.
    pub fn pitch_mm(&self) -> f64 {
        self.tag_mm * (1.0 + self.spacing)
    }

    /// Width of the black around a tag's code, mm.
    pub fn border_mm(&self, border: TagBorder) -> f64 {
        let cells = border.cells();
        self.tag_mm * cells as f64 / (self.codes.side() + 2 * cells) as f64
    }

    /// Where a tag's corner lies, mm; `row` and `col` are `2 x tag + 0 or 1`.
    pub fn corner_mm(&self, row: usize, col: usize) -> [f64; 2] {
        let along = |k: usize| (k / 2) as f64 * self.pitch_mm() + (k % 2) as f64 * self.tag_mm;
        [along(col), along(row)]
    }

    /// How many tags there are.
    pub fn tag_count(&self) -> usize {
        self.rows * self.cols
    }

    /// Number of the tag in a row and column from the upper left.
    pub fn tag_at(&self, row: usize, col: usize, order: TagOrder) -> usize {
        let row = match order {
            TagOrder::Upwards => self.rows - 1 - row,
            TagOrder::Downwards => row,
        };
        self.first_id + row * self.cols + col
    }

    /// Row and column of a tag from the upper left; `None` if it is not on the grid.
    pub fn place_of(&self, id: usize, order: TagOrder) -> Option<(usize, usize)> {
        let k = id.checked_sub(self.first_id)?;
        (k < self.tag_count()).then(|| {
            let row = match order {
                TagOrder::Upwards => self.rows - 1 - k / self.cols,
                TagOrder::Downwards => k / self.cols,
            };
            (row, k % self.cols)
        })
    }

    /// What is printed, with a white margin of the space between tags twice. `OpenCV`'s dictionaries hold the tags
    /// upside down, and so does a print with a border of one cell; Kalibr's, of two, stand as `AprilTag` has them.
    pub fn artwork(&self, order: TagOrder) -> Artwork {
        let gap = self.spacing * self.tag_mm;
        let border = self.border;
        let mut shapes = Vec::new();
        for row in 0..=self.rows {
            for col in 0..=self.cols {
                let (x, y) = (col as f64 * self.pitch_mm(), row as f64 * self.pitch_mm());
                shapes.push(Shape::square(x - gap, y - gap, gap, true));
                if row < self.rows && col < self.cols {
                    let id = self.tag_at(row, col, order);
                    let tag = Marker {
                        codes: &self.codes,
                        id,
                        side_mm: self.tag_mm,
                        border_cells: border.cells(),
                        is_half_turned: border == TagBorder::Two,
                    };
                    draw_marker(&tag, [x, y], &mut shapes);
                }
            }
        }
        let end = |count: usize| count as f64 * self.pitch_mm() + 2.0 * gap;
        Artwork::new(
            [-3.0 * gap, end(self.cols), -3.0 * gap, end(self.rows)],
            shapes,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_numbers() {
        let grid = AprilGrid {
            rows: 6,
            cols: 5,
            tag_mm: 40.0,
            spacing: 0.3,
            codes: Codes::named("DICT_APRILTAG_36h11").unwrap(),
            first_id: 2,
            border: TagBorder::Two,
        };
        assert_eq!(grid.corner_mm(3, 0), [0.0, 92.0]);
        for order in [TagOrder::Upwards, TagOrder::Downwards] {
            for row in 0..6 {
                let id = grid.tag_at(row, 3, order);
                assert_eq!(grid.place_of(id, order), Some((row, 3)));
            }
        }
        assert_eq!(grid.tag_at(5, 0, TagOrder::Upwards), 2);
        assert_eq!(grid.place_of(1, TagOrder::Upwards), None);
        assert_eq!(grid.place_of(32, TagOrder::Upwards), None);
        let art = grid.artwork(TagOrder::Upwards);
        // At a corner, tag and small square meet.
        assert!(art.shade(0.1, 0.1).black && art.shade(-0.1, -0.1).black);
        assert!(!art.shade(0.1, -0.1).black && !art.shade(-0.1, 0.1).black);
    }

    #[test]
    fn tags_of_kalibr_stand_upright_within_two_cells_of_black() {
        // Tag 0 of the family, as AprilTag publishes it: row by row from the highest bit, white is 1.
        const TAG_0: u64 = 0xd_5d62_8584;
        let mut grid = AprilGrid {
            rows: 1,
            cols: 1,
            tag_mm: 1.0,
            spacing: 0.3,
            codes: Codes::named("DICT_APRILTAG_36h11").unwrap(),
            first_id: 0,
            border: TagBorder::Two,
        };
        let is_black = |grid: &AprilGrid, row: usize, col: usize| {
            let cell_mm = 1.0 / (6 + 2 * grid.border.cells()) as f64;
            let along = |k: usize| (k as f64 + 0.5) * cell_mm;
            grid.artwork(TagOrder::Upwards)
                .shade(along(col), along(row))
                .black
        };
        for row in 0..10 {
            for col in 0..10 {
                let inside = (2..8).contains(&row) && (2..8).contains(&col);
                let is_white = inside && TAG_0 >> (35 - (6 * (row - 2) + col - 2)) & 1 == 1;
                assert_eq!(is_black(&grid, row, col), !is_white, "{row}, {col}");
            }
        }
        assert_eq!(grid.border_mm(TagBorder::Two), 0.2);
        // OpenCV's, with one cell, are upside down.
        let kalibr = grid;
        grid.border = TagBorder::One;
        for row in 0..6 {
            for col in 0..6 {
                let upright = is_black(&kalibr, row + 2, col + 2);
                assert_eq!(is_black(&grid, 6 - row, 6 - col), upright);
            }
        }
    }
}
