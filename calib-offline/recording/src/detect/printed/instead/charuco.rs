//! `ChArUco` boards that an image shows instead.

use super::Stated;
use super::corners::{is_in_view, without_strays};
use crate::dataset::image::GrayImage;
use crate::detect::chessboard::RawCorner;
use crate::detect::labelling::Placement;
use crate::detect::printed::cells::Placed;
use crate::detect::printed::charuco_parts::{Part, ReadCell, Votes, exact_markers};
use crate::detect::printed::saddles::{self, Crossing, Crossings};
use crate::detect::seen_board::{SeenBoard, SeenKind};
use crate::detect::settings::DetectSettings;
use calib_rays::print::{Charuco, Codes};
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Markers that must be of one dictionary.
const MIN_MARKERS: usize = 4;
/// Markers' sides that are tried, as a part of the squares'.
const MARKER_SIDES: [f64; 5] = [0.75, 0.7, 0.8, 0.6, 0.5];
/// Part of the markers that must agree on a board.
const AGREEING: f64 = 0.8;
/// Part of the corners that must lie on it.
const ON_BOARD: f64 = 0.95;
/// Rows and columns beyond the corners found in which more are looked for.
const BEYOND: i32 = 2;

/// The board with markers that corners belong to.
pub fn seen(image: &GrayImage, raw: &[RawCorner], stated: &Stated) -> Option<SeenBoard> {
    let part = without_strays(Part::of(raw));
    let sides = stated.marker_part.into_iter().chain(MARKER_SIDES);
    let (side, codes, cells) = sides
        .into_iter()
        .find_map(|side| markers(image, &part, side))?;
    let part = without_strays(completed(image, part, side, &cells, &codes));
    let cells = part.read_cells(image, Placed::centered(side, codes.side()));
    let dictionary = codes.name();
    Some(match fitting_board(&part, &codes, &cells, side, stated) {
        Some(board) => SeenBoard {
            kind: SeenKind::Charuco {
                dictionary,
                legacy: board.legacy,
                first_id: board.first_id,
            },
            rows: board.rows,
            cols: board.cols,
            is_whole: is_in_view(image, &part),
        },
        None => SeenBoard {
            kind: SeenKind::Markers {
                dictionary,
                count: exact_markers(&cells, &codes).len(),
            },
            rows: 0,
            cols: 0,
            is_whole: false,
        },
    })
}

type Markers = (f64, Codes, Vec<ReadCell>);

/// The smallest dictionary that has most of the markers, if it has enough of them.
fn markers(image: &GrayImage, part: &Part, marker_part: f64) -> Option<Markers> {
    let mut best: Option<(usize, Markers)> = None;
    for side in 4..=7 {
        let cells = part.read_cells(image, Placed::centered(marker_part, side));
        if cells.len() < MIN_MARKERS {
            continue;
        }
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

/// The board as large as the part, or as the one stated, on which the markers agree.
fn fitting_board(
    part: &Part,
    codes: &Codes,
    cells: &[ReadCell],
    marker_part: f64,
    stated: &Stated,
) -> Option<Charuco> {
    let (low, high) = part.extent();
    let (w, h) = ((high.0 - low.0 + 1) as usize, (high.1 - low.1 + 1) as usize);
    let ids = exact_markers(cells, codes);
    let least = ids.iter().copied().min()?;
    let (rows, cols) = stated.size();
    let sizes = [(h, w), (w, h), (rows, cols), (cols, rows)];
    sizes
        .into_iter()
        .flat_map(|size| [false, true].map(|legacy| (size, legacy)))
        .map(|((rows, cols), legacy)| Charuco {
            rows,
            cols,
            square_mm: 1.0,
            marker_mm: marker_part,
            codes: *codes,
            legacy,
            first_id: 0,
        })
        .flat_map(|board| {
            let counted = first_id(&board, part, cells);
            let firsts = [counted, Some(stated.first_id()), Some(least)];
            let with = move |first_id| Charuco { first_id, ..board };
            firsts.into_iter().flatten().map(with)
        })
        .find(|board| {
            let votes = Votes::of(board, cells);
            let Some(placement) = votes.agreed() else {
                return false;
            };
            let is_on_board = |node: &(i32, i32)| {
                let (x, y) = placement.place(*node);
                (0..board.cols as i32).contains(&x) && (0..board.rows as i32).contains(&y)
            };
            let on_board = part.0.keys().filter(|node| is_on_board(node)).count();
            votes.agreeing >= AGREEING * ids.len() as f64
                && on_board as f64 >= ON_BOARD * part.0.len() as f64
        })
}

/// The number that most markers say the first one has, if the part is the whole board.
fn first_id(board: &Charuco, part: &Part, cells: &[ReadCell]) -> Option<usize> {
    let (low, high) = part.extent();
    let mut votes: BTreeMap<usize, usize> = BTreeMap::new();
    for quarter_turns in 0..4u8 {
        let turned = Placement {
            quarter_turns,
            col_shift: 0,
            row_shift: 0,
        };
        let (a, b) = (turned.place(low), turned.place(high));
        let size = (
            a.1.abs_diff(b.1) as usize + 1,
            a.0.abs_diff(b.0) as usize + 1,
        );
        if size != (board.rows, board.cols) {
            continue;
        }
        let placement = Placement {
            col_shift: -a.0.min(b.0),
            row_shift: -a.1.min(b.1),
            ..turned
        };
        for cell in cells {
            let all = 0..board.codes.count();
            let code = board.codes.nearest(cell.cells, all, 0);
            let Some(code) = code.filter(|code| code.quarter_turns == quarter_turns) else {
                continue;
            };
            let (i, j) = cell.cell;
            let (a, b) = (placement.place((i, j)), placement.place((i + 1, j + 1)));
            let square = usize::try_from(a.1.min(b.1) + 1)
                .ok()
                .zip(usize::try_from(a.0.min(b.0) + 1).ok());
            let before = square.and_then(|(row, col)| board.marker_in(row, col));
            if let Some(first) = before.and_then(|before| code.id.checked_sub(before)) {
                *votes.entry(first).or_default() += 1;
            }
        }
    }
    let most = votes.into_iter().max_by_key(|(_, count)| *count)?;
    Some(most.0)
}

/// The part with the corners around it that the search missed; what lies beyond the board is none. `cells` have the
/// markers, which lie in white squares.
fn completed(
    image: &GrayImage,
    part: Part,
    marker_part: f64,
    cells: &[ReadCell],
    codes: &Codes,
) -> Part {
    let is_even = |(i, j): (i32, i32)| (i + j).rem_euclid(2) == 0;
    let all = 0..codes.count();
    let exact = cells
        .iter()
        .filter(|cell| codes.nearest(cell.cells, all.clone(), 0).is_some());
    let (even, odd): (Vec<bool>, Vec<bool>) =
        exact.map(|cell| is_even(cell.cell)).partition(|even| *even);
    let white_is_even = even.len() > odd.len();
    let (low, high) = part.extent();
    // Nodes as labels: rows and columns from the first beyond.
    let (first_col, first_row) = (low.0 - BEYOND, low.1 - BEYOND);
    let label = |(i, j): (i32, i32)| ((j - first_row) as usize, (i - first_col) as usize);
    let margin = (1.0 - marker_part) / 2.0;
    let (mut corners, mut covers) = (Vec::new(), Vec::new());
    for j in first_row..=high.1 + BEYOND {
        for i in first_col..=high.0 + BEYOND {
            let (row, col) = label((i, j));
            let (x, y) = (col as f64, row as f64);
            corners.push(Crossing {
                label: (row, col),
                at: Vector2::new(x, y),
                dark_before: is_even((i - 1, j - 1)) != white_is_even,
            });
            if is_even((i, j)) == white_is_even {
                covers.push([x + margin, x + 1.0 - margin, y + margin, y + 1.0 - margin]);
            }
        }
    }
    let crossings = Crossings {
        all: corners,
        clear: margin,
        reach: 0.5,
        covers,
    };
    let rough = part
        .0
        .iter()
        .map(|(&node, &at)| (label(node), at))
        .collect();
    let half_window_px = DetectSettings::default().max_half_window_px;
    match saddles::fit(image, &crossings, &rough, half_window_px) {
        Some(fitted) if 2 * fitted.len() > part.0.len() => Part(
            fitted
                .into_iter()
                .map(|((row, col), corner)| {
                    let node = (col as i32 + first_col, row as i32 + first_row);
                    (node, Vector2::new(corner.pixel.u, corner.pixel.v))
                })
                .collect(),
        ),
        _ => part,
    }
}
