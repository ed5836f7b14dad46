//! The `ChArUco` board: a grid of corners, and the markers in its white squares say where it lies.
//!
//! Every connected part of the grid is placed by its own markers, so that a board may be covered in
//! part, and other boards may stand beside it. A part counts if its markers agree on one place.

use super::cells::Placed;
use super::charuco_parts::{Part, Votes};
use super::found::{Found, PrintedTarget};
use super::saddles::{self, Crossing, Crossings, Label};
use crate::dataset::image::GrayImage;
use crate::detect::chessboard::{SIZES, parts_at};
use crate::detect::grid::Node;
use crate::detect::labelling::Placement;
use crate::detect::settings::DetectSettings;
use crate::detect::verdict::{Refusal, why_nothing_found};
use calib_rays::print::Charuco;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Fewest corners of a part that is looked at.
const MIN_CORNERS: usize = 4;

impl PrintedTarget for Charuco {
    fn find(&self, image: &GrayImage, settings: &DetectSettings) -> Result<Found, Refusal> {
        let mut best: Option<BTreeMap<Label, Vector2<f64>>> = None;
        let mut seen: Vec<Part> = Vec::new();
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
            seen.extend(parts);
        }
        let crossings = crossings(self);
        let fitted = best
            .and_then(|rough| saddles::fit(image, &crossings, &rough, settings.max_half_window_px));
        match fitted {
            Some(fitted) if fitted.len() >= MIN_CORNERS => {
                Found::of_corners(image, &crossings, &fitted, self.square_mm)
                    .ok_or(Refusal::NoBoard)
            }
            _ => {
                let largest = seen.iter().max_by_key(|part| part.0.len());
                Err(largest
                    .and_then(|part| super::charuco_seen::what(image, part, self))
                    .unwrap_or_else(|| why_nothing_found(image)))
            }
        }
    }
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
            let labelled = part
                .0
                .iter()
                .filter_map(|(&node, &pixel)| Some((label(&placement, board, node)?, pixel)))
                .collect();
            Some((votes.agreeing, labelled))
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
