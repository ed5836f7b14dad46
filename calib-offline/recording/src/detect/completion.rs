//! The corners that the detector missed: predicted by their neighbors, and fitted where the image has them.

use super::corner_fit::{CornerGuess, FittedCorner, fit_corner};
use super::grid::{CLEAR_AMPLITUDE_OF_MEDIAN, FittedGrid, NARROW, is_board_corner};
use super::lattice::{
    NEIGHBORS, Node, fits_board, missing_neighbors, plus, predicted, shorter_side,
};
use crate::dataset::image::GrayImage;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector2;
use std::collections::{BTreeMap, BTreeSet};

/// An undetected corner must lie this near to where its neighbors predict it, squares.
const MAX_MISS_SQUARES: f64 = 0.12;
/// One that is clearly a corner may lie farther away: near the rim of a fisheye, predictions are off ...
const MAX_CLEAR_MISS_SQUARES: f64 = 0.3;
/// ... and clear means residuals of this part of the amplitude at most.
const CLEAR_RESIDUAL_OF_AMPLITUDE: f64 = 0.3;
/// So far an image must reach into the squares around an undetected corner, squares.
const REACH_SQUARES: f64 = 0.2;
/// Towards the rim of a fisheye every step is shorter than the one before, by more than two or three of them tell: so
/// much of the extrapolated step, and so much of the window around it, are tried in this order. All but the first must
/// fit as well as the other corners do.
const TRIED: [(f64, f64); 4] = [(1.0, 1.0), (1.0, NARROW), (0.8, 0.8), (0.6, 0.8)];

/// Blur that a second trial starts from, squares: as far as predictions are off, about.
const FELT_SQUARES: f64 = 0.08;

/// Fits the corners that the neighbors predict and the detector missed, as far as the board
/// reaches, until no more are found.
pub(super) fn complete(
    grid: &mut FittedGrid,
    image: &GrayImage,
    board: &BoardSpec,
    max_half_window_px: f64,
) {
    let mut tried = BTreeSet::new();
    loop {
        let pixels = grid.pixels();
        let mut added = false;
        for node in missing_neighbors(&pixels, board) {
            // The same neighbors would predict the same window again.
            if !tried.insert((node, known_around(&pixels, node))) {
                continue;
            }
            let Some(corner) = fit_missing(grid, image, &pixels, node, max_half_window_px) else {
                continue;
            };
            let mut nodes: Vec<Node> = grid.corners.keys().copied().collect();
            nodes.push(node);
            if fits_board(&nodes, board) {
                grid.corners.insert(node, corner);
                added = true;
            }
        }
        if !added {
            return;
        }
    }
}

/// How many of the corners that predict a node are known.
fn known_around(pixels: &BTreeMap<Node, PixelPoint>, node: Node) -> usize {
    let places = NEIGHBORS
        .iter()
        .flat_map(|&step| (1..=3).map(move |times| plus(node, step, times)));
    places.filter(|place| pixels.contains_key(place)).count()
}

/// The best of the fits that are a corner of the board; the first that is as good as the others.
fn fit_missing(
    grid: &FittedGrid,
    image: &GrayImage,
    pixels: &BTreeMap<Node, PixelPoint>,
    node: Node,
    max_half_window_px: f64,
) -> Option<FittedCorner> {
    let typical = grid.typical()?;
    let mut first = None;
    for (trial, (step, window)) in TRIED.into_iter().enumerate() {
        let (pixel, px_from_square) = predicted(pixels, node, step)?;
        let around = CornerGuess {
            pixel,
            px_from_square,
            blur_px: typical.lens_blur_px().min(2.0 * CornerGuess::BLUR_PX),
        };
        if !shows_four_squares(image, &around) {
            continue;
        }
        // From a sharp start an edge some pixels away is not felt.
        let felt_px = if trial > 0 {
            FELT_SQUARES * shorter_side(&px_from_square)
        } else {
            0.0
        };
        let guess = CornerGuess {
            px_from_square: window * px_from_square,
            blur_px: around.blur_px.max(felt_px),
            ..around
        };
        let Some(corner) = fit_corner(image, &guess, max_half_window_px) else {
            continue;
        };
        let is_clear = corner.amplitude.abs() >= CLEAR_AMPLITUDE_OF_MEDIAN * typical.amplitude
            && corner.residual_rms <= CLEAR_RESIDUAL_OF_AMPLITUDE * corner.amplitude.abs();
        let miss_squares = if is_clear {
            MAX_CLEAR_MISS_SQUARES
        } else {
            MAX_MISS_SQUARES
        };
        let near = corner.moved_px <= miss_squares * shorter_side(&px_from_square);
        let as_sharp = corner.blur_px <= 2.0 * typical.blur_px + 0.5;
        let genuine = is_board_corner(node, &corner, grid.dark_before_origin, typical.amplitude);
        if !(near && as_sharp && genuine) {
            continue;
        }
        if !typical.is_disturbed(&corner) && (trial == 0 || is_clear) {
            return Some(corner);
        }
        if trial == 0 {
            first = Some(corner);
        }
    }
    first
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::chessboard::RawCorner;
    use calib_rays::geometry::SensorSize;

    /// Columns of squares of which each is 0.7 of the one before, as towards the rim of a fisheye.
    const FIRST: f64 = 60.0;
    const SHRINK: f64 = 0.7;

    fn column_px(col: f64) -> f64 {
        80.0 + FIRST * (1.0 - SHRINK.powf(col)) / (1.0 - SHRINK)
    }

    #[test]
    fn steps_that_shrink_faster_than_two_columns_tell_are_followed() {
        let board = BoardSpec::chessboard(4, 5, 10.0);
        let square = |u: f64, v: f64| {
            let left = 1.0 - (u - 80.0) * (1.0 - SHRINK) / FIRST;
            let (x, y) = (left.max(1e-9).ln() / SHRINK.ln(), (v - 60.0) / 40.0);
            let on_board = (-1.0..5.0).contains(&x) && (-1.0..4.0).contains(&y);
            if on_board && (x.floor() + y.floor()).rem_euclid(2.0) == 0.0 {
                30.0
            } else {
                220.0
            }
        };
        let (width, height) = (300, 240);
        let sub = |k: u32| f64::from(k) / 8.0 - 0.4375;
        let values = (0..width * height).map(|i| {
            let (u, v) = (f64::from(i % width), f64::from(i / width));
            let sum: f64 = (0..64)
                .map(|k| square(u + sub(k % 8), v + sub(k / 8)))
                .sum();
            (sum / 64.0) as f32
        });
        let sensor = SensorSize::new(width, height);
        let image = GrayImage::from_values(sensor, values.collect(), 255.0).unwrap();
        let at =
            |(i, j): Node| PixelPoint::new(column_px(f64::from(i)), 60.0 + 40.0 * f64::from(j));
        let raw: Vec<RawCorner> = (0..8)
            .map(|k| (k % 2, k / 2))
            .map(|(i, j)| RawCorner {
                i,
                j,
                pixel: at((i, j)),
            })
            .collect();
        let grid = FittedGrid::from_raw(&image, &raw, &board, 20.0).unwrap();
        assert_eq!(grid.corners.len(), 20);
        for (&node, corner) in &grid.corners {
            // Places on an eighth of a pixel.
            let off_px = corner.pixel.distance_px(at(node));
            assert!(off_px < 0.1, "{node:?}: {off_px}");
        }
    }
}
