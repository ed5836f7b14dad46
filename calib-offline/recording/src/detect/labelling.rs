//! Where a grid of corners can lie on the known board: turns, offsets, colors and borders.

use super::border::Borders;
use super::grid::{FittedGrid, Node};
use calib_rays::board::BoardSpec;

/// A place of a grid on the board: a number of quarter turns and a shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Placement {
    /// 0 to 3. 0: the grid's first direction is the board's x; 1: the second direction is x;
    /// 2 and 3: the same backwards. All keep the grid right-handed.
    pub quarter_turns: u8,
    /// Added to the turned node: board column of the turned node (0, 0).
    pub col_shift: i32,
    /// The same for the row.
    pub row_shift: i32,
}

impl Placement {
    /// Column and row (in this order) of a node, on the board or beyond it.
    pub fn place(&self, node: Node) -> (i32, i32) {
        let (x, y) = turned(node, self.quarter_turns);
        (x + self.col_shift, y + self.row_shift)
    }

    /// Row and column of a node; they are on the board for every node of the grid that the
    /// placement was made for.
    pub fn row_col(&self, node: Node) -> (usize, usize) {
        let (x, y) = self.place(node);
        (y as usize, x as usize)
    }

    /// Whether a node, one of the grid or not, is on the board.
    pub fn is_on_board(&self, node: Node, board: &BoardSpec) -> bool {
        let (x, y) = turned(node, self.quarter_turns);
        (0..board.cols as i32).contains(&(x + self.col_shift))
            && (0..board.rows as i32).contains(&(y + self.row_shift))
    }

    /// Whether this is another placement after a turn that maps the board's corners onto themselves: which of the two is
    /// taken is then a matter of numbering alone. Other placements put the grid on another part of the board.
    pub fn is_turn_of(&self, other: &Self, board: &BoardSpec) -> bool {
        let (cols, rows) = (board.cols as i32, board.rows as i32);
        let quarter_turns = (self.quarter_turns + 4 - other.quarter_turns % 4) % 4;
        if quarter_turns % 2 == 1 && rows != cols {
            return false;
        }
        let (x, y) = turned((other.col_shift, other.row_shift), quarter_turns);
        let (dx, dy) = match quarter_turns {
            0 => (0, 0),
            1 => (0, cols - 1),
            2 => (cols - 1, rows - 1),
            _ => (rows - 1, 0),
        };
        (self.col_shift, self.row_shift) == (x + dx, y + dy)
    }

    /// Whether the square before corner (0, 0) of the board, towards negative x and y, is dark.
    pub fn dark_before_first_corner(&self, grid: &FittedGrid) -> bool {
        let steps = self.col_shift + self.row_shift + i32::from(self.quarter_turns);
        grid.dark_before_origin ^ (steps.rem_euclid(2) == 1)
    }
}

/// A node or direction in axes turned by quarter turns.
fn turned((i, j): Node, quarter_turns: u8) -> Node {
    match quarter_turns % 4 {
        0 => (i, j),
        1 => (j, -i),
        2 => (-i, -j),
        _ => (-j, i),
    }
}

/// Every placement on the board that agrees with what is seen at the grid's four sides.
pub fn placements(grid: &FittedGrid, board: &BoardSpec, borders: &Borders) -> Vec<Placement> {
    let (low, high) = grid.extent();
    let mut found = Vec::new();
    for quarter_turns in 0..4 {
        let (a, b) = (turned(low, quarter_turns), turned(high, quarter_turns));
        let (min_x, max_x) = (a.0.min(b.0), a.0.max(b.0));
        let (min_y, max_y) = (a.1.min(b.1), a.1.max(b.1));
        for row_shift in -min_y..board.rows as i32 - max_y {
            for col_shift in -min_x..board.cols as i32 - max_x {
                let corners_beyond = |outward: Node| match turned(outward, quarter_turns) {
                    (-1, _) => min_x + col_shift,
                    (1, _) => board.cols as i32 - 1 - (max_x + col_shift),
                    (_, -1) => min_y + row_shift,
                    _ => board.rows as i32 - 1 - (max_y + row_shift),
                };
                if borders.allow(corners_beyond) {
                    found.push(Placement {
                        quarter_turns,
                        col_shift,
                        row_shift,
                    });
                }
            }
        }
    }
    found
}

/// In how many ways a whole board can be numbered: 1, 2 (half turns) or 4 (quarter turns too).
///
/// A turn changes the colors at the first corner if rows and columns are one odd, one even, and so
/// does a quarter turn of an odd by odd board; such turns are told apart by [`fixed_color`].
pub fn symmetry_order(board: &BoardSpec) -> usize {
    if !board.looks_same_after_half_turn() {
        1
    } else if board.rows == board.cols && board.rows.is_multiple_of(2) {
        4
    } else {
        2
    }
}

/// Whether numbering is chosen so that the square before corner (0, 0), towards negative x and y,
/// is dark.
///
/// `Some(true)` wherever a turn of the board can make it so (one odd and one even count, or odd by
/// odd with as many rows as columns): the same corner is then the first one in every image of every
/// camera, today and tomorrow. `None` where the printed board alone decides.
pub fn fixed_color(board: &BoardSpec) -> Option<bool> {
    let turn_changes_it =
        !board.looks_same_after_half_turn() || (board.rows == board.cols && board.rows % 2 == 1);
    turn_changes_it.then_some(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_of_the_board_are_told_from_other_parts_of_it() {
        let placement = |quarter_turns, col_shift, row_shift| Placement {
            quarter_turns,
            col_shift,
            row_shift,
        };
        // A board of 6 x 8 seen whole, from either end.
        let board = BoardSpec::chessboard(6, 8, 10.0);
        let (whole, other_end) = (placement(0, 0, 0), placement(2, 7, 5));
        assert!(other_end.is_turn_of(&whole, &board) && whole.is_turn_of(&other_end, &board));
        for node in [(0, 0), (7, 0), (3, 5)] {
            let (x, y) = whole.place(node);
            assert_eq!(other_end.place(node), (7 - x, 5 - y));
        }
        // Seven of its eight columns, from one end or from the other: two parts of the board.
        assert!(!placement(2, 6, 5).is_turn_of(&whole, &board));
        assert!(placement(2, 6, 5).is_turn_of(&placement(0, 1, 0), &board));
        assert!(!placement(1, 0, 7).is_turn_of(&whole, &board));
        // A square one looks alike from four sides.
        let square = BoardSpec::chessboard(6, 6, 10.0);
        for turn in [placement(1, 0, 5), placement(2, 5, 5), placement(3, 5, 0)] {
            assert!(turn.is_turn_of(&whole, &square) && whole.is_turn_of(&turn, &square));
        }
    }
}
