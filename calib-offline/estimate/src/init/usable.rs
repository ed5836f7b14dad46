//! Which views can place their board.

use super::bearing_pose::is_collinear;
use crate::adjust::observations::ViewBlock;

/// Fewest corners that place a board.
pub const MIN_CORNERS: usize = 6;

/// Whether the view alone can place its board.
pub fn is_usable(view: &ViewBlock) -> bool {
    let points: Vec<_> = view.corners.iter().map(|c| c.point_in_board).collect();
    points.len() >= MIN_CORNERS && !is_collinear(&points)
}
