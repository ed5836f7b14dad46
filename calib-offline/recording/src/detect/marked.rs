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
/// Points of the rim along each axis.
const RIM: [f64; 5] = [0.14, 0.3, 0.5, 0.7, 0.86];
/// So much of the print around a dot is blurred with it, px.
const BLURRED_PX: f64 = 3.0;
/// One square in so many may contradict.
const SQUARES_PER_CONTRADICTION: usize = 20;

/// A square of the grid.
#[derive(Debug, Clone, Copy)]
pub struct SeenSquare {
    /// It lies between this node and the next along both directions.
    cell: Node,
    has_dot: bool,
    map: Homography,
}

/// The squares in and beside a grid, as far as they are in view.
pub fn squares(image: &GrayImage, raw: &[RawCorner]) -> Vec<SeenSquare> {
    let part = Part::of(raw);
    let looked: Vec<(Node, Homography, f64, f64)> = part
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
            Some((cell, map, rim[rim.len() / 2], middle))
        })
        .collect();
    let mut rims: Vec<f64> = looked.iter().map(|square| square.2).collect();
    rims.sort_unstable_by(f64::total_cmp);
    let (Some(dark), Some(bright)) = (rims.get(rims.len() / 5), rims.get(rims.len() * 4 / 5))
    else {
        return Vec::new();
    };
    let least = MIN_CONTRAST * (bright - dark);
    looked
        .into_iter()
        .map(|(cell, map, rim, middle)| SeenSquare {
            cell,
            map,
            has_dot: (middle - rim).abs() > least,
        })
        .collect()
}

/// The image without its dots: those pixels have no value, so that they disturb no corner.
pub fn without_dots(image: &GrayImage, squares: &[SeenSquare]) -> GrayImage {
    let mut covered = image.clone();
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
                    covered.values[v as usize * width + u as usize] = f32::NAN;
                }
            }
        }
    }
    covered
}

/// The places in which the fewest squares contradict; none if that is still too many. `marked` are (row, col) of
/// squares, from 0 at the upper left.
pub fn agreeing(
    placements: Vec<Placement>,
    squares: &[SeenSquare],
    marked: &[(usize, usize)],
) -> Vec<Placement> {
    let contradictions = |placement: &Placement| {
        let differs = |square: &&SeenSquare| {
            let (i, j) = square.cell;
            let (a, b) = (placement.place((i, j)), placement.place((i + 1, j + 1)));
            let (row, col) = (a.1.min(b.1) + 1, a.0.min(b.0) + 1);
            let is_marked = usize::try_from(row)
                .ok()
                .zip(usize::try_from(col).ok())
                .is_some_and(|place| marked.contains(&place));
            is_marked != square.has_dot
        };
        squares.iter().filter(differs).count()
    };
    let counted: Vec<(usize, Placement)> = placements
        .into_iter()
        .map(|p| (contradictions(&p), p))
        .collect();
    let least = counted.iter().map(|(count, _)| *count).min().unwrap_or(0);
    if least > squares.len() / SQUARES_PER_CONTRADICTION {
        return Vec::new();
    }
    let best = counted.into_iter().filter(|(count, _)| *count == least);
    best.map(|(_, placement)| placement).collect()
}

/// How many squares are marked.
pub fn dots(squares: &[SeenSquare]) -> usize {
    squares.iter().filter(|square| square.has_dot).count()
}
