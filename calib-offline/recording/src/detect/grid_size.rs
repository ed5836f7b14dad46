//! How many inner corners a board has, as it is seen and as it is stated.

use calib_rays::board::BoardSpec;
use std::fmt::{Display, Formatter};

/// Inner corners of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct GridSize {
    /// Along the shorter side if it was seen, rows as stated.
    pub rows: usize,
    /// Along the other.
    pub cols: usize,
}

impl Display for GridSize {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} x {}", self.rows, self.cols)
    }
}

impl GridSize {
    /// As the manifest states it.
    pub fn stated(board: &BoardSpec) -> Self {
        Self {
            rows: board.rows,
            cols: board.cols,
        }
    }

    /// As it is seen, lying or standing.
    pub fn seen((a, b): (usize, usize)) -> Self {
        Self {
            rows: a.min(b),
            cols: a.max(b),
        }
    }

    /// What to write where this is seen and something else is stated.
    pub fn hint(self, stated: Self) -> String {
        let sorted = Self::seen((stated.rows, stated.cols));
        if (sorted.rows, sorted.cols) == (self.rows + 1, self.cols + 1) {
            format!(
                "rows and cols count inner corners, not squares; a board of {stated} squares has rows = {}, \
                 cols = {}",
                stated.rows - 1,
                stated.cols - 1
            )
        } else {
            format!(
                "if this is the right board, write rows = {}, cols = {} (inner corners, not squares)",
                self.rows, self.cols
            )
        }
    }
}
