//! The `ChArUco` board: a grid of corners, and the markers in its white squares say where it lies.
//!
//! Every connected part of the grid is placed by its own markers, so that a board may be covered in
//! part, and other boards may stand beside it. A part counts if its markers agree on one place.

use super::cells::Placed;
use super::charuco_parts::{Part, Votes};
use super::ends::print_ends;
use super::found::{Found, PrintedTarget};
use super::instead::{self, Stated};
use super::saddles::{self, Crossing, Crossings, Label};
use crate::dataset::image::GrayImage;
use crate::detect::chessboard::{SIZES, parts_at};
use crate::detect::corner_fit::FittedCorner;
use crate::detect::grid::Node;
use crate::detect::labelling::Placement;
use crate::detect::settings::DetectSettings;
use crate::detect::verdict::{Refusal, why_nothing_found};
use calib_rays::numerics::median;
use calib_rays::print::Charuco;
use nalgebra::Vector2;
use std::collections::{BTreeMap, BTreeSet};

/// The manifest's word for it.
const KIND: &str = "charuco";

/// Fewest corners of a part that is looked at.
const MIN_CORNERS: usize = 4;
/// Corners of a part that may lie off the board: so many, ...
const MAX_STRAYS: usize = 2;
/// ... and one in so many.
const CORNERS_PER_STRAY: usize = 50;

impl PrintedTarget for Charuco {
    fn find(&self, image: &GrayImage, settings: &DetectSettings) -> Result<Found, Refusal> {
        let mut best: Option<BTreeMap<Label, Vector2<f64>>> = None;
        for size in SIZES {
            let have = best.as_ref().map_or(0, BTreeMap::len);
            let count = self.rows * self.cols;
            // Twice the size helps only where most is missing.
            if 10 * have >= 9 * count || (size.is_enlarged() && 2 * have >= count) {
                break;
            }
            let parts: Vec<Part> = parts_at(image, size).iter().map(|p| Part::of(p)).collect();
            let rough = placed_parts(image, self, &parts);
            if rough.len() > have + have / 10 {
                best = Some(rough);
            }
        }
        let crossings = crossings(self);
        let fitted = best
            .and_then(|rough| saddles::fit(image, &crossings, &rough, settings.max_half_window_px));
        let other = || {
            instead::other(image, &Stated::charuco(self))
                .unwrap_or_else(|| why_nothing_found(image, KIND))
        };
        match fitted {
            Some(fitted) if fitted.len() >= MIN_CORNERS => {
                if ends_early(image, self, &crossings, &fitted) {
                    return Err(other());
                }
                Found::of_corners(image, &crossings, &fitted, self.square_mm)
                    .ok_or(Refusal::NoBoard { kind: KIND })
            }
            _ => Err(other()),
        }
    }
}

/// Where in an outer black square it is looked at, in squares from the line of corners before it: a margin may
/// begin half a square behind it.
const INTO_SQUARE: f64 = 0.25;

/// Whether the image shows white where the next row or column of black squares would be.
fn ends_early(
    image: &GrayImage,
    board: &Charuco,
    crossings: &Crossings,
    fitted: &BTreeMap<Label, FittedCorner>,
) -> bool {
    let pixels: BTreeMap<Label, Vector2<f64>> = fitted
        .iter()
        .map(|(&label, c)| (label, Vector2::new(c.pixel.u, c.pixel.v)))
        .collect();
    let (Some(map), Some(mean), Some(amplitude)) = (
        crossings.map(&pixels),
        median(fitted.values().map(|c| c.mean)),
        median(fitted.values().map(|c| c.amplitude.abs())),
    ) else {
        return false;
    };
    let labels: BTreeSet<Label> = fitted.keys().copied().collect();
    let bounds = |of: fn(&Label) -> usize| {
        let values = labels.iter().map(of);
        values.fold((usize::MAX, 0), |(low, high), k| (low.min(k), high.max(k)))
    };
    let ((top, bottom), (left, right)) = (bounds(|l| l.0), bounds(|l| l.1));
    print_ends((board.rows, board.cols), &labels, |(row, col)| {
        // The square beyond that corner, away from those found.
        let (down, along) = if row < top {
            ((row, -INTO_SQUARE), (col, 0.5))
        } else if row > bottom {
            ((row + 1, INTO_SQUARE), (col, 0.5))
        } else if col < left {
            ((row, 0.5), (col, -INTO_SQUARE))
        } else if col > right {
            ((row, 0.5), (col + 1, INTO_SQUARE))
        } else {
            return None;
        };
        let square_row = if row >= top && row <= bottom {
            row + 1
        } else {
            down.0
        };
        let square_col = if col >= left && col <= right {
            col + 1
        } else {
            along.0
        };
        if !board.is_black(square_row, square_col) {
            return None;
        }
        let at = Vector2::new(col as f64 + along.1, row as f64 + down.1) * board.square_mm;
        let pixel = map.at(&at);
        let value = image.between(pixel.x, pixel.y)?;
        Some(value > mean + 0.3 * amplitude)
    })
}

/// The board's corners, and the markers that are none of them.
fn crossings(board: &Charuco) -> Crossings {
    let s = board.square_mm;
    let margin = (s - board.marker_mm) / 2.0;
    let mut all = Vec::new();
    for row in 0..board.rows {
        for col in 0..board.cols {
            all.push(Crossing {
                label: (row, col),
                at: Vector2::new(col as f64 * s, row as f64 * s),
                dark_before: board.is_black(row, col),
            });
        }
    }
    let mut covers = Vec::new();
    for row in 0..=board.rows {
        for col in 0..=board.cols {
            if board.marker_in(row, col).is_some() {
                let (x, y) = ((col as f64 - 1.0) * s, (row as f64 - 1.0) * s);
                covers.push([x + margin, x + s - margin, y + margin, y + s - margin]);
            }
        }
    }
    Crossings {
        all,
        clear: margin.min(0.5 * s),
        reach: 0.5 * s,
        covers,
    }
}

/// How a board's markers lie in its squares.
pub fn placed(board: &Charuco) -> Placed {
    Placed::centered(board.marker_mm / board.square_mm, board.codes.side())
}

/// The rough corners of all parts that the markers place, by label.
fn placed_parts(
    image: &GrayImage,
    board: &Charuco,
    parts: &[Part],
) -> BTreeMap<Label, Vector2<f64>> {
    let mut placed_parts: Vec<(f64, BTreeMap<Label, Vector2<f64>>)> = parts
        .iter()
        .filter(|part| part.0.len() >= MIN_CORNERS)
        .filter_map(|part| {
            let cells = part.read_cells(image, placed(board));
            let votes = Votes::of(board, &cells);
            let placement = votes.agreed()?;
            let labelled: BTreeMap<Label, Vector2<f64>> = part
                .0
                .iter()
                .filter_map(|(&node, &pixel)| Some((label(&placement, board, node)?, pixel)))
                .collect();
            let off_board = part.0.len() - labelled.len();
            (off_board <= MAX_STRAYS + part.0.len() / CORNERS_PER_STRAY)
                .then_some((votes.agreeing, labelled))
        })
        .collect();
    // Where two parts claim one corner, there are two such boards: the one that shows more counts.
    placed_parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut corners = BTreeMap::new();
    for (_, part) in placed_parts {
        if part.keys().all(|label| !corners.contains_key(label)) {
            corners.extend(part);
        }
    }
    corners
}

fn label(placement: &Placement, board: &Charuco, node: Node) -> Option<Label> {
    let (x, y) = placement.place(node);
    let (row, col) = (usize::try_from(y).ok()?, usize::try_from(x).ok()?);
    (row < board.rows && col < board.cols).then_some((row, col))
}
