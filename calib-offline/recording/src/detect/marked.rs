//! Marked squares of a chessboard: a dot of the other color in their middle says where the board lies.

use super::chessboard::RawCorner;
use super::grid::Node;
use super::homography::Homography;
use super::labelling::Placement;
use super::printed::charuco_parts::Part;
use crate::dataset::image::GrayImage;
use calib_rays::print::chessboard::DOT;
use nalgebra::{Matrix2, Vector2};

/// The middle of a square differs from its rim by this part of the contrast if it is marked.
const MIN_CONTRAST: f64 = 0.4;
/// A dot without doubt has this part of the contrast, ...
const CLEAR_CONTRAST: f64 = 0.6;
/// ... and a rim that differs by no more.
const CLEAR_RIM: f64 = 0.45;
/// Points of the rim along each axis.
const RIM: [f64; 5] = [0.14, 0.3, 0.5, 0.7, 0.86];
/// So much of the print around a dot is blurred with it, px.
const BLURRED_PX: f64 = 3.0;
/// So many of the marked squares in view there must be for each that may have no dot.
const MARKS_PER_MISS: usize = 4;

/// A square of the grid.
#[derive(Debug, Clone, Copy)]
pub struct SeenSquare {
    /// It lies between this node and the next along both directions.
    cell: Node,
    has_dot: bool,
    /// Whether it looks like nothing else: full contrast, and a rim of one color.
    is_clear: bool,
    map: Homography,
}

/// The squares in and beside a grid, as far as they are in view.
pub fn squares(image: &GrayImage, raw: &[RawCorner]) -> Vec<SeenSquare> {
    let part = Part::of(raw);
    let looked: Vec<(Node, Homography, f64, f64, f64)> = part
        .cells()
        .into_iter()
        .filter_map(|(cell, map)| {
            let value = |x: f64, y: f64| {
                let pixel = map.at(x, y);
                image.between(pixel.x, pixel.y)
            };
            let mut rim = Vec::new();
            for at in RIM {
                for (x, y) in [(at, RIM[0]), (at, RIM[4]), (RIM[0], at), (RIM[4], at)] {
                    rim.push(value(x, y)?);
                }
            }
            rim.sort_unstable_by(f64::total_cmp);
            let spread = rim[rim.len() - 1] - rim[0];
            let mut middle = 0.0;
            for (x, y) in [
                (0.5, 0.5),
                (0.42, 0.5),
                (0.58, 0.5),
                (0.5, 0.42),
                (0.5, 0.58),
            ] {
                middle += value(x, y)? / 5.0;
            }
            Some((cell, map, rim[rim.len() / 2], middle, spread))
        })
        .collect();
    let mut rims: Vec<f64> = looked.iter().map(|square| square.2).collect();
    rims.sort_unstable_by(f64::total_cmp);
    let (Some(dark), Some(bright)) = (rims.get(rims.len() / 5), rims.get(rims.len() * 4 / 5))
    else {
        return Vec::new();
    };
    let least = MIN_CONTRAST * (bright - dark);
    let midway = f64::midpoint(*dark, *bright);
    looked
        .into_iter()
        .map(|(cell, map, rim, middle, spread)| SeenSquare {
            cell,
            map,
            has_dot: (middle - rim).abs() > least,
            is_clear: (middle - rim).abs() > CLEAR_CONTRAST * (bright - dark)
                && (middle > midway) != (rim > midway)
                && spread < CLEAR_RIM * (bright - dark),
        })
        .collect()
}

/// The image without its dots: those pixels have no value, so that they disturb no corner.
pub fn without_dots(image: &GrayImage, squares: &[SeenSquare]) -> GrayImage {
    let mut places = Vec::new();
    let width = image.sensor.width as usize;
    for square in squares.iter().filter(|square| square.has_dot) {
        let at = |x: f64, y: f64| square.map.at(x, y);
        let center = at(0.5, 0.5);
        let sides =
            Matrix2::from_columns(&[at(1.0, 0.5) - at(0.0, 0.5), at(0.5, 1.0) - at(0.5, 0.0)]);
        let Some(from_px) = sides.try_inverse() else {
            continue;
        };
        let radius = DOT / 2.0 + BLURRED_PX * from_px.norm() / std::f64::consts::SQRT_2;
        let reach = sides.column(0).norm() + sides.column(1).norm();
        let range = |middle: f64, count: u32| {
            let low = (middle - reach).floor().max(0.0) as i64;
            low..=(middle + reach).ceil().min(f64::from(count) - 1.0) as i64
        };
        for v in range(center.y, image.sensor.height) {
            for u in range(center.x, image.sensor.width) {
                let offset = from_px * (Vector2::new(u as f64, v as f64) - center);
                if offset.norm() <= radius {
                    places.push(v as usize * width + u as usize);
                }
            }
        }
    }
    let mut covered = image.clone();
    covered.cover(places.into_iter());
    covered
}

/// The places in which the fewest squares contradict; none if that is still too many: no dot may be where none is
/// stated, and of many marked squares one may be without (glare). `marked` are (row, col) of squares, from 0 at the
/// upper left.
pub fn agreeing(
    placements: Vec<Placement>,
    squares: &[SeenSquare],
    marked: &[(usize, usize)],
) -> Vec<Placement> {
    // Dots too many, marked squares without, and with a dot.
    let counts = |placement: &Placement| {
        let mut counts = [0usize; 3];
        for square in squares {
            let (i, j) = square.cell;
            let (a, b) = (placement.place((i, j)), placement.place((i + 1, j + 1)));
            let (row, col) = (a.1.min(b.1) + 1, a.0.min(b.0) + 1);
            let is_marked = usize::try_from(row)
                .ok()
                .zip(usize::try_from(col).ok())
                .is_some_and(|place| marked.contains(&place));
            match (is_marked, square.has_dot) {
                (false, _) => counts[0] += usize::from(square.is_clear),
                (true, false) => counts[1] += 1,
                (true, true) => counts[2] += 1,
            }
        }
        counts
    };
    let counted: Vec<([usize; 3], Placement)> =
        placements.into_iter().map(|p| (counts(&p), p)).collect();
    let wrong = |[beside, without, _]: &[usize; 3]| beside + without;
    let least = counted.iter().map(|(c, _)| wrong(c)).min().unwrap_or(0);
    let allowed = |[beside, without, with]: &[usize; 3]| {
        *beside == 0 && *without <= (with + without) / (MARKS_PER_MISS + 1)
    };
    let best = counted
        .into_iter()
        .filter(|(counts, _)| wrong(counts) == least && allowed(counts));
    best.map(|(_, placement)| placement).collect()
}

/// The cells that have a dot without doubt.
pub fn clear_dots(squares: &[SeenSquare]) -> Vec<Node> {
    let clear = squares.iter().filter(|square| square.is_clear);
    clear.map(|square| square.cell).collect()
}

/// How many squares are marked.
pub fn dots(squares: &[SeenSquare]) -> usize {
    squares.iter().filter(|square| square.has_dot).count()
}
