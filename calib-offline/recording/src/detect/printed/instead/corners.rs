//! Chessboards that an image shows instead.

use crate::dataset::image::GrayImage;
use crate::detect::chessboard::RawCorner;
use crate::detect::marked;
use crate::detect::printed::charuco_parts::Part;
use crate::detect::seen_board::{SeenBoard, SeenKind};
use calib_rays::geometry::PixelPoint;

/// Part of the cells that must be squares of the right color throughout.
const CHECKERED: f64 = 0.7;
/// Part of a cell's samples that must have its color.
const OF_ONE_COLOR: f64 = 0.85;
/// Points of a cell along each axis.
const SAMPLES: [f64; 5] = [0.2, 0.35, 0.5, 0.65, 0.8];
/// Fewest corners along each direction.
const MIN_SIDE: usize = 3;

/// A chessboard, with or without dots; `None` if the cells are no squares.
pub fn seen(image: &GrayImage, raw: &[RawCorner]) -> Option<SeenBoard> {
    let part = without_strays(Part::of(raw));
    let (low, high) = part.extent();
    let (w, h) = (high.0 - low.0 + 1, high.1 - low.1 + 1);
    let size = (w.max(0) as usize, h.max(0) as usize);
    let is_grid = size.0.min(size.1) >= MIN_SIDE && part.0.len() * 2 > size.0 * size.1;
    if !is_grid || checkered(image, &part)? < CHECKERED {
        return None;
    }
    // Lying, with the square at the upper left black where a turn can make it so.
    let squares = marked::squares(image, raw);
    let dots: Vec<(i32, i32)> = marked::clear_dots(&squares)
        .into_iter()
        .map(|(i, j)| (i - low.0 + 1, j - low.1 + 1))
        .collect();
    let (rows, cols) = (size.0.min(size.1), size.0.max(size.1));
    let turned = |(x, y): (i32, i32)| if w >= h { (x, y) } else { (y, w - x) };
    let marked: Vec<(usize, usize)> = dots
        .into_iter()
        .map(turned)
        .filter_map(|(x, y)| Some((usize::try_from(y).ok()?, usize::try_from(x).ok()?)))
        .filter(|&(row, col)| row <= rows && col <= cols)
        .collect();
    Some(SeenBoard {
        kind: SeenKind::Chessboard {
            marked: black_first(marked, (rows, cols), image, &part, (low, high)),
        },
        rows,
        cols,
        is_whole: is_in_view(image, &part),
    })
}

/// The places counted from the other end where the square at the upper left would be white otherwise.
fn black_first(
    mut marked: Vec<(usize, usize)>,
    (rows, cols): (usize, usize),
    image: &GrayImage,
    part: &Part,
    (low, high): ((i32, i32), (i32, i32)),
) -> Vec<(usize, usize)> {
    let (w, h) = (high.0 - low.0 + 1, high.1 - low.1 + 1);
    // The cell at the upper left as counted: that of the grid's own, or of its lower left.
    let (first, _) = if w >= h {
        ((low.0 - 1, low.1 - 1), 0)
    } else {
        ((high.0, low.1 - 1), 1)
    };
    let is_dark = cell_colors(image, part)
        .into_iter()
        .find_map(|(cell, dark)| {
            let steps = (cell.0 - first.0) + (cell.1 - first.1);
            dark.map(|dark| dark == (steps.rem_euclid(2) == 0))
        });
    if is_dark == Some(false) && (rows + cols) % 2 == 1 {
        for place in &mut marked {
            *place = (rows - place.0, cols - place.1);
        }
    }
    marked.sort_unstable();
    marked
}

/// Each cell, and whether it is dark; `None` if it is not of one color.
fn cell_colors(image: &GrayImage, part: &Part) -> Vec<((i32, i32), Option<bool>)> {
    let sampled: Vec<_> = part
        .cells()
        .into_iter()
        .filter_map(|(cell, map)| {
            let mut values = Vec::with_capacity(SAMPLES.len().pow(2));
            for y in SAMPLES {
                for x in SAMPLES {
                    let pixel = map.at(x, y);
                    values.push(image.between(pixel.x, pixel.y)?);
                }
            }
            values.sort_unstable_by(f64::total_cmp);
            Some((cell, values))
        })
        .collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let means: Vec<((i32, i32), f64)> = sampled.iter().map(|(c, v)| (*c, mean(v))).collect();
    sampled
        .iter()
        .map(|(cell, values)| {
            // Light changes over the board: midway between the cells around.
            let near = means.iter().filter(|(other, _)| {
                (other.0 - cell.0).abs() <= 1 && (other.1 - cell.1).abs() <= 1
            });
            let (low, high) = near.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), m| {
                (low.min(m.1), high.max(m.1))
            });
            let midway = f64::midpoint(low, high);
            let bright = values.iter().filter(|v| **v > midway).count() as f64;
            let share = bright / values.len() as f64;
            let color = if share >= OF_ONE_COLOR {
                Some(false)
            } else if share <= 1.0 - OF_ONE_COLOR {
                Some(true)
            } else {
                None
            };
            (*cell, color)
        })
        .collect()
}

/// Part of the cells that alternate in color as squares do; `None` without cells.
pub fn checkered(image: &GrayImage, part: &Part) -> Option<f64> {
    // Cells beside the part may be its margin: only those between four corners count.
    let inside = |(i, j): (i32, i32)| {
        [(0, 0), (1, 0), (0, 1), (1, 1)]
            .iter()
            .all(|(a, b)| part.0.contains_key(&(i + a, j + b)))
    };
    let colors: Vec<_> = cell_colors(image, part)
        .into_iter()
        .filter(|(cell, _)| inside(*cell))
        .collect();
    let as_if = |dark_at_even: bool| {
        colors
            .iter()
            .filter(|((i, j), dark)| {
                dark.is_some_and(|dark| dark == (((i + j).rem_euclid(2) == 0) == dark_at_even))
            })
            .count()
    };
    let right = as_if(true).max(as_if(false));
    (!colors.is_empty()).then(|| right as f64 / colors.len() as f64)
}

/// The part without outer lines of which less than half is there: the corners of markers join in now and then.
pub(super) fn without_strays(mut part: Part) -> Part {
    loop {
        let (low, high) = part.extent();
        let count = |on_line: &dyn Fn(&(i32, i32)) -> bool| {
            part.0.keys().filter(|node| on_line(node)).count() as i64
        };
        let (w, h) = (
            i64::from(high.0) - i64::from(low.0) + 1,
            i64::from(high.1) - i64::from(low.1) + 1,
        );
        let stray = if part.0.len() <= MIN_SIDE {
            None
        } else if 2 * count(&|n| n.0 == low.0) < h {
            Some((0, low.0))
        } else if 2 * count(&|n| n.0 == high.0) < h {
            Some((0, high.0))
        } else if 2 * count(&|n| n.1 == low.1) < w {
            Some((1, low.1))
        } else if 2 * count(&|n| n.1 == high.1) < w {
            Some((1, high.1))
        } else {
            None
        };
        let Some((axis, at)) = stray else {
            return part;
        };
        part.0
            .retain(|node, _| if axis == 0 { node.0 } else { node.1 } != at);
    }
}

/// Whether what lies beyond the outermost squares is in view on all sides, as far as it can be said.
pub(super) fn is_in_view(image: &GrayImage, part: &Part) -> bool {
    let (low, high) = part.extent();
    let seen = |cell: (i32, i32)| {
        let map = part.map_between(cell)?;
        let beyond = [(-0.15, -0.15), (1.15, -0.15), (1.15, 1.15), (-0.15, 1.15)];
        Some(beyond.iter().all(|&(x, y)| {
            let at = map.at(x, y);
            image.sensor.contains(PixelPoint::new(at.x, at.y))
        }))
    };
    let (columns, rows) = (low.0..high.0, low.1..high.1);
    let sides: [Vec<(i32, i32)>; 4] = [
        columns.clone().map(|i| (i, low.1 - 1)).collect(),
        columns.map(|i| (i, high.1)).collect(),
        rows.clone().map(|j| (low.0 - 1, j)).collect(),
        rows.map(|j| (high.0, j)).collect(),
    ];
    sides.into_iter().all(|side| {
        let known: Vec<bool> = side.into_iter().filter_map(seen).collect();
        !known.is_empty() && known.iter().all(|in_view| *in_view)
    })
}
