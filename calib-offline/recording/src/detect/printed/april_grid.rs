//! The grid of `AprilTags`: tags are found as dark quadrilaterals and read; their numbers say where they lie.
//!
//! Numbers may grow upwards (Kalibr) or downwards from row to row: which one, the image tells, because
//! labels turn in the image as u and v do. So it is with the black around the codes, one cell or Kalibr's two.
//! Nothing rests on the turn of the tags: `OpenCV` prints them upside down. The corners of the tags are then
//! fitted as crossings with the small squares between the tags.

use super::cells::{Placed, read};
use super::found::{Found, PrintedTarget};
use super::quads::quads;
use super::saddles::{self, Crossing, Crossings, Label};
use crate::dataset::image::GrayImage;
use crate::detect::homography::Homography;
use crate::detect::seen_board::SeenBoard;
use crate::detect::settings::DetectSettings;
use crate::detect::turning::turns_like_image;
use crate::detect::verdict::{Refusal, why_nothing_found};
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::Corner;
use calib_rays::print::{AprilGrid, Code, Codes, TagBorder, TagOrder};
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// Tags that must be seen; fewer leave no map.
const MIN_TAGS: usize = 3;
/// A tag this far, in its own sides, from where the others have it is none of the grid.
const MAX_ASIDE: f64 = 0.35;
/// How far windows reach towards the next tag, of the space between.
const REACH: f64 = 0.85;

/// A tag that was read.
#[derive(Debug, Clone, Copy)]
struct Tag {
    code: Code,
    corners: [Vector2<f64>; 4],
}

impl Tag {
    fn center(&self) -> Vector2<f64> {
        self.corners.iter().sum::<Vector2<f64>>() / 4.0
    }
}

impl PrintedTarget for AprilGrid {
    fn find(&self, image: &GrayImage, settings: &DetectSettings) -> Result<Found, Refusal> {
        let quads = quads(image);
        let ids = self.first_id..self.first_id + self.tag_count();
        let with = |border: TagBorder| {
            let placed = placed(self, border);
            let tags = tags(image, &quads, &self.codes, placed, ids.clone());
            (border, tags)
        };
        let (one, two) = (with(TagBorder::One), with(TagBorder::Two));
        let (border, tags) = if two.1.len() > one.1.len() { two } else { one };
        if tags.len() < MIN_TAGS {
            return Err(other_tags(image, &quads, self).unwrap_or_else(|| why_nothing_found(image)));
        }
        let rough = rough_corners(self, &tags)?;
        let crossings = crossings(self, border);
        let fitted = saddles::fit(image, &crossings, &rough, settings.max_half_window_px)
            .filter(|fitted| !fitted.is_empty())
            .ok_or(Refusal::TagsWithoutCorners { tags: tags.len() })?;
        Found::of_corners(image, &crossings, &fitted, self.tag_mm)
            .ok_or(Refusal::TagsWithoutCorners { tags: tags.len() })
    }
}

/// How a tag's cells lie in its quadrilateral, and the white beside it.
fn placed(grid: &AprilGrid, border: TagBorder) -> Placed {
    Placed {
        margin: 0.0,
        around: -0.4 * grid.spacing.min(0.4),
        side: grid.codes.side(),
        border: border.cells(),
    }
}

/// The tags of a dictionary that are in the image once.
fn tags(
    image: &GrayImage,
    quads: &[[Vector2<f64>; 4]],
    codes: &Codes,
    placed: Placed,
    ids: std::ops::Range<usize>,
) -> Vec<Tag> {
    let mut by_id: BTreeMap<usize, Vec<Tag>> = BTreeMap::new();
    for &corners in quads {
        let code = Homography::of_unit_square(corners)
            .and_then(|map| read(image, &map, placed))
            .and_then(|read| codes.nearest(read.cells, ids.clone(), codes.correctable()));
        if let Some(code) = code {
            by_id
                .entry(code.id)
                .or_default()
                .push(Tag { code, corners });
        }
    }
    // A number that is there twice belongs to two boards, or is a mistake.
    let single = by_id.into_values().filter(|tags| tags.len() == 1);
    single.flatten().collect()
}

/// The tags' corners by label.
fn rough_corners(grid: &AprilGrid, tags: &[Tag]) -> Result<BTreeMap<Label, Vector2<f64>>, Refusal> {
    let order = order(grid, tags).ok_or(Refusal::TagsInLine { tags: tags.len() })?;
    let at = |tag: &Tag| grid.place_of(tag.code.id, order);
    let mut corners = BTreeMap::new();
    for tag in tags {
        let Some((row, col)) = at(tag) else { continue };
        let Some(step) = steps(tags, at, (row, col)) else {
            continue;
        };
        let Some(step_from_px) = step.try_inverse() else {
            continue;
        };
        // Tags beside agree with this one's place.
        let agrees = agreeing(tags, at, tag, (row, col), &step);
        if !agrees {
            continue;
        }
        for corner in tag.corners {
            let offset = step_from_px * (corner - tag.center());
            let label = (
                2 * row + usize::from(offset.y > 0.0),
                2 * col + usize::from(offset.x > 0.0),
            );
            corners.insert(label, corner);
        }
    }
    Ok(corners)
}

/// Whether numbers grow upwards or downwards, as seen in the image; `None` if the tags lie in one row or
/// one column.
fn order(grid: &AprilGrid, tags: &[Tag]) -> Option<TagOrder> {
    let corner = |tag: &Tag| {
        let (row, col) = grid.place_of(tag.code.id, TagOrder::Downwards)?;
        let center = tag.center();
        Some(Corner {
            row,
            col,
            pixel: PixelPoint::new(center.x, center.y),
            sigma_px: None,
        })
    };
    let corners: Vec<Corner> = tags.iter().filter_map(corner).collect();
    let first = corners.first()?;
    let in_line =
        corners.iter().all(|c| c.row == first.row) || corners.iter().all(|c| c.col == first.col);
    if in_line {
        return None;
    }
    turns_like_image(&corners).map(|as_image| {
        if as_image {
            TagOrder::Downwards
        } else {
            TagOrder::Upwards
        }
    })
}

/// The image of a step along the columns and along the rows near a place: a plane through the tags,
/// those near it weighted most.
fn steps(
    tags: &[Tag],
    at: impl Fn(&Tag) -> Option<(usize, usize)>,
    (row, col): (usize, usize),
) -> Option<Matrix2<f64>> {
    let weighted: Vec<_> = tags
        .iter()
        .filter_map(|tag| {
            let (r, c) = at(tag)?;
            let offset = Vector2::new(c as f64 - col as f64, r as f64 - row as f64);
            Some((offset, tag.center(), 1.0 / (1.0 + offset.norm_squared())))
        })
        .collect();
    let total: f64 = weighted.iter().map(|w| w.2).sum();
    let from = weighted.iter().map(|w| w.0 * w.2).sum::<Vector2<f64>>() / total;
    let to = weighted.iter().map(|w| w.1 * w.2).sum::<Vector2<f64>>() / total;
    let (mut normal, mut right) = (Matrix2::zeros(), Matrix2::zeros());
    for (offset, center, weight) in &weighted {
        let offset = offset - from;
        normal += offset * offset.transpose() * *weight;
        right += (center - to) * offset.transpose() * *weight;
    }
    Some(right * normal.try_inverse()?)
}

/// Whether a tag lies where most of the tags nearest to it have it.
fn agreeing(
    tags: &[Tag],
    at: impl Fn(&Tag) -> Option<(usize, usize)>,
    tag: &Tag,
    (row, col): (usize, usize),
    step: &Matrix2<f64>,
) -> bool {
    let mut others: Vec<(f64, f64)> = tags
        .iter()
        .filter(|other| other.code.id != tag.code.id)
        .filter_map(|other| {
            let (r, c) = at(other)?;
            let offset = Vector2::new(c as f64 - col as f64, r as f64 - row as f64);
            let aside = (step * offset - (other.center() - tag.center())).norm();
            let side = (tag.corners[1] - tag.corners[0]).norm();
            Some((offset.norm(), aside / side / offset.norm().max(1.0)))
        })
        .collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0));
    let near = &others[..others.len().min(4)];
    let agree = near.iter().filter(|(_, aside)| *aside < MAX_ASIDE).count();
    2 * agree >= near.len()
}

/// The corners of the tags, and the cells inside them that are none.
fn crossings(grid: &AprilGrid, border: TagBorder) -> Crossings {
    let border_mm = grid.border_mm(border);
    let gap = grid.spacing * grid.tag_mm;
    let mut all = Vec::new();
    for row in 0..2 * grid.rows {
        for col in 0..2 * grid.cols {
            let [x, y] = grid.corner_mm(row, col);
            all.push(Crossing {
                label: (row, col),
                at: Vector2::new(x, y),
                dark_before: row % 2 == col % 2,
            });
        }
    }
    let mut covers = Vec::new();
    for row in 0..grid.rows {
        for col in 0..grid.cols {
            let [x, y] = grid.corner_mm(2 * row, 2 * col);
            let (from, to) = (border_mm, grid.tag_mm - border_mm);
            covers.push([x + from, x + to, y + from, y + to]);
        }
    }
    Crossings {
        all,
        clear: border_mm.min(gap),
        reach: (REACH * gap).min(0.5 * grid.tag_mm),
        covers,
    }
}

/// What the quadrilaterals are instead, if they are markers of a dictionary.
fn other_tags(
    image: &GrayImage,
    quads: &[[Vector2<f64>; 4]],
    stated: &AprilGrid,
) -> Option<Refusal> {
    let of = |codes: Codes| {
        let with = |border: TagBorder| {
            let placed = Placed {
                side: codes.side(),
                ..placed(stated, border)
            };
            let exact = tags(image, quads, &codes, placed, 0..codes.count());
            exact.iter().filter(|tag| tag.code.wrong_cells == 0).count()
        };
        (with(TagBorder::One).max(with(TagBorder::Two)), codes)
    };
    let all = Codes::names().iter().filter_map(|name| Codes::named(name));
    let mut best: Option<(usize, Codes)> = None;
    for (count, codes) in all.map(of) {
        // Of equals the smaller dictionary: the larger ones begin with the same markers.
        let better = best.is_none_or(|(most, known)| {
            count > most || (count == most && codes.count() < known.count())
        });
        if better {
            best = Some((count, codes));
        }
    }
    let (count, codes) = best.filter(|(count, _)| *count >= MIN_TAGS)?;
    Some(Refusal::OtherBoard {
        stated: format!(
            "a grid of {} x {} tags of {} from {} on",
            stated.rows,
            stated.cols,
            stated.codes.name(),
            stated.first_id
        ),
        seen: SeenBoard::Markers {
            dictionary: codes.name(),
            count,
        },
    })
}
