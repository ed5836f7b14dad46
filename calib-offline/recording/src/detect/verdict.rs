//! What became of each image: used, or refused and why.

use super::grid::{FittedGrid, Typical};
use crate::dataset::image::GrayImage;
use calib_rays::board::BoardSpec;
use std::path::PathBuf;

/// The verdict on one image.
#[derive(Debug)]
pub struct ImageVerdict {
    /// Index into the dataset's cameras.
    pub camera_idx: usize,
    /// Number of the pose.
    pub pose: usize,
    /// The file.
    pub path: PathBuf,
    /// What became of it.
    pub outcome: Outcome,
    /// What was measured, if a board was found.
    pub figures: Option<ImageFigures>,
}

/// What became of an image.
#[derive(Debug)]
pub enum Outcome {
    /// Its corners are used.
    Used {
        /// Corners found.
        corner_count: usize,
        /// Whether that is less than the whole board.
        partial: bool,
        /// Quarter turns (clockwise on screen) from the numbering that has its rows nearest to
        /// horizontal to the one used.
        quarter_turns: u8,
    },
    /// It is not used.
    Refused(Refusal),
}

/// Why an image is not used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// Bright and dark differ by too little.
    #[error(
        "too little contrast: bright and dark differ by {contrast_percent:.1} % of the range; \
         expose longer or light the board better"
    )]
    LowContrast {
        /// Difference of the 99.5 % and the 0.5 % quantile, percent of the white level.
        contrast_percent: f64,
    },
    /// The board's edges, or the steepest of the image if there is no board, are too wide.
    #[error(
        "blurred: the edges are about {edge_px:.0} px wide; focus the lens, and let the board stand \
         still"
    )]
    Blurred {
        /// Width of the edges from 10 % to 90 %, px.
        edge_px: f64,
    },
    /// No grid of corners.
    #[error("no chessboard found: is the whole board in view, and lit evenly?")]
    NoBoard,
    /// A board of another size.
    #[error(
        "the image shows {found_rows} x {found_cols} inner corners, the manifest says rows = {rows}, \
         cols = {cols}: {}", wrong_size_hint((*found_rows, *found_cols), (*rows, *cols))
    )]
    WrongBoard {
        /// Inner corners found along the shorter direction.
        found_rows: usize,
        /// Inner corners found along the longer direction.
        found_cols: usize,
        /// Rows in the manifest.
        rows: usize,
        /// Columns in the manifest.
        cols: usize,
    },
    /// A part of the board that could be any of several parts.
    #[error(
        "only {found_rows} x {found_cols} of the board's inner corners are in view, and they fit on \
         it in {placement_count} ways; show the board's border (its white margin) on one side of each \
         direction, or a neighboring pose with the whole board"
    )]
    AmbiguousPlacement {
        /// Corners found along the first direction.
        found_rows: usize,
        /// Corners found along the second direction.
        found_cols: usize,
        /// Ways to place them.
        placement_count: usize,
    },
    /// The corners agree with no place on the board that has the colors it should have.
    #[error(
        "the squares have the opposite colors of those in the other images: is it the same board, \
         and is the image mirrored or inverted?"
    )]
    WrongColors,
}

impl Refusal {
    /// The board is there, but blurred by a standard deviation of so many pixels.
    pub fn too_blurred(blur_px: f64) -> Self {
        Self::Blurred {
            edge_px: EDGE_WIDTH_OF_BLUR * blur_px,
        }
    }
}

/// What to do about a board of another size; sizes are (rows, cols).
fn wrong_size_hint(found: (usize, usize), stated: (usize, usize)) -> String {
    let sorted = |(a, b): (usize, usize)| (a.min(b), a.max(b));
    let (found, stated_sorted) = (sorted(found), sorted(stated));
    if stated_sorted == (found.0 + 1, found.1 + 1) {
        format!(
            "rows and cols count inner corners, not squares; a board of {} x {} squares has rows = {}, \
             cols = {}",
            stated.0,
            stated.1,
            stated.0 - 1,
            stated.1 - 1
        )
    } else {
        format!(
            "if this is the right board, write rows = {}, cols = {} (inner corners, not squares)",
            found.0, found.1
        )
    }
}

/// What was measured in an image with a board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageFigures {
    /// Corners found, whether or not they could be labelled.
    pub corner_count: usize,
    /// Difference of bright and dark squares, percent of the white level.
    pub contrast_percent: f64,
    /// Width of the squares' edges from 10 % to 90 %, px.
    pub edge_px: f64,
    /// Shorter side of a square, px.
    pub square_px: f64,
    /// RMS residual of the corner fits, percent of the contrast.
    pub residual_percent: f64,
    /// Standard deviation of a corner per axis, px, predicted from the residuals.
    pub sigma_px: f64,
}

/// An edge blurred by a Gaussian takes this many standard deviations from 10 % to 90 %.
pub(super) const EDGE_WIDTH_OF_BLUR: f64 = 2.563;
/// Less contrast than this part of the range is refused: with 8 bits, 10 code values.
const MIN_CONTRAST_PERCENT: f64 = 4.0;
/// Squares blurred by more than this part of their side run into each other.
pub const MAX_BLUR_SQUARES: f64 = 0.25;
/// Without a board, edges at least this wide are called blurred, px.
const BLURRED_EDGE_PX: f64 = 8.0;

impl ImageFigures {
    /// The figures of a grid; `None` if it has no corners.
    pub fn of(image: &GrayImage, grid: &FittedGrid) -> Option<Self> {
        let Typical {
            amplitude,
            blur_px,
            residual_rms,
            sigma_px,
        } = grid.typical()?;
        Some(Self {
            corner_count: grid.corners.len(),
            contrast_percent: 200.0 * amplitude / f64::from(image.white_level),
            edge_px: EDGE_WIDTH_OF_BLUR * blur_px,
            square_px: grid.square_px()?,
            residual_percent: 50.0 * residual_rms / amplitude,
            sigma_px,
        })
    }
}

/// Why nothing was found in an image that could be read.
pub fn why_nothing_found(image: &GrayImage) -> Refusal {
    let [dark, bright] = image.quantiles([0.005, 0.995]);
    let contrast = f64::from(bright - dark);
    let contrast_percent = 100.0 * contrast / f64::from(image.white_level);
    if contrast_percent < MIN_CONTRAST_PERCENT {
        return Refusal::LowContrast { contrast_percent };
    }
    let steepest = steepest_slope(image);
    // A step blurred by a Gaussian has the slope contrast / (sigma sqrt(2 pi)).
    let blur_px = contrast / (steepest * std::f64::consts::TAU.sqrt());
    if EDGE_WIDTH_OF_BLUR * blur_px > BLURRED_EDGE_PX {
        return Refusal::too_blurred(blur_px);
    }
    Refusal::NoBoard
}

/// The grid, with the borders seen around it, is no part of the board.
pub fn why_not_placed(grid: &FittedGrid, board: &BoardSpec) -> Refusal {
    let (a, b) = grid.size();
    Refusal::WrongBoard {
        found_rows: a.min(b),
        found_cols: a.max(b),
        rows: board.rows,
        cols: board.cols,
    }
}

/// The slope that 0.5 % of the pixels exceed, code values per pixel (central differences).
fn steepest_slope(image: &GrayImage) -> f64 {
    let (width, height) = (
        i64::from(image.sensor.width),
        i64::from(image.sensor.height),
    );
    let mut slopes = Vec::new();
    for v in 1..height - 1 {
        for u in 1..width - 1 {
            let at = |u, v| image.at(u, v).map_or(0.0, f64::from);
            let (du, dv) = (at(u + 1, v) - at(u - 1, v), at(u, v + 1) - at(u, v - 1));
            slopes.push(du.hypot(dv) / 2.0);
        }
    }
    slopes.sort_unstable_by(f64::total_cmp);
    let k = (slopes.len() as f64 * 0.995) as usize;
    slopes
        .get(k.min(slopes.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
        .max(f64::MIN_POSITIVE)
}
