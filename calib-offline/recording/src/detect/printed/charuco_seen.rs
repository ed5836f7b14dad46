//! What board an image shows instead of the one that is described.

use super::cells::Placed;
use super::charuco_parts::{Part, ReadCell, Votes, exact_markers};
use crate::dataset::image::GrayImage;
use crate::detect::chessboard::RawCorner;
use crate::detect::seen_board::SeenBoard;
use crate::detect::verdict::Refusal;
use calib_rays::board::BoardSpec;
use calib_rays::print::{Charuco, Codes};

/// Markers that must be of one dictionary.
const MIN_MARKERS: usize = 4;
/// Markers' sides that are tried, as a part of the squares'.
const MARKER_SIDES: [f64; 5] = [0.75, 0.7, 0.8, 0.6, 0.5];

/// The board that a part shows instead of the one described, if the markers leave no doubt.
pub fn what(image: &GrayImage, part: &Part, stated: &Charuco) -> Option<Refusal> {
    let (low, high) = part.extent();
    let size = ((high.1 - low.1 + 1) as usize, (high.0 - low.0 + 1) as usize);
    let stated_part = stated.marker_mm / stated.square_mm;
    let sides = std::iter::once(stated_part).chain(MARKER_SIDES);
    let found = sides.into_iter().find_map(|side| seen(image, part, side));
    match found {
        Some((marker_part, codes, cells)) => {
            let fits = fitting_board(part, &codes, &cells, marker_part, stated);
            Some(Refusal::OtherBoard {
                stated: described(stated),
                seen: seen_board(fits, &codes, &cells),
            })
        }
        None if size.0.min(size.1) >= 3 && part.0.len() * 2 > size.0 * size.1 => {
            Some(Refusal::OtherBoard {
                stated: described(stated),
                seen: SeenBoard::Chessboard {
                    rows: size.0.min(size.1),
                    cols: size.0.max(size.1),
                },
            })
        }
        None => None,
    }
}

/// The board with markers that corners belong to, where a chessboard is described.
pub fn instead_of_chessboard(
    image: &GrayImage,
    raw: &[RawCorner],
    board: &BoardSpec,
) -> Option<Refusal> {
    let part = Part::of(raw);
    let (side, codes, cells) = MARKER_SIDES
        .into_iter()
        .find_map(|side| seen(image, &part, side))?;
    let size = Charuco {
        rows: board.rows,
        cols: board.cols,
        square_mm: 1.0,
        marker_mm: side,
        codes,
        legacy: false,
        first_id: 0,
    };
    Some(Refusal::OtherBoard {
        stated: format!(
            "a chessboard of {} x {} inner corners",
            board.rows, board.cols
        ),
        seen: seen_board(
            fitting_board(&part, &codes, &cells, side, &size),
            &codes,
            &cells,
        ),
    })
}

fn seen_board(board: Option<Charuco>, codes: &Codes, cells: &[ReadCell]) -> SeenBoard {
    let dictionary = codes.name();
    match board {
        Some(board) => SeenBoard::Charuco {
            rows: board.rows,
            cols: board.cols,
            dictionary,
            legacy: board.legacy,
            first_id: board.first_id,
        },
        None => SeenBoard::Markers {
            dictionary,
            count: exact_markers(cells, codes).len(),
        },
    }
}

fn described(board: &Charuco) -> String {
    let legacy = if board.legacy { ", legacy = true" } else { "" };
    format!(
        "a ChArUco board of {} x {} inner corners with {}{legacy}",
        board.rows,
        board.cols,
        board.codes.name()
    )
}

type Seen = (f64, Codes, Vec<ReadCell>);

/// The smallest dictionary that has most of the markers, if it has enough of them.
fn seen(image: &GrayImage, part: &Part, marker_part: f64) -> Option<Seen> {
    let mut best: Option<(usize, Seen)> = None;
    for side in 4..=7 {
        let cells = part.read_cells(image, Placed::centered(marker_part, side));
        for codes in Codes::names().iter().filter_map(|name| Codes::named(name)) {
            if codes.side() != side {
                continue;
            }
            let mut ids = exact_markers(&cells, &codes);
            ids.sort_unstable();
            ids.dedup();
            let better = best.as_ref().is_none_or(|(count, (_, other, _))| {
                ids.len() > *count || (ids.len() == *count && codes.count() < other.count())
            });
            if ids.len() >= MIN_MARKERS && better {
                best = Some((ids.len(), (marker_part, codes, cells.clone())));
            }
        }
    }
    best.map(|(_, seen)| seen)
}

/// The board as large as the part on which the markers agree.
fn fitting_board(
    part: &Part,
    codes: &Codes,
    cells: &[ReadCell],
    marker_part: f64,
    stated: &Charuco,
) -> Option<Charuco> {
    let (low, high) = part.extent();
    let (w, h) = ((high.0 - low.0 + 1) as usize, (high.1 - low.1 + 1) as usize);
    let least = exact_markers(cells, codes).into_iter().min()?;
    let sizes = [
        (stated.rows, stated.cols),
        (stated.cols, stated.rows),
        (h, w),
        (w, h),
    ];
    sizes
        .into_iter()
        .flat_map(|size| [false, true].map(|legacy| (size, legacy)))
        .flat_map(|of| [stated.first_id, least].map(|first_id| (of, first_id)))
        .find_map(|(((rows, cols), legacy), first_id)| {
            let board = Charuco {
                rows,
                cols,
                square_mm: 1.0,
                marker_mm: marker_part,
                codes: *codes,
                legacy,
                first_id,
            };
            let votes = Votes::of(&board, cells);
            let all = exact_markers(cells, codes).len() as f64;
            (votes.agreed().is_some() && votes.agreeing >= 0.8 * all).then_some(board)
        })
}
