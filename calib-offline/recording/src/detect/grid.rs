//! The grid of fitted corners of one image: completed, cleaned, and with the colors of its squares.

use super::chessboard::RawCorner;
use super::corner_fit::{CornerGuess, FittedCorner, fit_corner};
use super::pixel_edge::PIXEL_VARIANCE;
use super::scatter::model_error_px;
use crate::dataset::image::GrayImage;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::median;
use nalgebra::{Matrix2, Vector2};
use std::collections::{BTreeMap, BTreeSet};

/// Position in a grid, counted along its two directions.
pub type Node = (i32, i32);

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

/// A fitted corner must not lie further from the detected one than this part of a square, and ...
const MAX_MOVE_SQUARES: f64 = 0.15;
/// ... this many pixels.
const MAX_MOVE_PX: f64 = 1.5;
/// An undetected corner must lie this near to where its neighbors predict it, squares.
const MAX_MISS_SQUARES: f64 = 0.12;
/// One that is clearly a corner may lie farther away: near the rim of a fisheye, predictions are off ...
const MAX_CLEAR_MISS_SQUARES: f64 = 0.3;
/// ... and clear means residuals of this part of the amplitude at most.
const CLEAR_RESIDUAL_OF_AMPLITUDE: f64 = 0.3;
/// So far an image must reach into the squares around an undetected corner, squares.
const REACH_SQUARES: f64 = 0.2;
/// Contrast of a corner against the median of the image: less is a shadow, or no corner.
const MIN_AMPLITUDE_OF_MEDIAN: f64 = 0.3;
/// With this contrast a corner is clearly one.
const CLEAR_AMPLITUDE_OF_MEDIAN: f64 = 0.7;
/// RMS residual against amplitude. A T-junction, where the board ends, has about 0.5.
const MAX_RESIDUAL_OF_AMPLITUDE: f64 = 0.4;
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
        let Typical { amplitude, .. } = grid.typical()?;
        let dark = grid.dark_before_origin;
        grid.corners
            .retain(|&node, corner| is_board_corner(node, corner, dark, amplitude));
        grid.complete(image, board, max_half_window_px);
        let Typical { sigma_px, .. } = grid.typical()?;
        let square_px = grid.square_px()?;
        grid.model_error_px = model_error_px(&grid.corners, square_px);
        let scatter_px = sigma_px.hypot(grid.model_error_px.unwrap_or(0.0));
        let limit_px = (MAX_SIGMA_OF_MEDIAN * scatter_px).max(MIN_SIGMA_LIMIT_PX);
        grid.corners.retain(|_, corner| corner.sigma_px <= limit_px);
        (grid.corners.len() >= 4).then_some(grid)
    }

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

    /// The image of one square at a node; see [`CornerGuess::px_from_square`].
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
                .filter_map(|&node| Some((node, predicted(&pixels, node)?.0)))
                .collect();
            if near.is_empty() {
                return pixels;
            }
            pixels.extend(near);
        }
    }

    /// Fits the corners that the neighbors predict and the detector missed, as far as the board
    /// reaches, until no more are found.
    fn complete(&mut self, image: &GrayImage, board: &BoardSpec, max_half_window_px: f64) {
        let mut tried = BTreeSet::new();
        loop {
            let pixels = self.pixels();
            let mut added = false;
            for node in missing_neighbors(&pixels, board) {
                // Once more with more neighbors would be the same window again.
                if !tried.insert(node) {
                    continue;
                }
                let Some(corner) = self.fit_missing(image, &pixels, node, max_half_window_px)
                else {
                    continue;
                };
                let mut nodes: Vec<Node> = self.corners.keys().copied().collect();
                nodes.push(node);
                if fits_board(&nodes, board) {
                    self.corners.insert(node, corner);
                    added = true;
                }
            }
            if !added {
                return;
            }
        }
    }

    fn fit_missing(
        &self,
        image: &GrayImage,
        pixels: &BTreeMap<Node, PixelPoint>,
        node: Node,
        max_half_window_px: f64,
    ) -> Option<FittedCorner> {
        let typical = self.typical()?;
        let (pixel, px_from_square) = predicted(pixels, node)?;
        let guess = CornerGuess {
            pixel,
            px_from_square,
            blur_px: typical.lens_blur_px().min(2.0 * CornerGuess::BLUR_PX),
        };
        if !shows_four_squares(image, &guess) {
            return None;
        }
        let corner = fit_corner(image, &guess, max_half_window_px)?;
        let is_clear = corner.amplitude.abs() >= CLEAR_AMPLITUDE_OF_MEDIAN * typical.amplitude
            && corner.residual_rms <= CLEAR_RESIDUAL_OF_AMPLITUDE * corner.amplitude.abs();
        let miss_squares = if is_clear {
            MAX_CLEAR_MISS_SQUARES
        } else {
            MAX_MISS_SQUARES
        };
        let near = corner.moved_px <= miss_squares * shorter_side(&px_from_square);
        let as_sharp = corner.blur_px <= 2.0 * typical.blur_px + 0.5;
        let genuine = is_board_corner(node, &corner, self.dark_before_origin, typical.amplitude);
        (near && as_sharp && genuine).then_some(corner)
    }
}

/// Whether the image reaches into all four squares around a corner. At its edge the end of the
/// board's last squares looks like a corner of which half is cut off.
fn shows_four_squares(image: &GrayImage, guess: &CornerGuess) -> bool {
    let reach = REACH_SQUARES;
    [
        (-reach, -reach),
        (reach, -reach),
        (-reach, reach),
        (reach, reach),
    ]
    .iter()
    .all(|&(x, y)| {
        let offset = guess.px_from_square * Vector2::new(x, y);
        let (u, v) = (guess.pixel.u + offset.x, guess.pixel.v + offset.y);
        image.between(u, v).is_some()
    })
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
    /// Standard deviation of the lens's blur alone, px.
    fn lens_blur_px(&self) -> f64 {
        (self.blur_px.powi(2) - PIXEL_VARIANCE).max(0.0).sqrt()
    }
}

/// The neighbors of a node along both directions.
const NEIGHBORS: [Node; 4] = [(1, 0), (-1, 0), (0, 1), (0, -1)];

fn plus(node: Node, step: Node, times: i32) -> Node {
    (node.0 + step.0 * times, node.1 + step.1 * times)
}

fn extent_of<'a>(nodes: impl Iterator<Item = &'a Node>) -> (Node, Node) {
    nodes.fold(
        ((i32::MAX, i32::MAX), (i32::MIN, i32::MIN)),
        |(low, high), &(i, j)| ((low.0.min(i), low.1.min(j)), (high.0.max(i), high.1.max(j))),
    )
}

/// Whether the nodes fit on the board, lying or standing.
fn fits_board(nodes: &[Node], board: &BoardSpec) -> bool {
    let (low, high) = extent_of(nodes.iter());
    let (w, h) = ((high.0 - low.0 + 1) as usize, (high.1 - low.1 + 1) as usize);
    (w <= board.cols && h <= board.rows) || (w <= board.rows && h <= board.cols)
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

/// +1 on nodes with the color pattern of node (0, 0), -1 on the others.
fn node_sign((i, j): Node) -> f64 {
    if (i + j).rem_euclid(2) == 0 {
        1.0
    } else {
        -1.0
    }
}

fn is_board_corner(
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

fn vector(from: PixelPoint, to: PixelPoint) -> Vector2<f64> {
    Vector2::new(to.u - from.u, to.v - from.v)
}

/// Shorter of the two sides of a square in the image, px.
fn shorter_side(px_from_square: &Matrix2<f64>) -> f64 {
    px_from_square
        .column(0)
        .norm()
        .min(px_from_square.column(1).norm())
}

/// The image of one square at a node, from its neighbors; where it has none along a direction,
/// from a neighbor's neighbors.
fn px_from_square(pixels: &BTreeMap<Node, PixelPoint>, node: Node) -> Option<Matrix2<f64>> {
    let along = |step: Node| {
        step_at(pixels, node, step).or_else(|| {
            NEIGHBORS
                .iter()
                .find_map(|&side| step_at(pixels, plus(node, side, 1), step))
        })
    };
    let (x, y) = (along((1, 0))?, along((0, 1))?);
    Some(Matrix2::from_columns(&[x, y]))
}

fn step_at(pixels: &BTreeMap<Node, PixelPoint>, node: Node, step: Node) -> Option<Vector2<f64>> {
    let here = pixels.get(&node)?;
    let next = pixels.get(&plus(node, step, 1));
    let before = pixels.get(&plus(node, step, -1));
    match (before, next) {
        (Some(&before), Some(&next)) => Some(vector(before, next) / 2.0),
        (None, Some(&next)) => Some(vector(*here, next)),
        (Some(&before), None) => Some(vector(before, *here)),
        (None, None) => None,
    }
}

/// Nodes without a corner next to nodes with one, in order, on grids that fit on the board.
fn missing_neighbors(pixels: &BTreeMap<Node, PixelPoint>, board: &BoardSpec) -> Vec<Node> {
    let nodes: Vec<Node> = pixels.keys().copied().collect();
    let mut missing: Vec<Node> = nodes
        .iter()
        .flat_map(|&node| NEIGHBORS.map(|step| plus(node, step, 1)))
        .filter(|node| !pixels.contains_key(node))
        .collect();
    missing.sort_unstable();
    missing.dedup();
    missing.retain(|&node| {
        let mut extended = nodes.clone();
        extended.push(node);
        fits_board(&extended, board)
    });
    missing
}

/// Where a missing corner should be, from lines through its neighbors, bent where there are enough of
/// them to tell, and the image of a square there.
fn predicted(
    pixels: &BTreeMap<Node, PixelPoint>,
    node: Node,
) -> Option<(PixelPoint, Matrix2<f64>)> {
    let mut sum = Vector2::zeros();
    let mut count = 0.0;
    let mut axes = None;
    for step in NEIGHBORS {
        let Some(&near) = pixels.get(&plus(node, step, 1)) else {
            continue;
        };
        axes = axes.or_else(|| px_from_square(pixels, plus(node, step, 1)));
        let place = |times: i32| {
            let at = pixels.get(&plus(node, step, times));
            at.map(|p| Vector2::new(p.u, p.v))
        };
        let near = Vector2::new(near.u, near.v);
        sum += match (place(-1), place(2), place(-2), place(3)) {
            (Some(opposite), Some(far), Some(far_opposite), _) => {
                ((near + opposite) * 4.0 - far - far_opposite) / 6.0
            }
            (Some(opposite), ..) => (near + opposite) / 2.0,
            (None, Some(far), _, Some(farthest)) => (near - far) * 3.0 + farthest,
            (None, Some(far), ..) => near * 2.0 - far,
            _ => continue,
        };
        count += 1.0;
    }
    let mean = sum / count;
    (count > 0.0).then_some(())?;
    Some((PixelPoint::new(mean.x, mean.y), axes?))
}
