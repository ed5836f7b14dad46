//! What became of each image: used, or refused and why.

use super::border::Borders;
use super::grid::{FittedGrid, Typical};
use super::grid_size::GridSize;
use super::illegible::{EDGE_WIDTH_OF_BLUR, Illegible, Shown};
use super::labelling::Placement;
use super::ring_target::TargetRefusal;
use super::seen_board::{SeenBoard, SeenKind};
use crate::dataset::BoardKind;
use crate::dataset::image::GrayImage;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, SensorSize};
use std::collections::{BTreeMap, BTreeSet};
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
    /// The board's corners that were not found, if it is used.
    pub missing: Vec<MissingCorner>,
}

/// A corner of the board that was not found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MissingCorner {
    /// Row on the board.
    pub row: usize,
    /// Column on the board.
    pub col: usize,
    /// Where it must be for those that were found; `None` if that is outside the image, and on targets other than
    /// the chessboard, for which it is not predicted.
    pub pixel: Option<PixelPoint>,
}

impl MissingCorner {
    /// The board's corners that are not among those found (row, column), without their places.
    pub fn beside(found: impl Iterator<Item = (usize, usize)>, board: &BoardSpec) -> Vec<Self> {
        let found: BTreeSet<(usize, usize)> = found.collect();
        let all = (0..board.rows).flat_map(|row| (0..board.cols).map(move |col| (row, col)));
        all.filter(|label| !found.contains(label))
            .map(|(row, col)| Self {
                row,
                col,
                pixel: None,
            })
            .collect()
    }

    /// The board's corners that a placed grid lacks, by row and column.
    pub fn of(
        grid: &FittedGrid,
        placement: &Placement,
        board: &BoardSpec,
        sensor: SensorSize,
    ) -> Vec<Self> {
        let found = grid.corners.keys().map(|&node| placement.row_col(node));
        let mut missing = Self::beside(found, board);
        let predicted: BTreeMap<(usize, usize), PixelPoint> = grid
            .extended(board)
            .into_iter()
            .filter(|&(node, _)| placement.is_on_board(node, board))
            .map(|(node, pixel)| (placement.row_col(node), pixel))
            .collect();
        for corner in &mut missing {
            let pixel = predicted.get(&(corner.row, corner.col)).copied();
            corner.pixel = pixel.filter(|&pixel| sensor.contains(pixel));
        }
        missing
    }
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
    /// The image shows nothing clearly.
    #[error(transparent)]
    Illegible(#[from] Illegible),
    /// Nothing of the board.
    #[error(
        "no {} found: is the whole board in view, and lit evenly?",
        named(kind)
    )]
    NoBoard {
        /// The board's kind in the manifest.
        kind: &'static str,
    },
    /// A board of another size.
    #[error("the image shows {found} inner corners, the manifest says rows = {}, cols = {}: {}",
        stated.rows, stated.cols, found.hint(*stated))]
    WrongBoard {
        /// What is seen.
        found: GridSize,
        /// What the manifest says.
        stated: GridSize,
        /// Whether the image shows where that board ends, on all sides.
        is_whole: bool,
    },
    /// The target of rings.
    #[error(transparent)]
    Rings(#[from] TargetRefusal),
    /// Tags in one row or one column.
    #[error(
        "the {tags} tags in view lie in one row or one column, so that up and down are open: show more rows \
         and columns"
    )]
    TagsInLine {
        /// Tags in view.
        tags: usize,
    },
    /// Tags without the small squares at their corners.
    #[error(
        "{tags} tags are in view, and their corners are no crossings of edges: the grid needs its small black \
         squares between the tags, and spacing of [board] must be that of the print"
    )]
    TagsWithoutCorners {
        /// Tags in view.
        tags: usize,
    },
    /// Circles that could be any of several parts of the grid.
    #[error(
        "{circle_count} circles are in view, and they fit on the grid in {placement_count} ways: show the whole \
         grid, or give it marked circles (direction)"
    )]
    AmbiguousCircles {
        /// Circles in view.
        circle_count: usize,
        /// Ways to place them.
        placement_count: usize,
    },
    /// Dots that are not where they should be.
    #[error(
        "{marked} squares with a dot are in view, and not where the {stated} of marked = [[row, col], ...] are: count \
         squares from 0 at the board's upper left, with a black square there"
    )]
    OtherMarks {
        /// Squares with a dot.
        marked: usize,
        /// Marked squares in the manifest.
        stated: usize,
    },
    /// Another target than the one described.
    #[error("the image shows {seen}, the manifest describes {stated}: {}", seen.what_to_write())]
    OtherBoard {
        /// What is seen.
        seen: SeenBoard,
        /// What the manifest describes.
        stated: String,
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
    /// Whether it is because of a chessboard that is not the one described.
    pub(super) fn is_of_plain_chessboard(&self) -> bool {
        matches!(self, Self::OtherBoard { seen, .. }
            if matches!(&seen.kind, SeenKind::Chessboard { marked } if marked.is_empty()))
    }

    /// Whether it is because of a board of another size that is seen as a whole.
    pub fn is_of_a_whole_board(&self) -> bool {
        matches!(self, Self::WrongBoard { is_whole: true, .. })
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
    /// Standard deviation of a corner per axis, px, predicted from the residuals and the scatter.
    pub sigma_px: f64,
}

/// Squares blurred by more than this part of their side run into each other.
pub const MAX_BLUR_SQUARES: f64 = 0.25;
impl ImageFigures {
    /// What of the image keeps a board that was found in part from being found as a whole.
    pub fn illegible(&self) -> Option<Illegible> {
        Illegible::of_board(self.square_px, self.contrast_percent, self.residual_percent)
    }

    /// The figures of a grid; `None` if it has no corners.
    pub fn of(image: &GrayImage, grid: &FittedGrid) -> Option<Self> {
        let Typical {
            amplitude,
            blur_px,
            residual_rms,
            ..
        } = grid.typical()?;
        Some(Self {
            corner_count: grid.corners.len(),
            contrast_percent: 200.0 * amplitude / f64::from(image.white_level),
            edge_px: EDGE_WIDTH_OF_BLUR * blur_px,
            square_px: grid.square_px()?,
            residual_percent: 50.0 * residual_rms / amplitude,
            sigma_px: grid.typical_sigma_px(0.0)?,
        })
    }
}

/// Why nothing was found in an image that could be read.
pub fn why_nothing_found(image: &GrayImage, kind: &'static str) -> Refusal {
    Illegible::of(image, Shown::Board).map_or(Refusal::NoBoard { kind }, Refusal::from)
}

/// A board of a kind, in words.
fn named(kind: &str) -> String {
    if kind == BoardKind::Chessboard.word() {
        kind.to_owned()
    } else {
        format!("board of kind \"{kind}\"")
    }
}

/// The grid, with the borders seen around it, is no part of the board.
pub fn why_not_placed(grid: &FittedGrid, board: &BoardSpec, borders: &Borders) -> Refusal {
    let size = grid.size();
    Refusal::WrongBoard {
        found: GridSize::seen(size),
        stated: GridSize::stated(board),
        is_whole: borders.count() == 4 && grid.corners.len() == size.0 * size.1,
    }
}
