//! The measurement target: a flat grid of ring markers, some of them larger to tell its direction.
//!
//! Target frame: origin at the center of the marker in row 0, column 0, x along the columns, y along
//! the rows, z away from the printed face, mm.

use nalgebra::Vector3;
use std::path::PathBuf;

/// A target of ring markers as the manifest describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetSpec {
    /// Rows of markers, along y.
    pub rows: usize,
    /// Columns of markers, along x.
    pub cols: usize,
    /// Distance of neighboring markers' centers, mm.
    pub pitch_mm: f64,
    /// Outer radius of an ordinary marker, mm.
    pub outer_radius_mm: f64,
    /// Outer radius of a direction marker, mm.
    pub direction_outer_radius_mm: f64,
    /// (row, col) of the direction markers.
    pub direction: Vec<(usize, usize)>,
    /// Images of the target by camera (in the dataset's order) and target pose; empty for a camera
    /// that has none.
    pub images: Vec<Vec<PathBuf>>,
}

/// A turn or mirror that maps the direction markers onto themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TargetSymmetry {
    /// By so many quarter turns: 1 to 3.
    Turn(u8),
    /// A mirror image, turned by so many quarter turns: 0 to 3.
    Mirror(u8),
}

impl std::fmt::Display for TargetSymmetry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Turn(quarters) => write!(f, "after a turn by {} degrees", 90 * quarters),
            Self::Mirror(0) => write!(f, "with its columns in opposite order"),
            Self::Mirror(2) => write!(f, "with its rows in opposite order"),
            Self::Mirror(_) => write!(f, "mirrored at a diagonal"),
        }
    }
}

/// The place of a grid's (row, col) after quarter turns, in the turned grid; `size` is (rows, cols)
/// before the turn. A quarter turn takes row 0 to the last column.
pub fn turned(
    (row, col): (usize, usize),
    (rows, cols): (usize, usize),
    quarters: u8,
) -> (usize, usize) {
    match quarters % 4 {
        0 => (row, col),
        1 => (col, rows - 1 - row),
        2 => (rows - 1 - row, cols - 1 - col),
        _ => (cols - 1 - col, row),
    }
}

impl TargetSpec {
    /// The file of labelled markers beside the manifest.
    pub const MARKERS: &str = "markers.csv";

    /// Number of markers.
    pub fn marker_count(&self) -> usize {
        self.rows * self.cols
    }

    /// Whether the marker is one of the larger ones.
    pub fn is_direction(&self, row: usize, col: usize) -> bool {
        self.direction.contains(&(row, col))
    }

    /// Outer radius of a marker, mm.
    pub fn outer_radius_mm_of(&self, row: usize, col: usize) -> f64 {
        if self.is_direction(row, col) {
            self.direction_outer_radius_mm
        } else {
            self.outer_radius_mm
        }
    }

    /// Nominal center of a marker in the target frame, mm: `(col, row, 0) * pitch_mm`.
    pub fn marker_in_target(&self, row: usize, col: usize) -> Vector3<f64> {
        Vector3::new(col as f64 * self.pitch_mm, row as f64 * self.pitch_mm, 0.0)
    }

    /// Number of a marker at a pose among all poses: `(pose * rows + row) * cols + col`.
    pub fn marker_id(&self, pose: usize, row: usize, col: usize) -> usize {
        (pose * self.rows + row) * self.cols + col
    }

    /// Poses that have an image.
    pub fn pose_count(&self) -> usize {
        self.images.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// The first turn or mirror of the grid that maps the direction markers onto themselves; `None`
    /// if they tell the target's direction.
    pub fn symmetry(&self) -> Option<TargetSymmetry> {
        let size = (self.rows, self.cols);
        let turns = if self.rows == self.cols {
            &[0, 1, 2, 3][..]
        } else {
            &[0, 2][..]
        };
        let maps_onto_itself = |mirrored: bool, quarters: u8| {
            self.direction.iter().all(|&(row, col)| {
                let col = if mirrored { self.cols - 1 - col } else { col };
                self.direction.contains(&turned((row, col), size, quarters))
            })
        };
        let turn = turns
            .iter()
            .filter(|&&k| k > 0 && maps_onto_itself(false, k));
        let mirror = turns.iter().filter(|&&k| maps_onto_itself(true, k));
        turn.map(|&k| TargetSymmetry::Turn(k))
            .chain(mirror.map(|&k| TargetSymmetry::Mirror(k)))
            .next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(rows: usize, cols: usize, direction: &[(usize, usize)]) -> TargetSpec {
        TargetSpec {
            rows,
            cols,
            pitch_mm: 12.0,
            outer_radius_mm: 4.0,
            direction_outer_radius_mm: 5.0,
            direction: direction.to_vec(),
            images: Vec::new(),
        }
    }

    #[test]
    fn symmetries_of_the_direction_markers() {
        let of = |rows, cols, direction: &[_]| target(rows, cols, direction).symmetry();
        let published = [(3, 4), (3, 5), (3, 6), (4, 4), (1, 2)];
        assert_eq!(of(7, 9, &published), None);
        // The middle alone looks the same from everywhere.
        assert_eq!(of(7, 9, &[(3, 4)]), Some(TargetSymmetry::Turn(2)));
        // On the middle row: upside down with its rows in opposite order.
        assert_eq!(of(7, 9, &[(3, 5)]), Some(TargetSymmetry::Mirror(2)));
        assert_eq!(of(7, 9, &[(2, 4)]), Some(TargetSymmetry::Mirror(0)));
        assert_eq!(of(7, 9, &[(2, 3)]), None);
        // On a square grid the diagonals count too.
        assert_eq!(of(7, 7, &[(1, 1)]), Some(TargetSymmetry::Mirror(3)));
        assert_eq!(
            of(7, 7, &[(0, 1), (1, 6), (6, 5), (5, 0)]),
            Some(TargetSymmetry::Turn(1))
        );
        assert_eq!(of(7, 7, &[(1, 2)]), None);
        assert_eq!(of(7, 9, &[]), Some(TargetSymmetry::Turn(2)));
    }

    #[test]
    fn four_quarter_turns_are_none() {
        let size = (7, 9);
        let mut place = (1, 2);
        assert_eq!(turned(place, size, 1), (2, 5));
        for k in 0..4 {
            let now = if k % 2 == 0 { (7, 9) } else { (9, 7) };
            place = turned(place, now, 1);
        }
        assert_eq!(place, (1, 2));
        for k in 0..4u8 {
            let twice = turned(
                turned((1, 2), size, k),
                if k % 2 == 0 { size } else { (9, 7) },
                4 - k,
            );
            assert_eq!(twice, (1, 2));
        }
    }

    #[test]
    fn numbers_and_places_of_markers() {
        let target = target(7, 9, &[(2, 3)]);
        assert_eq!(target.marker_id(2, 3, 4), 2 * 63 + 31);
        let place = target.marker_in_target(3, 4);
        assert_eq!((place.x, place.y, place.z), (48.0, 36.0, 0.0));
        assert_eq!(target.outer_radius_mm_of(2, 3), 5.0);
        assert_eq!(target.outer_radius_mm_of(3, 2), 4.0);
    }
}
