//! A grid of rough corners becomes one of fitted corners: fitted, cleaned and completed.

use super::chessboard::RawCorner;
use super::completion;
use super::corner_fit::{CornerGuess, FittedCorner, fit_corner};
use super::grid::{FittedGrid, NARROW, Typical, is_board_corner, node_sign};
use super::lattice::{Node, extent_of, fits_board, px_from_square, shorter_side};
use super::scatter::model_error_px;
use crate::dataset::image::GrayImage;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::PixelPoint;
use std::collections::BTreeMap;

/// A fitted corner must not lie further from the detected one than this part of a square, and ...
const MAX_MOVE_SQUARES: f64 = 0.15;
/// ... this many pixels.
const MAX_MOVE_PX: f64 = 1.5;
/// Corners whose fits predict more than this factor of the median's scatter ...
const MAX_SIGMA_OF_MEDIAN: f64 = 4.0;
/// ... and more than this are dropped, px: on rendered images they are off by up to a pixel, the
/// others by less than 0.1 px.
const MIN_SIGMA_LIMIT_PX: f64 = 0.05;
/// Stray corners that may be cut off a grid that is larger than the board: this part of it.
const MAX_STRAY_PART: f64 = 0.1;

impl FittedGrid {
    /// Fits every raw corner, drops those that are none, adds those that the detector missed.
    ///
    /// `None` if fewer than four corners are left.
    pub fn from_raw(
        image: &GrayImage,
        raw: &[RawCorner],
        board: &BoardSpec,
        max_half_window_px: f64,
    ) -> Option<Self> {
        let rough = without_strays(right_handed(raw), board);
        let mut fitted = BTreeMap::new();
        let mut blur_px = CornerGuess::BLUR_PX;
        for (&node, &pixel) in &rough {
            let Some(px_from_square) = px_from_square(&rough, node) else {
                continue;
            };
            let guess = CornerGuess {
                pixel,
                px_from_square,
                blur_px,
            };
            let limit = MAX_MOVE_PX + MAX_MOVE_SQUARES * shorter_side(&px_from_square);
            if let Some(corner) = fit_corner(image, &guess, max_half_window_px)
                && corner.moved_px <= limit
            {
                // One that failed must not mislead those after it.
                blur_px = corner.lens_blur_px.min(2.0 * CornerGuess::BLUR_PX);
                fitted.insert(node, corner);
            }
        }
        let mut grid = Self {
            dark_before_origin: majority_is_dark(&fitted),
            corners: fitted,
            model_error_px: None,
        };
        let typical = grid.typical()?;
        for (node, corner) in &mut grid.corners {
            if let (true, Some(&pixel), Some(px_from_square)) = (
                typical.is_disturbed(corner),
                rough.get(node),
                px_from_square(&rough, *node),
            ) {
                let guess = CornerGuess {
                    pixel,
                    px_from_square: NARROW * px_from_square,
                    blur_px: typical.lens_blur_px(),
                };
                let limit = MAX_MOVE_PX + MAX_MOVE_SQUARES * shorter_side(&px_from_square);
                let narrow = fit_corner(image, &guess, max_half_window_px);
                if let Some(narrow) = narrow
                    .filter(|narrow| narrow.moved_px <= limit && !typical.is_disturbed(narrow))
                {
                    *corner = narrow;
                }
            }
        }
        let amplitude = typical.amplitude;
        let dark = grid.dark_before_origin;
        grid.corners
            .retain(|&node, corner| is_board_corner(node, corner, dark, amplitude));
        completion::complete(&mut grid, image, board, max_half_window_px);
        let Typical { sigma_px, .. } = grid.typical()?;
        let square_px = grid.square_px()?;
        grid.model_error_px = model_error_px(&grid.corners, square_px);
        let scatter_px = sigma_px.hypot(grid.model_error_px.unwrap_or(0.0));
        let limit_px = (MAX_SIGMA_OF_MEDIAN * scatter_px).max(MIN_SIGMA_LIMIT_PX);
        grid.corners.retain(|_, corner| corner.sigma_px <= limit_px);
        (grid.corners.len() >= 4).then_some(grid)
    }
}

fn right_handed(raw: &[RawCorner]) -> BTreeMap<Node, PixelPoint> {
    let as_found: BTreeMap<Node, PixelPoint> = raw.iter().map(|c| ((c.i, c.j), c.pixel)).collect();
    let turning: f64 = as_found
        .keys()
        .filter_map(|&node| px_from_square(&as_found, node))
        .map(|m| m.determinant().signum())
        .sum();
    if turning >= 0.0 {
        as_found
    } else {
        raw.iter().map(|c| ((c.j, c.i), c.pixel)).collect()
    }
}

/// Cuts a grid that is a little larger than the board to the part that holds most corners.
///
/// Left as it is if more than a few corners would go: then it is another board.
fn without_strays(
    corners: BTreeMap<Node, PixelPoint>,
    board: &BoardSpec,
) -> BTreeMap<Node, PixelPoint> {
    let nodes: Vec<Node> = corners.keys().copied().collect();
    if nodes.is_empty() || fits_board(&nodes, board) {
        return corners;
    }
    let (low, high) = extent_of(nodes.iter());
    let mut best: Vec<Node> = Vec::new();
    for (w, h) in [(board.cols, board.rows), (board.rows, board.cols)] {
        let (w, h) = (w as i32, h as i32);
        for i0 in low.0..=(high.0 - w + 1).max(low.0) {
            for j0 in low.1..=(high.1 - h + 1).max(low.1) {
                let within =
                    |&&(i, j): &&Node| (i0..i0 + w).contains(&i) && (j0..j0 + h).contains(&j);
                let kept: Vec<Node> = nodes.iter().filter(within).copied().collect();
                if kept.len() > best.len() {
                    best = kept;
                }
            }
        }
    }
    let stray_count = nodes.len() - best.len();
    if stray_count as f64 > MAX_STRAY_PART * nodes.len() as f64 {
        return corners;
    }
    best.iter()
        .filter_map(|node| corners.get(node).map(|&pixel| (*node, pixel)))
        .collect()
}

/// Whether most corners say that the square before node (0, 0) is dark.
fn majority_is_dark(corners: &BTreeMap<Node, FittedCorner>) -> bool {
    let votes: f64 = corners
        .iter()
        .map(|(&node, c)| c.amplitude.signum() * node_sign(node))
        .sum();
    votes > 0.0
}
