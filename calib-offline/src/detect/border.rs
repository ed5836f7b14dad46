//! What lies beyond the four sides of a grid: the board's border, more squares, or nobody knows.
//!
//! A part of a board can be placed on it only if something tells how far the board goes on. Beyond
//! the outermost corners lies one more row of squares. Behind it there is either the bright margin
//! of the board, or another row of squares in the opposite colors.

use super::grid::{FittedGrid, Node};
use crate::dataset::image::GrayImage;
use crate::geometry::PixelPoint;

/// What one side shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The board ends: the next squares are there, and behind them a bright margin.
    Border,
    /// The board goes on: at least one more row of corners exists.
    Continues,
    /// Cut off by the image, covered, or unclear.
    Unknown,
}

/// Outward directions of the four sides.
const OUTWARD: [Node; 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
/// Where the outer row of squares is sampled, squares beyond the outermost corners.
const OUTER_SQUARE: f64 = 0.5;
/// Where the margin or the next row of squares is sampled: a quarter of a square behind the edge,
/// because margins can be narrow.
const BEHIND_EDGE: f64 = 1.25;
/// Brightness from -1 (dark squares) to 1 (bright squares): beyond this it is clearly one of them.
const CLEAR: f64 = 0.5;
/// Part of the samples along a side that must agree.
const AGREEING: f64 = 0.8;
/// Samples along a side that are needed to judge it.
const MIN_SAMPLES: usize = 2;

/// The four sides of a grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Borders([Side; 4]);

impl Borders {
    /// Nothing is known about any side.
    pub const UNKNOWN: Self = Self([Side::Unknown; 4]);

    /// Looks at the image beyond each side of the grid.
    pub fn seen(image: &GrayImage, grid: &FittedGrid) -> Self {
        Self(OUTWARD.map(|outward| judge_side(image, grid, outward)))
    }

    /// Whether a placement agrees, given the number of rows of corners that it leaves beyond the
    /// side in an outward direction.
    pub fn allow(&self, corners_beyond: impl Fn(Node) -> i32) -> bool {
        OUTWARD.iter().zip(self.0).all(|(&outward, side)| match side {
            Side::Border => corners_beyond(outward) == 0,
            Side::Continues => corners_beyond(outward) > 0,
            Side::Unknown => true,
        })
    }

    /// Whether the board's border is seen on two opposite sides, along the first and along the
    /// second direction: there the grid's own size is the board's.
    pub fn closed(&self) -> (bool, bool) {
        let both = |a: usize, b: usize| self.0[a] == Side::Border && self.0[b] == Side::Border;
        (both(0, 1), both(2, 3))
    }
}

fn judge_side(image: &GrayImage, grid: &FittedGrid, outward: Node) -> Side {
    let (low, high) = grid.extent();
    let along: Node = (outward.1.abs(), outward.0.abs());
    let edge_node = |k: i32| match outward {
        (-1, _) => (low.0, k),
        (1, _) => (high.0, k),
        (_, -1) => (k, low.1),
        _ => (k, high.1),
    };
    let (first, last) = if along.0 == 1 {
        (low.0, high.0)
    } else {
        (low.1, high.1)
    };
    let mut behind = Vec::new();
    for k in first..last {
        let (a, b) = (edge_node(k), edge_node(k + 1));
        let Some((outer, beyond)) = sample_pair(image, grid, a, b, outward) else {
            continue;
        };
        // Brightness 1 is a square of the color expected in the outer row.
        if outer >= CLEAR {
            behind.push((beyond, is_bright_outside(grid, a, b, outward)));
        }
    }
    if behind.len() < MIN_SAMPLES {
        return Side::Unknown;
    }
    let part = |agrees: &dyn Fn(&(f64, bool)) -> bool| {
        behind.iter().filter(|s| agrees(s)).count() as f64 / behind.len() as f64
    };
    let alternates = part(&|&(beyond, outer_is_bright)| {
        let expected = if outer_is_bright { -1.0 } else { 1.0 };
        beyond * expected >= CLEAR
    });
    let bright = part(&|&(beyond, _)| beyond >= CLEAR);
    if alternates >= AGREEING {
        Side::Continues
    } else if bright >= AGREEING {
        Side::Border
    } else {
        Side::Unknown
    }
}

/// Whether the outer square between nodes a and b is a bright one.
fn is_bright_outside(grid: &FittedGrid, a: Node, b: Node, outward: Node) -> bool {
    // The square before node n in both directions has the color of the origin's if n is even.
    let low = (a.0.min(b.0), a.1.min(b.1));
    let square = match outward {
        (-1, _) | (_, -1) => (low.0 + 1 - outward.0.abs(), low.1 + 1 - outward.1.abs()),
        _ => (low.0 + 1, low.1 + 1),
    };
    let dark = grid.dark_before_origin ^ ((square.0 + square.1).rem_euclid(2) == 1);
    !dark
}

/// Brightness of the outer square between two corners (1: as expected of its color) and behind it
/// (1: bright, -1: dark).
fn sample_pair(
    image: &GrayImage,
    grid: &FittedGrid,
    a: Node,
    b: Node,
    outward: Node,
) -> Option<(f64, f64)> {
    let inward = (-outward.0, -outward.1);
    let ray = |node: Node| {
        let here = grid.corners.get(&node)?;
        let inner = grid.corners.get(&(node.0 + inward.0, node.1 + inward.1))?;
        Some((*here, inner.pixel))
    };
    let ((a_corner, a_inner), (b_corner, b_inner)) = (ray(a)?, ray(b)?);
    let amplitude = f64::midpoint(a_corner.amplitude.abs(), b_corner.amplitude.abs());
    let mean_level = f64::midpoint(a_corner.mean, b_corner.mean);
    let at = |distance: f64| {
        let out = |here: PixelPoint, inner: PixelPoint| {
            (
                here.u + distance * (here.u - inner.u),
                here.v + distance * (here.v - inner.v),
            )
        };
        let (p, q) = (out(a_corner.pixel, a_inner), out(b_corner.pixel, b_inner));
        let value = image.between(f64::midpoint(p.0, q.0), f64::midpoint(p.1, q.1))?;
        Some((value - mean_level) / amplitude)
    };
    let expected = if is_bright_outside(grid, a, b, outward) {
        1.0
    } else {
        -1.0
    };
    Some((at(OUTER_SQUARE)? * expected, at(BEHIND_EDGE)?))
}
