//! The calibration board: a flat chessboard, described by its inner corners.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A chessboard of `rows` x `cols` *inner* corners.
///
/// Board frame: the first inner corner (row 0, col 0) is the origin, x runs along the columns, y
/// along the rows, z = x cross y points away from the printed face, so that a camera looking at
/// the face has the board's z pointing away from it. Lengths in millimeters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BoardSpec {
    /// Inner corners along y.
    pub rows: usize,
    /// Inner corners along x.
    pub cols: usize,
    /// Pitch of the corners, mm.
    pub square_mm: f64,
}

impl BoardSpec {
    /// Number of inner corners.
    pub fn corner_count(&self) -> usize {
        self.rows * self.cols
    }

    /// Nominal position of a corner in the board frame, mm: `(col, row, 0) * square_mm`.
    pub fn corner_in_board(&self, row: usize, col: usize) -> Vector3<f64> {
        Vector3::new(
            col as f64 * self.square_mm,
            row as f64 * self.square_mm,
            0.0,
        )
    }

    /// The middle of the corners, board frame, mm.
    pub fn center_in_board(&self) -> Vector3<f64> {
        let (width_mm, height_mm) = self.extent_mm();
        Vector3::new(width_mm / 2.0, height_mm / 2.0, 0.0)
    }

    /// Distance from the first to the last corner along x and along y, mm.
    pub fn extent_mm(&self) -> (f64, f64) {
        (
            self.cols.saturating_sub(1) as f64 * self.square_mm,
            self.rows.saturating_sub(1) as f64 * self.square_mm,
        )
    }

    /// Whether the board looks the same after a half turn in its plane, squares' colors included.
    ///
    /// So it is when rows and columns are both odd or both even; a board with one of each can be
    /// told apart by the color of its corner square.
    pub fn looks_same_after_half_turn(&self) -> bool {
        self.rows % 2 == self.cols % 2
    }

    /// The label that a corner gets when the board is numbered from the opposite end.
    pub fn half_turned(&self, row: usize, col: usize) -> (usize, usize) {
        (self.rows - 1 - row, self.cols - 1 - col)
    }
}

/// Out-of-plane shape `z(X, Y)` of a board: Legendre products over the corners' extent, x and y
/// from -1 at the first to 1 at the last corner. A flat board has no term.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct BoardShape {
    /// Powers (i, j) and coefficient, mm.
    pub terms: Vec<(usize, usize, f64)>,
}

impl BoardShape {
    /// The shape of total degree 2 with all coefficients zero: bow along x, twist, bow along y.
    /// Lower degrees are poses, not shape.
    pub fn flat_of_degree_two() -> Self {
        Self {
            terms: vec![(2, 0, 0.0), (1, 1, 0.0), (0, 2, 0.0)],
        }
    }

    /// Value of each term's product (without its coefficient) at a point of the board.
    pub fn products<'a>(
        &'a self,
        board: &BoardSpec,
        point_in_board: &Vector3<f64>,
    ) -> impl Iterator<Item = f64> + 'a {
        let (width_mm, height_mm) = board.extent_mm();
        let x = 2.0 * point_in_board.x / width_mm - 1.0;
        let y = 2.0 * point_in_board.y / height_mm - 1.0;
        self.terms
            .iter()
            .map(move |&(i, j, _)| legendre(i, x) * legendre(j, y))
    }

    /// Height of the board's face along its z axis, mm.
    pub fn height_mm(&self, board: &BoardSpec, point_in_board: &Vector3<f64>) -> f64 {
        self.products(board, point_in_board)
            .zip(&self.terms)
            .map(|(product, (_, _, coefficient))| product * coefficient)
            .sum()
    }
}

/// Legendre polynomial of degree `n`, by recurrence.
fn legendre(n: usize, x: f64) -> f64 {
    let (mut previous, mut current) = (0.0, 1.0);
    for k in 0..n {
        let kf = k as f64;
        let next = ((2.0 * kf + 1.0) * x * current - kf * previous) / (kf + 1.0);
        previous = current;
        current = next;
    }
    current
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOARD: BoardSpec = BoardSpec {
        rows: 15,
        cols: 13,
        square_mm: 10.0,
    };

    #[test]
    fn last_corner_is_extent_away_from_first() {
        assert_eq!(
            BOARD.corner_in_board(14, 12),
            Vector3::new(120.0, 140.0, 0.0)
        );
        assert_eq!(BOARD.extent_mm(), (120.0, 140.0));
    }

    #[test]
    fn odd_by_odd_board_is_ambiguous_and_even_by_odd_is_not() {
        assert!(BOARD.looks_same_after_half_turn());
        assert!(
            !BoardSpec {
                rows: 6,
                cols: 9,
                square_mm: 25.0
            }
            .looks_same_after_half_turn()
        );
        assert_eq!(BOARD.half_turned(0, 12), (14, 0));
    }

    #[test]
    fn bow_is_one_at_the_edges_and_minus_half_in_the_middle() {
        let shape = BoardShape {
            terms: vec![(2, 0, 0.3)],
        };
        assert!((shape.height_mm(&BOARD, &BOARD.corner_in_board(0, 12)) - 0.3).abs() < 1e-15);
        assert!((shape.height_mm(&BOARD, &BOARD.center_in_board()) + 0.15).abs() < 1e-15);
    }
}
