//! One image from pixels to labelled marker centers, step by step.

use super::candidates::{RingGuess, ring_candidates};
use super::components::Polarity;
use super::grid::{Cells, Node, largest_grid};
use super::local_map::{LocalMap, MIN_POINTS};
use super::located::{LabelledMarker, Located, at, quarter_turns};
use super::perspective::edge_offsets;
use super::placement::{Sized, Verdict, place};
use super::ring_fit::{FittedRing, shape_of_circle};
use super::ring_model::EdgeOffsets;
use super::settings::TargetSettings;
use super::verdict::TargetRefusal;
use crate::dataset::TargetSpec;
use crate::dataset::image::GrayImage;
use crate::detect::illegible::{Illegible, Shown};
use calib_rays::numerics::median;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// The window around a marker ends here at the latest, outer radii from its middle.
const MAX_REACH: f64 = 1.5;
/// More candidates than this for each marker of the target are not looked at.
const CANDIDATES_PER_MARKER: usize = 8;
/// A marker whose fit leaves this many times the usual residual is covered in part, or lit by a
/// reflection.
const MAX_RESIDUAL_RATIO: f64 = 3.0;
/// A marker this far (pitches) from where the others have it is none of the grid.
const MAX_ASIDE: f64 = 0.06;
/// Outer radii that may still be meant, against the stated ones.
const SIZE_RANGE: (f64, f64) = (0.85, 1.15);
/// Edges blurred (standard deviation) by more than this part of a ring's width run into each
/// other.
const MAX_BLUR: f64 = 0.5;

/// Finds the target in an image and labels its markers.
///
/// # Errors
/// [`TargetRefusal`]: why the markers cannot be found, or not be numbered without doubt.
pub fn locate(
    image: &GrayImage,
    target: &TargetSpec,
    settings: &TargetSettings,
) -> Result<Located, TargetRefusal> {
    let radii = Radii::of(target);
    let rings = fitted_candidates(image, target, &radii);
    let nodes: Vec<Node> = rings.iter().map(node).collect();
    let cells = largest_grid(&nodes, (radii.ordinary, radii.direction));
    let (cells, map) = checked_cells(&rings, cells)
        .map_err(|have| TargetRefusal::too_few(image, rings.len(), have, MIN_POINTS))?;
    check_blur(cells.keys().map(|&i| &rings[i]))?;

    let sized = sizes(&rings, &cells, &map, &radii)?;
    let markers: Vec<Sized> = sized.values().copied().collect();
    let placement = match place(&markers, target) {
        Verdict::Placed(placement) => placement,
        Verdict::Ambiguous(placement_count) => {
            return Err(TargetRefusal::AmbiguousDirection {
                marker_count: markers.len(),
                placement_count,
            });
        }
        Verdict::Mirrored => return Err(TargetRefusal::Mirrored),
        Verdict::Nowhere(contradictions) => {
            return Err(TargetRefusal::WrongTarget {
                rows: target.rows,
                cols: target.cols,
                contradictions,
                marker_count: markers.len(),
            });
        }
    };
    let mut labelled: BTreeMap<(usize, usize), FittedRing> = sized
        .iter()
        .filter_map(|(&i, marker)| {
            let (row, col) = placement.row_col(marker.cell, target)?;
            let agrees = target.is_direction(row, col) == marker.is_large;
            agrees.then_some(((row, col), rings[i]))
        })
        .collect();
    leave_out_poor(&mut labelled);
    complete(image, target, &radii, &mut labelled);
    let markers = corrected(image, target, &radii, settings, &labelled);
    if markers.len() < MIN_POINTS {
        let (have, need) = (markers.len(), MIN_POINTS);
        return Err(TargetRefusal::TooFewMarkers { have, need });
    }
    Ok(Located {
        quarter_turns: quarter_turns(&labelled),
        markers,
    })
}

/// Lengths of the target in pitches.
struct Radii {
    ordinary: f64,
    direction: f64,
    /// How far a window may go, in outer radii: midway to the next marker.
    reach: f64,
}

impl Radii {
    fn of(target: &TargetSpec) -> Self {
        let direction = target.direction_outer_radius_mm / target.pitch_mm;
        Self {
            ordinary: target.outer_radius_mm / target.pitch_mm,
            direction,
            reach: (0.5 / direction).min(MAX_REACH),
        }
    }

    fn outer(&self, target: &TargetSpec, (row, col): (usize, usize)) -> f64 {
        if target.is_direction(row, col) {
            self.direction
        } else {
            self.ordinary
        }
    }
}

/// All rings of the polarity that has more of them.
fn fitted_candidates(image: &GrayImage, target: &TargetSpec, radii: &Radii) -> Vec<FittedRing> {
    let count = target.marker_count();
    let guesses = ring_candidates(image, count, CANDIDATES_PER_MARKER * count);
    let fit = |polarity: Polarity| -> Vec<FittedRing> {
        let of_polarity = guesses.iter().filter(|guess| guess.polarity == polarity);
        of_polarity
            .filter_map(|guess| FittedRing::fit(image, guess, &EdgeOffsets::NONE, radii.reach))
            .collect()
    };
    let (dark, bright) = (fit(Polarity::Dark), fit(Polarity::Bright));
    if dark.len() >= bright.len() {
        dark
    } else {
        bright
    }
}

fn node(ring: &FittedRing) -> Node {
    Node {
        center: at(ring.pixel),
        shape: ring.shape,
    }
}

fn grid_point((col, row): (i64, i64)) -> Vector2<f64> {
    Vector2::new(col as f64, row as f64)
}

/// The cells without those that lie aside of a smooth map through all, and that map. If they are
/// too few for one: how many there are.
fn checked_cells(rings: &[FittedRing], mut cells: Cells) -> Result<(Cells, LocalMap), usize> {
    loop {
        let pairs: Vec<_> = cells
            .iter()
            .map(|(&i, &cell)| (grid_point(cell), at(rings[i].pixel)))
            .collect();
        let map = LocalMap::fit(&pairs).ok_or(cells.len())?;
        let aside = |(i, cell): (&usize, &(i64, i64))| {
            let grid = grid_point(*cell);
            let pitch_px = map.derivative(&grid).determinant().abs().sqrt();
            (map.at(&grid) - at(rings[*i].pixel)).norm() / pitch_px
        };
        let worst = cells.iter().map(|cell| (*cell.0, aside(cell)));
        match worst.max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((i, worst)) if !(worst <= MAX_ASIDE) => cells.remove(&i),
            _ => return Ok((cells, map)),
        };
    }
}

fn check_blur<'a>(
    rings: impl Iterator<Item = &'a FittedRing> + Clone,
) -> Result<(), TargetRefusal> {
    let blur = median(rings.clone().map(|ring| ring.blur_px));
    let width = median(rings.map(|ring| ring.mean_radius_px() * (1.0 - ring.ratio)));
    match (blur, width) {
        (Some(blur), Some(width)) if blur > MAX_BLUR * width => {
            Err(Illegible::blurred(blur, Shown::Target).into())
        }
        _ => Ok(()),
    }
}

/// Which markers are large; by index of the ring. Those of neither size are left out.
fn sizes(
    rings: &[FittedRing],
    cells: &Cells,
    map: &LocalMap,
    radii: &Radii,
) -> Result<BTreeMap<usize, Sized>, TargetRefusal> {
    let between = (radii.ordinary * radii.direction).sqrt();
    let size = |i: usize, cell: (i64, i64)| {
        let pitch_px = map.derivative(&grid_point(cell)).determinant().abs().sqrt();
        rings[i].mean_radius_px() / pitch_px
    };
    let is_meant = |size: f64| {
        (SIZE_RANGE.0 * radii.ordinary..=SIZE_RANGE.1 * radii.direction).contains(&size)
    };
    let found = median(cells.iter().map(|(&i, &cell)| size(i, cell))).unwrap_or(0.0);
    if !is_meant(found) {
        return Err(TargetRefusal::WrongSize {
            found,
            ordinary: radii.ordinary,
            direction: radii.direction,
        });
    }
    Ok(cells
        .iter()
        .filter(|&(&i, &cell)| is_meant(size(i, cell)))
        .map(|(&i, &cell)| {
            let is_large = size(i, cell) > between;
            (i, Sized { cell, is_large })
        })
        .collect())
}

/// Leaves out markers whose fit is much worse than most.
fn leave_out_poor(labelled: &mut BTreeMap<(usize, usize), FittedRing>) {
    if let Some(usual) = median(labelled.values().map(|ring| ring.residual_rms)) {
        labelled.retain(|_, ring| ring.residual_rms <= MAX_RESIDUAL_RATIO * usual);
    }
}

fn label_point((row, col): (usize, usize)) -> Vector2<f64> {
    Vector2::new(col as f64, row as f64)
}

fn target_map(labelled: &BTreeMap<(usize, usize), FittedRing>) -> Option<LocalMap> {
    let pairs: Vec<_> = labelled
        .iter()
        .map(|(&label, ring)| (label_point(label), at(ring.pixel)))
        .collect();
    LocalMap::fit(&pairs)
}

/// Looks for the markers that are still missing where the others say that they are.
fn complete(
    image: &GrayImage,
    target: &TargetSpec,
    radii: &Radii,
    labelled: &mut BTreeMap<(usize, usize), FittedRing>,
) {
    let Some(map) = target_map(labelled) else {
        return;
    };
    let rings = || labelled.values();
    let (Some(ratio), Some(usual), Some(first)) = (
        median(rings().map(|ring| ring.ratio)),
        median(rings().map(|ring| ring.residual_rms)),
        rings().next(),
    ) else {
        return;
    };
    let polarity = first.as_guess().polarity;
    let mut added = Vec::new();
    for label in (0..target.rows).flat_map(|row| (0..target.cols).map(move |col| (row, col))) {
        if labelled.contains_key(&label) {
            continue;
        }
        let point = label_point(label);
        let px_from_grid = map.derivative(&point);
        let guess = RingGuess {
            center: map.at(&point),
            shape: shape_of_circle(&px_from_grid, radii.outer(target, label)),
            ratio,
            polarity,
        };
        let Some(ring) = FittedRing::fit(image, &guess, &EdgeOffsets::NONE, radii.reach) else {
            continue;
        };
        let pitch_px = px_from_grid.determinant().abs().sqrt();
        let aside = (at(ring.pixel) - guess.center).norm() / pitch_px;
        let size = ring.mean_radius_px() / guess.mean_radius_px();
        // Midway between the two sizes at most.
        let size_tolerance = (radii.direction / radii.ordinary).sqrt();
        let is_marker = aside <= MAX_ASIDE
            && (1.0 / size_tolerance..size_tolerance).contains(&size)
            && ring.residual_rms <= MAX_RESIDUAL_RATIO * usual;
        if is_marker {
            added.push((label, ring));
        }
    }
    labelled.extend(added);
}

/// The markers fitted anew with what the perspective does to each edge, as often as asked for.
fn corrected(
    image: &GrayImage,
    target: &TargetSpec,
    radii: &Radii,
    settings: &TargetSettings,
    labelled: &BTreeMap<(usize, usize), FittedRing>,
) -> Vec<LabelledMarker> {
    let mut rings = labelled.clone();
    for _ in 0..settings.correction_rounds {
        let Some(map) = target_map(&rings) else {
            break;
        };
        rings = rings
            .into_iter()
            .filter_map(|(label, ring)| {
                let outer = radii.outer(target, label);
                let offsets = edge_offsets(&map, &label_point(label), outer, outer * ring.ratio)?;
                let ring = FittedRing::fit(image, &ring.as_guess(), &offsets, radii.reach)?;
                Some((label, ring))
            })
            .collect();
    }
    rings
        .into_iter()
        .filter_map(|(label, ring)| {
            Some(LabelledMarker {
                row: label.0,
                col: label.1,
                ring,
                uncorrected: labelled.get(&label)?.pixel,
            })
        })
        .collect()
}
