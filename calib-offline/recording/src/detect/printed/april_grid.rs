//! The grid of `AprilTags`: tags are found as dark quadrilaterals and read; their numbers say where they lie.
//!
//! Numbers may grow upwards (Kalibr) or downwards from row to row: which one, the image tells, because
//! labels turn in the image as u and v do. So it is with the black around the codes, one cell or Kalibr's two.
//! Nothing rests on the turn of the tags: `OpenCV` prints them upside down. The corners of the tags are then
//! fitted as crossings with the small squares between the tags.

use super::cells::{Placed, read};
use super::ends::print_ends;
use super::found::{Found, PrintedTarget};
use super::instead::{self, Stated};
use super::quads::quads;
use super::saddles::{self, Crossing, Crossings, Label};
use crate::dataset::image::GrayImage;
use crate::detect::homography::Homography;
use crate::detect::seen_board::SeenKind;
use crate::detect::settings::DetectSettings;
use crate::detect::turning::turns_like_image;
use crate::detect::verdict::{Refusal, why_nothing_found};
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::median;
use calib_rays::observed::Corner;
use calib_rays::print::{AprilGrid, Code, Codes, TagBorder, TagOrder};
use nalgebra::{Matrix2, Vector2};
use std::collections::{BTreeMap, BTreeSet};

/// The manifest's word for it.
const KIND: &str = "aprilgrid";

/// Tags that must be seen; fewer leave no map.
const MIN_TAGS: usize = 3;
/// A tag this far, in its own sides, from where the others have it is none of the grid.
const MAX_ASIDE: f64 = 0.35;
/// So many tags must lie where their numbers say for each that does not.
const TAGS_PER_CONTRADICTION: usize = 6;
/// A tag's corners may lie this far, in its half sides, from where its sides' steps have them.
const MAX_SHEAR: f64 = 0.45;
/// Tags are farther apart or nearer than stated beyond this share of their side, ...
const OTHER_SPACING: f64 = 0.01;
/// ... if so many pairs of them tell it.
const MIN_SPACINGS: usize = 6;
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
        let (border, (tags, beyond)) = if two.1.0.len() > one.1.0.len() {
            two
        } else {
            one
        };
        let other =
            |refusal: Refusal| instead::other(image, &Stated::april_grid(self)).unwrap_or(refusal);
        if tags.len() < MIN_TAGS {
            return Err(other(why_nothing_found(image, KIND)));
        }
        let without_corners = Refusal::TagsWithoutCorners { tags: tags.len() };
        // A tag or two may be another object's; numbers that the grid does not have are another grid's.
        if beyond * TAGS_PER_CONTRADICTION > tags.len() {
            return Err(other(without_corners));
        }
        let (rough, placed_count) = rough_corners(self, &tags).map_err(&other)?;
        if (tags.len() - placed_count) * TAGS_PER_CONTRADICTION > tags.len() {
            return Err(other(without_corners));
        }
        let crossings = crossings(self, border);
        let fitted = saddles::fit(image, &crossings, &rough, settings.max_half_window_px)
            .filter(|fitted| !fitted.is_empty());
        let Some(fitted) = fitted else {
            return Err(other(without_corners));
        };
        let pixels: BTreeMap<Label, Vector2<f64>> = fitted
            .iter()
            .map(|(&label, c)| (label, Vector2::new(c.pixel.u, c.pixel.v)))
            .collect();
        if let Some(refusal) = self.other_spacing(image, &pixels) {
            return Err(refusal);
        }
        if ends_early(image, self, &crossings, &pixels) {
            return Err(other(without_corners));
        }
        Found::of_corners(image, &crossings, &fitted, self.tag_mm).ok_or(without_corners)
    }
}

trait Measured {
    fn other_spacing(
        &self,
        image: &GrayImage,
        corners: &BTreeMap<Label, Vector2<f64>>,
    ) -> Option<Refusal>;
}

impl Measured for AprilGrid {
    /// The refusal of a grid whose tags are clearly farther apart, or less far, than stated.
    fn other_spacing(
        &self,
        image: &GrayImage,
        corners: &BTreeMap<Label, Vector2<f64>>,
    ) -> Option<Refusal> {
        let (spacing, count) = instead::spacing_of(corners)?;
        if count < MIN_SPACINGS || (spacing - self.spacing).abs() <= OTHER_SPACING {
            return None;
        }
        let stated = Stated::april_grid(self);
        let refusal = instead::other(image, &stated);
        Some(refusal.unwrap_or_else(|| {
            let mut seen = stated.board.clone();
            if let SeenKind::AprilGrid { spacing: apart, .. } = &mut seen.kind {
                *apart = Some(spacing);
            }
            instead::refusal(seen, &stated)
        }))
    }
}

/// Whether the image shows white where the next row or column of tags would be.
fn ends_early(
    image: &GrayImage,
    grid: &AprilGrid,
    crossings: &Crossings,
    corners: &BTreeMap<Label, Vector2<f64>>,
) -> bool {
    let Some(map) = crossings.map(corners) else {
        return false;
    };
    let tags: BTreeSet<Label> = corners.keys().map(|(r, c)| (r / 2, c / 2)).collect();
    // The border of a tag, one cell wide or two, and the white beside it.
    let cell = grid.border_mm(TagBorder::One);
    let value = |(row, col): Label, aside: f64| {
        let [x, y] = grid.corner_mm(2 * row, 2 * col);
        let (low, high) = (aside, grid.tag_mm - aside);
        let places = [0.3, 0.5, 0.7].map(|part| part * grid.tag_mm);
        let mut sum = 0.0;
        for along in places {
            for (dx, dy) in [(along, low), (along, high), (low, along), (high, along)] {
                let pixel = map.at(&Vector2::new(x + dx, y + dy));
                sum += image.between(pixel.x, pixel.y)? / 12.0;
            }
        }
        Some(sum)
    };
    let gap = 0.5 * grid.spacing.min(0.4) * grid.tag_mm;
    let usual = |aside: f64| median(tags.iter().filter_map(|&tag| value(tag, aside)));
    let (Some(black), Some(white)) = (usual(0.5 * cell), usual(-gap)) else {
        return false;
    };
    print_ends((grid.rows, grid.cols), &tags, |tag| {
        Some(value(tag, 0.5 * cell)? > black + 0.6 * (white - black))
    })
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

/// The tags of a dictionary that are in the image once, and how many there are without a wrong cell whose numbers
/// are none of `ids`.
fn tags(
    image: &GrayImage,
    quads: &[[Vector2<f64>; 4]],
    codes: &Codes,
    placed: Placed,
    ids: std::ops::Range<usize>,
) -> (Vec<Tag>, usize) {
    let mut by_id: BTreeMap<usize, Vec<Tag>> = BTreeMap::new();
    let mut beyond = 0;
    for &corners in quads {
        let read = Homography::of_unit_square(corners).and_then(|map| read(image, &map, placed));
        let Some(read) = read else { continue };
        if let Some(code) = codes.nearest(read.cells, ids.clone(), codes.correctable()) {
            let tag = Tag { code, corners };
            by_id.entry(code.id).or_default().push(tag);
        } else {
            let exact = codes.nearest(read.cells, 0..codes.count(), 0);
            beyond += usize::from(exact.is_some());
        }
    }
    // A number that is there twice belongs to two boards, or is a mistake.
    let single = by_id.into_values().filter(|tags| tags.len() == 1);
    (single.flatten().collect(), beyond)
}

/// The tags' corners by label, and how many of the tags lie where their numbers say.
fn rough_corners(
    grid: &AprilGrid,
    tags: &[Tag],
) -> Result<(BTreeMap<Label, Vector2<f64>>, usize), Refusal> {
    let order = order(grid, tags).ok_or(Refusal::TagsInLine { tags: tags.len() })?;
    let at = |tag: &Tag| grid.place_of(tag.code.id, order);
    let mut corners = BTreeMap::new();
    let mut placed_count = 0;
    let half = 0.5 / (1.0 + grid.spacing);
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
        let offsets = tag
            .corners
            .map(|corner| step_from_px * (corner - tag.center()));
        // A grid with another number of columns is sheared: its tags' sides do not follow its steps.
        let is_square = offsets
            .iter()
            .all(|offset| offset.map(|x| (x.abs() / half - 1.0).abs()).amax() < MAX_SHEAR);
        if !agrees || !is_square {
            continue;
        }
        placed_count += 1;
        for (corner, offset) in tag.corners.into_iter().zip(offsets) {
            let label = (
                2 * row + usize::from(offset.y > 0.0),
                2 * col + usize::from(offset.x > 0.0),
            );
            corners.insert(label, corner);
        }
    }
    Ok((corners, placed_count))
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
