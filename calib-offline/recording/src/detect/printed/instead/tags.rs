//! A grid of tags that an image shows, found without its description: tags lie beside each other, and
//! their numbers grow by one from column to column and by the number of columns from row to row.

use crate::dataset::image::GrayImage;
use crate::detect::homography::Homography;
use crate::detect::printed::cells::{Placed, read};
use crate::detect::printed::quads::quads;
use crate::detect::printed::saddles::Label;
use crate::detect::seen_board::{SeenBoard, SeenKind};
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::median;
use calib_rays::print::Codes;
use nalgebra::{Vector2, Vector3};
use std::collections::{BTreeMap, VecDeque};

/// Fewest tags that make a grid.
const MIN_TAGS: usize = 4;
/// Where the white around a tag is looked at, in its sides.
const AROUND: [f64; 2] = [-0.1, -0.05];
/// Nearest and farthest that the next tag's middle may be, in sides.
const NEXT: (f64, f64) = (1.04, 3.1);
/// How far aside of an axis it may be, of that distance.
const ASIDE: f64 = 0.2;
/// Part of the neighbors whose numbers must agree.
const AGREEING: f64 = 0.7;
/// Right, down, left, up.
const STEPS: [(i64, i64); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// A tag as it was read.
struct Tag {
    id: usize,
    corners: [Vector2<f64>; 4],
    map: Homography,
}

impl Tag {
    fn center(&self) -> Vector2<f64> {
        self.map.at(0.5, 0.5)
    }

    /// A pixel in the tag's own frame: its middle is zero, its side is 1.
    fn own(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let at = self.map.matrix().try_inverse()? * Vector3::new(pixel.x, pixel.y, 1.0);
        Some(at.xy() / at.z - Vector2::repeat(0.5))
    }
}

/// The grid of tags; `None` if there are too few of one dictionary.
pub fn seen(image: &GrayImage) -> Option<SeenBoard> {
    let (codes, tags) = read_tags(image)?;
    let markers = |count| SeenBoard {
        kind: SeenKind::Markers {
            dictionary: codes.name(),
            count,
        },
        rows: 0,
        cols: 0,
        is_whole: false,
    };
    let Some(family) = codes.name().strip_prefix("DICT_APRILTAG_") else {
        return Some(markers(tags.len()));
    };
    let cells = lattice(&tags);
    let grid = numbered(&tags, &cells)
        .map(|numbered| described(image, &tags, &numbered, family))
        .filter(|_| cells.len() >= MIN_TAGS);
    Some(grid.unwrap_or_else(|| markers(tags.len())))
}

/// The dictionary that has most of the tags without a wrong cell, and those that are there once.
fn read_tags(image: &GrayImage) -> Option<(Codes, Vec<Tag>)> {
    let quads: Vec<([Vector2<f64>; 4], Homography)> = quads(image)
        .into_iter()
        .filter_map(|corners| Some((corners, Homography::of_unit_square(corners)?)))
        .collect();
    if quads.len() < MIN_TAGS {
        return None;
    }
    let mut best: Option<(Codes, BTreeMap<usize, Vec<usize>>)> = None;
    for (side, border) in (4..=7).flat_map(|side| [(side, 1), (side, 2)]) {
        let cells: Vec<Option<u64>> = quads
            .iter()
            .map(|(_, map)| {
                AROUND.into_iter().find_map(|around| {
                    let placed = Placed {
                        margin: 0.0,
                        around,
                        side,
                        border,
                    };
                    Some(read(image, map, placed)?.cells)
                })
            })
            .collect();
        if cells.iter().flatten().count() < MIN_TAGS {
            continue;
        }
        let all = Codes::names().iter().filter_map(|name| Codes::named(name));
        for codes in all.filter(|codes| codes.side() == side) {
            let mut by_id: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
            for (k, cells) in cells.iter().enumerate() {
                let code = cells.and_then(|cells| codes.nearest(cells, 0..codes.count(), 0));
                if let Some(code) = code {
                    by_id.entry(code.id).or_default().push(k);
                }
            }
            let better = best.as_ref().is_none_or(|(other, most)| {
                by_id.len() > most.len()
                    || (by_id.len() == most.len() && codes.count() < other.count())
            });
            if by_id.len() >= MIN_TAGS && better {
                best = Some((codes, by_id));
            }
        }
    }
    let (codes, by_id) = best?;
    let tags = by_id
        .into_iter()
        .filter(|(_, places)| places.len() == 1)
        .filter_map(|(id, places)| {
            let (corners, map) = *quads.get(*places.first()?)?;
            Some(Tag { id, corners, map })
        })
        .collect();
    Some((codes, tags))
}

/// For each tag and each of its own four directions the nearest tag there.
fn neighbors(tags: &[Tag]) -> Vec<[Option<usize>; 4]> {
    let nearest = |tag: &Tag, k: usize| {
        let mut best: [Option<(f64, usize)>; 4] = [None; 4];
        for (other, at) in tags.iter().enumerate().filter(|(other, _)| *other != k) {
            let Some(at) = tag.own(&at.center()) else {
                continue;
            };
            for (direction, (x, y)) in STEPS.iter().enumerate() {
                let step = Vector2::new(*x as f64, *y as f64);
                let (along, aside) = (at.dot(&step), at.perp(&step).abs());
                let is_next = (NEXT.0..NEXT.1).contains(&along) && aside < ASIDE * along;
                if is_next && best[direction].is_none_or(|(least, _)| along < least) {
                    best[direction] = Some((along, other));
                }
            }
        }
        best.map(|found| found.map(|(_, other)| other))
    };
    tags.iter()
        .enumerate()
        .map(|(k, tag)| nearest(tag, k))
        .collect()
}

/// Column and row of the largest connected part, by the tags' indices.
fn lattice(tags: &[Tag]) -> BTreeMap<usize, (i64, i64)> {
    let beside = neighbors(tags);
    let mut best = BTreeMap::new();
    for seed in 0..tags.len() {
        if best.contains_key(&seed) {
            continue;
        }
        // How the tag's own directions are turned against the grid's.
        let mut turns = BTreeMap::from([(seed, 0usize)]);
        let mut cells = BTreeMap::from([(seed, (0i64, 0i64))]);
        let mut queue = VecDeque::from([seed]);
        while let Some(k) = queue.pop_front() {
            let (Some(&turn), Some(&(col, row))) = (turns.get(&k), cells.get(&k)) else {
                continue;
            };
            for own in 0..4 {
                let Some(other) = beside[k][own] else {
                    continue;
                };
                let back = beside[other].iter().position(|next| *next == Some(k));
                let (Some(back), false) = (back, cells.contains_key(&other)) else {
                    continue;
                };
                let direction = (own + turn) % 4;
                let (dx, dy) = STEPS[direction];
                turns.insert(other, (direction + 6 - back) % 4);
                cells.insert(other, (col + dx, row + dy));
                queue.push_back(other);
            }
        }
        if cells.len() > best.len() {
            best = cells;
        }
    }
    best
}

/// The grid as its numbers have it.
struct Numbered {
    /// Column and row by the tags' indices, both from 0.
    cells: BTreeMap<usize, (i64, i64)>,
    /// From one row to the next below; `None` if only one is in view.
    row_step: Option<i64>,
}

/// Turned so that numbers grow by one along the rows.
fn numbered(tags: &[Tag], cells: &BTreeMap<usize, (i64, i64)>) -> Option<Numbered> {
    let turned = |quarters: usize| -> BTreeMap<usize, (i64, i64)> {
        let turn = |at: (i64, i64)| (0..quarters).fold(at, |(x, y), _| (-y, x));
        cells.iter().map(|(&k, &at)| (k, turn(at))).collect()
    };
    let steps = |cells: &BTreeMap<usize, (i64, i64)>, (dx, dy): (i64, i64)| -> Vec<i64> {
        let at: BTreeMap<(i64, i64), usize> = cells.iter().map(|(&k, &at)| (at, k)).collect();
        cells
            .iter()
            .filter_map(|(&k, &(x, y))| {
                let next = at.get(&(x + dx, y + dy))?;
                Some(tags[*next].id as i64 - tags[k].id as i64)
            })
            .collect()
    };
    let (turned, along) = (0..4)
        .map(|quarters| {
            let turned = turned(quarters);
            let along = steps(&turned, (1, 0));
            (turned, along)
        })
        .max_by_key(|(_, along)| along.iter().filter(|step| **step == 1).count())?;
    let ones = along.iter().filter(|step| **step == 1).count();
    if ones == 0 || (ones as f64) < AGREEING * along.len() as f64 {
        return None;
    }
    let down = steps(&turned, (0, 1));
    let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
    for step in &down {
        *counts.entry(*step).or_default() += 1;
    }
    let usual = counts.into_iter().max_by_key(|(_, count)| *count);
    let row_step = match usual {
        None => None,
        Some((step, count)) if count as f64 >= AGREEING * down.len() as f64 => Some(step),
        Some(_) => return None,
    };
    let least = |of: fn(&(i64, i64)) -> i64| turned.values().map(of).min().unwrap_or(0);
    let (left, top) = (least(|at| at.0), least(|at| at.1));
    Some(Numbered {
        cells: turned
            .into_iter()
            .map(|(k, (x, y))| (k, (x - left, y - top)))
            .collect(),
        row_step,
    })
}

fn described(
    image: &GrayImage,
    tags: &[Tag],
    numbered: &Numbered,
    family: &'static str,
) -> SeenBoard {
    let most = |of: fn(&(i64, i64)) -> i64| numbered.cells.values().map(of).max().unwrap_or(0);
    let (last_col, last_row) = (most(|at| at.0), most(|at| at.1));
    let cols = numbered
        .row_step
        .map_or(last_col + 1, |step| step.abs().max(last_col + 1));
    let is_whole = cols == last_col + 1
        && numbered.row_step.is_some()
        && is_in_view(image, tags, numbered, (last_col, last_row));
    let upwards = numbered.row_step.is_some_and(|step| step < 0);
    let first_id = is_whole.then(|| {
        let firsts = numbered.cells.iter().map(|(&k, &(col, row))| {
            let row = if upwards { last_row - row } else { row };
            (tags[k].id as i64 - row * cols - col) as f64
        });
        median(firsts).unwrap_or(0.0).max(0.0) as usize
    });
    SeenBoard {
        kind: SeenKind::AprilGrid {
            family,
            first_id,
            spacing: spacing(tags, numbered),
        },
        rows: (last_row + 1) as usize,
        cols: cols as usize,
        is_whole,
    }
}

/// Whether the next tags' middles would be in view on all sides of the grid.
fn is_in_view(
    image: &GrayImage,
    tags: &[Tag],
    numbered: &Numbered,
    (last_col, last_row): (i64, i64),
) -> bool {
    let at: BTreeMap<(i64, i64), usize> = numbered.cells.iter().map(|(&k, &at)| (at, k)).collect();
    let beyond = |on: (i64, i64), before: (i64, i64)| {
        let (a, b) = (
            tags[*at.get(&on)?].center(),
            tags[*at.get(&before)?].center(),
        );
        let next = a + (a - b);
        Some(image.sensor.contains(PixelPoint::new(next.x, next.y)))
    };
    let all = |sides: Vec<Option<bool>>| {
        let known: Vec<bool> = sides.into_iter().flatten().collect();
        !known.is_empty() && known.iter().all(|seen| *seen)
    };
    all((0..=last_row).map(|r| beyond((0, r), (1, r))).collect())
        && all((0..=last_row)
            .map(|r| beyond((last_col, r), (last_col - 1, r)))
            .collect())
        && all((0..=last_col).map(|c| beyond((c, 0), (c, 1))).collect())
        && all((0..=last_col)
            .map(|c| beyond((c, last_row), (c, last_row - 1)))
            .collect())
}

/// The space between tags from their outlines, which are known to half a pixel.
fn spacing(tags: &[Tag], numbered: &Numbered) -> Option<f64> {
    let mut corners = BTreeMap::new();
    for (&k, &(col, row)) in &numbered.cells {
        let tag = &tags[k];
        // The grid's directions in the image at this tag: of a neighbor's middle.
        let at = |dx: i64, dy: i64| {
            let wanted = (col + dx, row + dy);
            let other = numbered.cells.iter().find(|(_, at)| **at == wanted)?;
            Some((tags[*other.0].center() - tag.center()) * (dx + dy) as f64)
        };
        let (Some(right), Some(down)) = (at(1, 0).or(at(-1, 0)), at(0, 1).or(at(0, -1))) else {
            continue;
        };
        for corner in tag.corners {
            let off = corner - tag.center();
            let x = off.perp(&down) / right.perp(&down);
            let y = right.perp(&off) / right.perp(&down);
            let label = (
                2 * row as usize + usize::from(y > 0.0),
                2 * col as usize + usize::from(x > 0.0),
            );
            corners.insert(label, corner);
        }
    }
    spacing_of(&corners).map(|(spacing, _)| spacing)
}

/// The space between tags as a share of their side, from their corners by label, and how many places
/// tell it. The cross ratio of two tags' corners on one line is the same in every perspective:
/// of places 0, 1, 1 + s and 2 + s it is `1 + 1 / (s^2 + 2 s)`.
pub fn spacing_of(corners: &BTreeMap<Label, Vector2<f64>>) -> Option<(f64, usize)> {
    let mut found = Vec::new();
    for (&(row, col), a) in corners {
        for along_row in [true, false] {
            let at = |k: usize| {
                let label = if along_row {
                    (row, col + k)
                } else {
                    (row + k, col)
                };
                corners.get(&label)
            };
            let is_first = if along_row { col } else { row } % 2 == 0;
            if let (true, Some(b), Some(c), Some(d)) = (is_first, at(1), at(2), at(3)) {
                let ratio = ((c - a).norm() * (d - b).norm()) / ((c - b).norm() * (d - a).norm());
                if ratio > 1.0 {
                    found.push((1.0 + 1.0 / (ratio - 1.0)).sqrt() - 1.0);
                }
            }
        }
    }
    let count = found.len();
    Some((median(found)?, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spacing_is_the_same_in_every_perspective() {
        let mut corners = BTreeMap::new();
        for row in 0..4usize {
            for col in 0..6usize {
                let along = |k: usize| (k / 2) as f64 * 1.25 + (k % 2) as f64;
                let (x, y) = (along(col), along(row));
                let w = 5.0 + 0.8 * x - 0.3 * y;
                let pixel = Vector2::new((300.0 * x + 20.0 * y) / w, (280.0 * y - 30.0 * x) / w);
                corners.insert((row, col), pixel);
            }
        }
        let (spacing, count) = spacing_of(&corners).unwrap();
        assert!((spacing - 0.25).abs() < 1e-9, "{spacing}");
        assert_eq!(count, 4 * 2 + 6);
    }
}
