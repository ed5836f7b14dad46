//! The grid of `AprilTags`: tags in rows and columns, and between their corners small black squares,
//! so that a corner of a tag is the crossing of two edges.

use crate::print::artwork::{Artwork, Shape};
use crate::print::charuco::draw_marker;
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

    /// What is printed, with a white margin of the space between tags twice.
    pub fn artwork(&self, order: TagOrder) -> Artwork {
        let gap = self.spacing * self.tag_mm;
        let mut shapes = Vec::new();
        for row in 0..=self.rows {
            for col in 0..=self.cols {
                let (x, y) = (col as f64 * self.pitch_mm(), row as f64 * self.pitch_mm());
                shapes.push(Shape::square(x - gap, y - gap, gap, true));
                if row < self.rows && col < self.cols {
                    let id = self.tag_at(row, col, order);
                    draw_marker(&self.codes, id, [x, y], self.tag_mm, &mut shapes);
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
}
