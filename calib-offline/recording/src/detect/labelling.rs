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
