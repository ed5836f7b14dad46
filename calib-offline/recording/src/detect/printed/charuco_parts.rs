//! Connected parts of a `ChArUco` board's corners, and what the markers in their cells say of their place.

use super::cells::{Placed, read};
use crate::dataset::image::GrayImage;
use crate::detect::chessboard::RawCorner;
use crate::detect::grid::Node;
use crate::detect::homography::Homography;
use crate::detect::labelling::Placement;
use calib_rays::print::{Charuco, Codes};
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Markers that must agree on a place; a marker with a wrong cell counts half.
const MIN_AGREEING: f64 = 2.0;
/// So many must agree for each without a wrong cell that does not: a first number off by one leaves one in every row.
const AGREEING_PER_CONTRADICTION: f64 = 8.0;

/// A marker read in a cell of a part: the cell's node nearest to the origin, and what was read.
#[derive(Debug, Clone, Copy)]
pub struct ReadCell {
    /// The cell lies between this node and the next along both directions.
    pub cell: Node,
    /// What was read.
    pub cells: u64,
}

/// A connected part of a grid of corners, right-handed in the image.
#[derive(Debug, Clone)]
pub struct Part(pub BTreeMap<Node, Vector2<f64>>);

impl Part {
    /// The corners of a part as the detector numbered them, turned over where they are mirrored.
    pub fn of(raw: &[RawCorner]) -> Self {
        let as_found: BTreeMap<Node, Vector2<f64>> = raw
            .iter()
            .map(|c| ((c.i, c.j), Vector2::new(c.pixel.u, c.pixel.v)))
            .collect();
        let part = Self(as_found);
        let turning: f64 = part
            .0
            .keys()
            .filter_map(|&node| part.corners_of(node))
            .map(|p| (p[1] - p[0]).perp(&(p[3] - p[0])).signum())
            .sum();
        if turning >= 0.0 {
            part
        } else {
            Self(part.0.into_iter().map(|((i, j), p)| ((j, i), p)).collect())
        }
    }

    /// The corners of a cell, around it.
    fn corners_of(&self, (i, j): Node) -> Option<[Vector2<f64>; 4]> {
        let at = |node: Node| self.0.get(&node).copied();
        Some([
            at((i, j))?,
            at((i + 1, j))?,
            at((i + 1, j + 1))?,
            at((i, j + 1))?,
        ])
    }

    /// The map of a cell from its own corners, or from those of a cell beside it.
    fn map_of(&self, (i, j): Node) -> Option<(Homography, (f64, f64))> {
        const BESIDE: [Node; 9] = [
            (0, 0),
            (-1, 0),
            (1, 0),
            (0, -1),
            (0, 1),
            (-1, -1),
            (1, -1),
            (-1, 1),
            (1, 1),
        ];
        BESIDE.into_iter().find_map(|(di, dj)| {
            let corners = self.corners_of((i + di, j + dj))?;
            let map = Homography::of_unit_square(corners)?;
            Some((map, (-f64::from(di), -f64::from(dj))))
        })
    }

    /// The map of a cell in or beside the part.
    pub fn map_between(&self, cell: Node) -> Option<Homography> {
        let (map, (x, y)) = self.map_of(cell)?;
        Homography::of_unit_square([
            map.at(x, y),
            map.at(x + 1.0, y),
            map.at(x + 1.0, y + 1.0),
            map.at(x, y + 1.0),
        ])
    }

    /// Every cell in or beside the part, and its map.
    pub fn cells(&self) -> Vec<(Node, Homography)> {
        let mut cells: Vec<Node> = self
            .0
            .keys()
            .flat_map(|&(i, j)| [(i, j), (i - 1, j), (i, j - 1), (i - 1, j - 1)])
            .collect();
        cells.sort_unstable();
        cells.dedup();
        let mapped = cells
            .into_iter()
            .filter_map(|cell| Some((cell, self.map_between(cell)?)));
        mapped.collect()
    }

    /// Every cell in or beside the part in which a marker of so many cells can be read.
    pub fn read_cells(&self, image: &GrayImage, placed: Placed) -> Vec<ReadCell> {
        let read = |(cell, map)| {
            let cells = read(image, &map, placed)?.cells;
            Some(ReadCell { cell, cells })
        };
        self.cells().into_iter().filter_map(read).collect()
    }

    /// Smallest and largest node along both directions.
    pub fn extent(&self) -> (Node, Node) {
        self.0.keys().fold(
            ((i32::MAX, i32::MAX), (i32::MIN, i32::MIN)),
            |(low, high), &(i, j)| ((low.0.min(i), low.1.min(j)), (high.0.max(i), high.1.max(j))),
        )
    }
}

/// What the markers of a part say of its place.
#[derive(Debug)]
pub struct Votes {
    placement: Option<Placement>,
    /// Markers that agree on it; one with a wrong cell counts half.
    pub agreeing: f64,
    /// Markers without a wrong cell that say something else, or that the board does not have.
    pub against: f64,
    /// Whether the agreeing markers leave the pattern open: they lie in every other row of squares only,
    /// and there the old pattern and the new one have the same.
    is_pattern_open: bool,
}

impl Votes {
    /// The place that most markers agree on.
    pub fn of(board: &Charuco, cells: &[ReadCell]) -> Self {
        let mut votes: BTreeMap<Placement, f64> = BTreeMap::new();
        let mut exact: BTreeMap<Placement, f64> = BTreeMap::new();
        let mut rows: BTreeMap<Placement, [bool; 2]> = BTreeMap::new();
        let mut beyond = 0.0;
        let squares = squares_by_id(board);
        for cell in cells {
            let ids = board.first_id..board.first_id + board.marker_count();
            let Some(code) = board
                .codes
                .nearest(cell.cells, ids, board.codes.correctable())
            else {
                let all = 0..board.codes.count();
                beyond += f64::from(u8::from(board.codes.nearest(cell.cells, all, 0).is_some()));
                continue;
            };
            let Some(&square) = squares.get(code.id - board.first_id) else {
                continue;
            };
            let placement = placement_of(cell.cell, code.quarter_turns, square);
            let is_exact = code.wrong_cells == 0;
            *votes.entry(placement).or_default() += if is_exact { 1.0 } else { 0.5 };
            *exact.entry(placement).or_default() += f64::from(u8::from(is_exact));
            rows.entry(placement).or_default()[square.0 % 2] = true;
        }
        let best = votes.iter().max_by(|a, b| a.1.total_cmp(b.1));
        let (placement, agreeing) = best.map_or((None, 0.0), |(&p, &n)| (Some(p), n));
        let against = exact.iter().filter(|(p, _)| Some(**p) != placement);
        let both_rows = placement.and_then(|p| rows.get(&p)) == Some(&[true, true]);
        Self {
            placement,
            agreeing,
            against: against.map(|(_, n)| n).sum::<f64>() + beyond,
            is_pattern_open: (board.rows + 1).is_multiple_of(2) && !both_rows,
        }
    }

    /// The place, if the markers leave no doubt.
    pub fn agreed(&self) -> Option<Placement> {
        let clear = self.agreeing >= MIN_AGREEING
            && self.agreeing >= AGREEING_PER_CONTRADICTION * self.against
            && !self.is_pattern_open;
        self.placement.filter(|_| clear)
    }
}

/// The square of each marker, by its number from the first on.
fn squares_by_id(board: &Charuco) -> Vec<(usize, usize)> {
    let squares = (0..=board.rows).flat_map(|row| (0..=board.cols).map(move |col| (row, col)));
    squares
        .filter(|&(row, col)| board.marker_in(row, col).is_some())
        .collect()
}

/// Where the grid lies if a cell with a turned marker is this square of the board.
fn placement_of(cell: Node, quarter_turns: u8, (row, col): (usize, usize)) -> Placement {
    let turned = Placement {
        quarter_turns,
        col_shift: 0,
        row_shift: 0,
    };
    // Of a cell's two opposite nodes, the one with the least turned coordinates is its upper left.
    let (a, b) = (turned.place(cell), turned.place((cell.0 + 1, cell.1 + 1)));
    Placement {
        col_shift: col as i32 - 1 - a.0.min(b.0),
        row_shift: row as i32 - 1 - a.1.min(b.1),
        ..turned
    }
}

/// How many of the cells are markers of a dictionary, none of their cells wrong.
pub fn exact_markers(cells: &[ReadCell], codes: &Codes) -> Vec<usize> {
    cells
        .iter()
        .filter_map(|cell| codes.nearest(cell.cells, 0..codes.count(), 0))
        .map(|code| code.id)
        .collect()
}
