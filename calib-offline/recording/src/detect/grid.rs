//! The grid of fitted corners of one image: completed, cleaned, and with the colors of its squares.

use super::corner_fit::FittedCorner;
pub use super::lattice::Node;
use super::lattice::{NEIGHBORS, extent_of, plus, predicted, px_from_square, shorter_side};
use super::pixel_edge::PIXEL_VARIANCE;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::median;
use nalgebra::Matrix2;
use std::collections::{BTreeMap, BTreeSet};

/// Corners of one image on a grid of unknown place on the board.
///
/// The numbering is right-handed in the image: from the first to the second direction turns
/// clockwise on screen (u right, v down), as x to y on a board seen from its printed side.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedGrid {
    /// The corners by node.
    pub corners: BTreeMap<Node, FittedCorner>,
    /// Whether the square before node (0, 0) in both directions is dark.
    pub dark_before_origin: bool,
    /// Standard deviation per axis that the corners have beyond what their fits predict, px; `None` if
    /// too few are there to tell.
    pub model_error_px: Option<f64>,
}

/// A fit with residuals of more than this many medians, ...
const DISTURBED: f64 = 2.0;
/// ... and of more than this part of the amplitude, is disturbed, and tried again ...
const LEAST_DISTURBED_OF_AMPLITUDE: f64 = 0.05;
/// ... with this part of its window.
pub(super) const NARROW: f64 = 0.6;
/// Contrast of a corner against the median of the image: less is a shadow, or no corner.
const MIN_AMPLITUDE_OF_MEDIAN: f64 = 0.3;
/// With this contrast a corner is clearly one.
pub(super) const CLEAR_AMPLITUDE_OF_MEDIAN: f64 = 0.7;
/// RMS residual against amplitude. A T-junction, where the board ends, has about 0.5.
const MAX_RESIDUAL_OF_AMPLITUDE: f64 = 0.4;

impl FittedGrid {
    /// Smallest and largest node number along both directions: `((i, j) min, (i, j) max)`.
    pub fn extent(&self) -> (Node, Node) {
        extent_of(self.corners.keys())
    }

    /// Number of nodes between the outermost corners along both directions.
    pub fn size(&self) -> (usize, usize) {
        let (low, high) = self.extent();
        ((high.0 - low.0 + 1) as usize, (high.1 - low.1 + 1) as usize)
    }

    /// Whether the outermost corners are as far apart as the board's, lying or standing.
    pub fn is_whole(&self, board: &BoardSpec) -> bool {
        let (w, h) = self.size();
        (w, h) == (board.cols, board.rows) || (w, h) == (board.rows, board.cols)
    }

    /// Medians over the corners; `None` if there are none.
    pub fn typical(&self) -> Option<Typical> {
        let median = |of: fn(&FittedCorner) -> f64| median(self.corners.values().map(of));
        Some(Typical {
            amplitude: median(|c| c.amplitude.abs())?,
            blur_px: median(|c| c.blur_px)?,
            residual_rms: median(|c| c.residual_rms)?,
            sigma_px: median(|c| c.sigma_px)?,
        })
    }

    /// Standard deviation per axis of one of the corners, px; `unknown_px` is what fits leave out where
    /// the image itself does not tell.
    pub fn sigma_px(&self, corner: &FittedCorner, unknown_px: f64) -> f64 {
        let model_error_px = self.model_error_px.unwrap_or(unknown_px);
        corner.sigma_px.hypot(model_error_px)
    }

    /// The median of [`FittedGrid::sigma_px`]; `None` without corners.
    pub fn typical_sigma_px(&self, unknown_px: f64) -> Option<f64> {
        median(self.corners.values().map(|c| self.sigma_px(c, unknown_px)))
    }

    /// The image of one square at a node; see `CornerGuess::px_from_square`.
    pub fn px_from_square(&self, node: Node) -> Option<Matrix2<f64>> {
        px_from_square(&self.pixels(), node)
    }

    /// Shorter side of a square in the image, median over the corners, px.
    pub fn square_px(&self) -> Option<f64> {
        let pixels = self.pixels();
        let squares = pixels
            .keys()
            .filter_map(|&node| px_from_square(&pixels, node));
        median(squares.map(|m| shorter_side(&m)))
    }

    /// The corners' places alone.
    pub fn pixels(&self) -> BTreeMap<Node, PixelPoint> {
        self.corners.iter().map(|(&n, c)| (n, c.pixel)).collect()
    }

    /// The corners' places, and beside them those that lines through them predict, as far as the
    /// board may reach.
    pub fn extended(&self, board: &BoardSpec) -> BTreeMap<Node, PixelPoint> {
        let mut pixels = self.pixels();
        let (low, high) = self.extent();
        let longer = board.rows.max(board.cols) as i32 - 1;
        let reaches = |(i, j): Node| {
            (high.0 - longer..=low.0 + longer).contains(&i)
                && (high.1 - longer..=low.1 + longer).contains(&j)
        };
        loop {
            let missing: BTreeSet<Node> = pixels
                .keys()
                .flat_map(|&node| NEIGHBORS.map(|step| plus(node, step, 1)))
                .filter(|node| !pixels.contains_key(node) && reaches(*node))
                .collect();
            let near: Vec<(Node, PixelPoint)> = missing
                .iter()
                .filter_map(|&node| Some((node, predicted(&pixels, node, 1.0)?.0)))
                .collect();
            if near.is_empty() {
                return pixels;
            }
            pixels.extend(near);
        }
    }
}

/// Medians over the corners of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Typical {
    /// Half the difference of bright and dark squares, code values.
    pub amplitude: f64,
    /// Standard deviation of the blur, px.
    pub blur_px: f64,
    /// RMS of the residuals of the corner fits, code values.
    pub residual_rms: f64,
    /// Standard deviation of a corner per axis, px.
    pub sigma_px: f64,
}

impl Typical {
    /// Whether a fit's window holds what is neither noise nor the corner: a neighbor's edge, where squares shrink fast
    /// towards the rim of a fisheye, or the board's end.
    pub(super) fn is_disturbed(&self, corner: &FittedCorner) -> bool {
        let usual = DISTURBED * self.residual_rms;
        corner.residual_rms > usual.max(LEAST_DISTURBED_OF_AMPLITUDE * self.amplitude)
    }

    /// Standard deviation of the lens's blur alone, px.
    pub(super) fn lens_blur_px(&self) -> f64 {
        (self.blur_px.powi(2) - PIXEL_VARIANCE).max(0.0).sqrt()
    }
}

/// +1 on nodes with the color pattern of node (0, 0), -1 on the others.
pub(super) fn node_sign((i, j): Node) -> f64 {
    if (i + j).rem_euclid(2) == 0 {
        1.0
    } else {
        -1.0
    }
}

pub(super) fn is_board_corner(
    node: Node,
    corner: &FittedCorner,
    dark_before_origin: bool,
    typical_amplitude: f64,
) -> bool {
    let sign = if dark_before_origin { 1.0 } else { -1.0 };
    let amplitude = corner.amplitude * sign * node_sign(node);
    // With most of its contrast it is no T-junction, which has half of it.
    let of_amplitude = if amplitude >= CLEAR_AMPLITUDE_OF_MEDIAN * typical_amplitude {
        amplitude.max(typical_amplitude)
    } else {
        amplitude
    };
    amplitude >= MIN_AMPLITUDE_OF_MEDIAN * typical_amplitude
        && corner.residual_rms <= MAX_RESIDUAL_OF_AMPLITUDE * of_amplitude
}
