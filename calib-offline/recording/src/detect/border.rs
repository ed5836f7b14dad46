//! What lies beyond the four sides of a grid: the board's border, or nobody knows.
//!
//! A part of a board can be placed on it only if something tells where the board ends. Beyond the
//! outermost corners lies one more row of squares, whole or trimmed, and behind it the bright
//! margin: its dark squares end along one line, and there the bright ones stay bright. A dark frame does
//! the same with the colors exchanged. Were there more corners, the colors would change over at that line instead.

use super::grid::{FittedGrid, Node};
use crate::dataset::image::GrayImage;
use calib_rays::numerics::median;

/// Outward directions of the four sides.
const OUTWARD: [Node; 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
/// Between the outermost corners and this distance (in squares) the colors must be the squares'.
const SQUARES_FROM: f64 = 0.2;
/// A dark frame is printed around whole squares; what ends them earlier covers them.
const FRAME_FROM: f64 = 0.75;
/// The squares of the other color must have ended here: one square and some perspective.
const SQUARES_UNTIL: f64 = 1.25;
/// Spacing of the samples, squares.
const SAMPLE_STEP: f64 = 0.05;
/// Their ends must agree to this, squares.
const END_SPREAD: f64 = 0.25;
/// The margin must be this wide at least behind their end, squares.
const MARGIN_WIDTH: f64 = 0.15;
/// Brightness from -1 (dark squares) to 1 (bright squares): beyond this it is clearly one of them.
const CLEAR: f64 = 0.4;
/// Part of the squares along a side that must agree.
const AGREEING: f64 = 0.75;
/// Squares of each color along a side that are needed to judge it.
const MIN_SQUARES: usize = 2;

/// On which sides of a grid the border of the board is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Borders([bool; 4]);

impl Borders {
    /// Nothing is known about any side.
    pub const UNKNOWN: Self = Self([false; 4]);

    /// Looks at the image beyond each side of the grid.
    pub fn seen(image: &GrayImage, grid: &FittedGrid) -> Self {
        Self(OUTWARD.map(|outward| is_border(image, grid, outward)))
    }

    /// Whether a placement agrees, given the number of rows of corners that it leaves beyond the
    /// side in an outward direction.
    pub fn allow(&self, corners_beyond: impl Fn(Node) -> i32) -> bool {
        let agrees =
            |(&outward, is_border): (&Node, bool)| !is_border || corners_beyond(outward) == 0;
        OUTWARD.iter().zip(self.0).all(agrees)
    }

    /// In how many directions the border is seen.
    pub fn count(&self) -> usize {
        self.0.iter().filter(|&&seen| seen).count()
    }
}

fn is_border(image: &GrayImage, grid: &FittedGrid, outward: Node) -> bool {
    let (low, high) = grid.extent();
    let edge_node = |k: i32| match outward {
        (-1, _) => (low.0, k),
        (1, _) => (high.0, k),
        (_, -1) => (k, low.1),
        _ => (k, high.1),
    };
    let (first, last) = if outward.0 == 0 {
        (low.0, high.0)
    } else {
        (low.1, high.1)
    };
    let profiles: Vec<Profile> = (first..last)
        .filter_map(|k| Profile::outward(image, grid, edge_node(k), edge_node(k + 1), outward))
        .collect();
    [1.0, -1.0]
        .into_iter()
        .any(|margin| ends_in_margin(&profiles, margin))
}

/// Whether the squares that are not of the margin's color end along one line, and those that are go on in it;
/// `margin` is 1 for a bright one, -1 for a dark frame.
fn ends_in_margin(profiles: &[Profile], margin: f64) -> bool {
    let (alike, other): (Vec<&Profile>, Vec<&Profile>) = profiles
        .iter()
        .partition(|profile| profile.bright == (margin > 0.0));
    if alike.len() < MIN_SQUARES || other.len() < MIN_SQUARES {
        return false;
    }
    let ends: Vec<f64> = other.iter().filter_map(|p| p.end(margin)).collect();
    let Some(end) = median(ends.iter().copied()) else {
        return false;
    };
    if margin < 0.0 && end < FRAME_FROM {
        return false;
    }
    let near_end = ends
        .iter()
        .filter(|e| (**e - end).abs() <= END_SPREAD / 2.0);
    let (from, until) = (end + SAMPLE_STEP, end + MARGIN_WIDTH);
    let go_on = alike
        .iter()
        .filter(|p| p.is_margin_between(margin, SQUARES_FROM, until));
    let become_margin = other
        .iter()
        .filter(|p| p.is_margin_between(margin, from + END_SPREAD / 2.0, until + END_SPREAD / 2.0));
    enough(near_end.count(), other.len())
        && enough(go_on.count(), alike.len())
        && enough(become_margin.count(), other.len())
}

fn enough(count: usize, of: usize) -> bool {
    count as f64 >= AGREEING * of as f64
}

/// Brightness across an outer square, outwards.
struct Profile {
    /// Whether the square is a bright one.
    bright: bool,
    /// Brightness every [`SAMPLE_STEP`] squares from the line of the outermost corners on.
    samples: Vec<f64>,
}

impl Profile {
    /// Along the line midway between two neighboring outermost corners; `None` if one of them or
    /// of the corners behind them is missing. It ends where the image ends.
    fn outward(
        image: &GrayImage,
        grid: &FittedGrid,
        a: Node,
        b: Node,
        outward: Node,
    ) -> Option<Self> {
        let inner = |node: Node| grid.corners.get(&(node.0 - outward.0, node.1 - outward.1));
        let (a_corner, b_corner) = (grid.corners.get(&a)?, grid.corners.get(&b)?);
        let (a_inner, b_inner) = (inner(a)?, inner(b)?);
        let middle = |p: f64, q: f64| f64::midpoint(p, q);
        let (u, v) = (
            middle(a_corner.pixel.u, b_corner.pixel.u),
            middle(a_corner.pixel.v, b_corner.pixel.v),
        );
        let (du, dv) = (
            u - middle(a_inner.pixel.u, b_inner.pixel.u),
            v - middle(a_inner.pixel.v, b_inner.pixel.v),
        );
        let mean = middle(a_corner.mean, b_corner.mean);
        let amplitude = middle(a_corner.amplitude.abs(), b_corner.amplitude.abs());
        let samples = (0..)
            .map(|k| f64::from(k) * SAMPLE_STEP)
            .take_while(|&d| d <= SQUARES_UNTIL + MARGIN_WIDTH + END_SPREAD)
            .map_while(|d| image.between(u + d * du, v + d * dv))
            .map(|value| (value - mean) / amplitude)
            .collect();
        Some(Self {
            bright: is_bright_outside(grid, a, b, outward),
            samples,
        })
    }

    fn between(&self, from: f64, until: f64) -> Option<&[f64]> {
        let index = |d: f64| (d / SAMPLE_STEP).round() as usize;
        self.samples.get(index(from)..=index(until))
    }

    fn is_margin_between(&self, margin: f64, from: f64, until: f64) -> bool {
        self.between(from, until)
            .is_some_and(|samples| samples.iter().all(|&s| margin * s >= CLEAR))
    }

    /// Where a square of the other color ends and the margin's begins, squares from the outermost corners.
    fn end(&self, margin: f64) -> Option<f64> {
        let start = (SQUARES_FROM / SAMPLE_STEP).round() as usize;
        let stop = (SQUARES_UNTIL / SAMPLE_STEP).round() as usize;
        let beginning = self.samples.get(start)?;
        let is_margin = |k: &usize| self.samples.get(*k).is_some_and(|&s| margin * s > 0.0);
        let end = (start..=stop).find(is_margin)?;
        (margin * beginning <= -CLEAR).then_some(end as f64 * SAMPLE_STEP)
    }
}

/// Whether the outer square between nodes a and b is a bright one.
fn is_bright_outside(grid: &FittedGrid, a: Node, b: Node, outward: Node) -> bool {
    let low = (a.0.min(b.0), a.1.min(b.1));
    // The square before node n in both directions has the color of the origin's if n is even.
    let square = match outward {
        (-1, _) | (_, -1) => (low.0 + 1 - outward.0.abs(), low.1 + 1 - outward.1.abs()),
        _ => (low.0 + 1, low.1 + 1),
    };
    let dark = grid.dark_before_origin ^ ((square.0 + square.1).rem_euclid(2) == 1);
    !dark
}
