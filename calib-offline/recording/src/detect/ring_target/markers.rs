//! All markers of a grid together: candidates, the smooth map through them, those that are missing, and
//! the fit anew with what perspective and lens do to each edge.

use super::candidates::{RingGuess, Sought, candidates};
use super::components::Polarity;
use super::grid::{Cells, Node};
use super::local_map::LocalMap;
use super::located::at;
use super::perspective::edge_offsets;
use super::ring_fit::{FittedRing, shape_of_circle};
use super::ring_model::EdgeOffsets;
use crate::dataset::image::GrayImage;
use calib_rays::numerics::median;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Row and column.
pub type Label = (usize, usize);

/// A marker as it is printed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marker {
    /// Its middle in the target's plane, in pitches.
    pub at: Vector2<f64>,
    /// Its outer radius in pitches.
    pub outer: f64,
    /// Whether it has a hole.
    pub hollow: bool,
}

/// The markers of a target by label.
pub type Markers = BTreeMap<Label, Marker>;

/// A marker whose fit leaves this many times the usual residual is covered in part, or lit by a
/// reflection.
const MAX_RESIDUAL_RATIO: f64 = 3.0;
/// A marker this far (pitches) from where the others have it is none of the grid.
const MAX_ASIDE: f64 = 0.06;
/// More candidates than this for each marker of the target are not looked at.
const CANDIDATES_PER_MARKER: usize = 8;
/// A missing marker's size may differ from the expected one by this factor.
const MAX_SIZE: f64 = 1.12;
/// Inner against outer radius of a hollow marker if none was found.
const USUAL_RATIO: f64 = 0.45;

/// All fitted candidates of the polarity that has more of them, for a target of `count` markers.
pub fn fitted_candidates(
    image: &GrayImage,
    sought: Sought,
    count: usize,
    reach: f64,
) -> Vec<FittedRing> {
    let guesses = candidates(image, sought, count, CANDIDATES_PER_MARKER * count);
    let fit = |polarity: Polarity| -> Vec<FittedRing> {
        let of_polarity = guesses.iter().filter(|guess| guess.polarity == polarity);
        of_polarity
            .filter_map(|guess| {
                let as_seen = FittedRing::fit(image, guess, &EdgeOffsets::NONE, reach);
                // A disk wider than the window it was compared with seems to have a hole.
                as_seen.or_else(|| {
                    let full = RingGuess {
                        ratio: 0.0,
                        ..*guess
                    };
                    let is_sought = sought == Sought::RingsAndDisks && guess.ratio > 0.0;
                    is_sought
                        .then(|| FittedRing::fit(image, &full, &EdgeOffsets::NONE, reach))
                        .flatten()
                })
            })
            .collect()
    };
    let (dark, bright) = (fit(Polarity::Dark), fit(Polarity::Bright));
    if dark.len() >= bright.len() {
        dark
    } else {
        bright
    }
}

/// A ring as the search for neighbors sees it.
pub fn node(ring: &FittedRing) -> Node {
    Node {
        center: at(ring.pixel),
        shape: ring.shape,
    }
}

/// A cell as a point.
pub fn grid_point((col, row): (i64, i64)) -> Vector2<f64> {
    Vector2::new(col as f64, row as f64)
}

/// The cells without those that lie aside of a smooth map through all, and that map. If they are
/// too few for one: how many there are.
///
/// # Errors
/// How many there are, if they are too few for a map.
pub fn checked_cells(rings: &[FittedRing], mut cells: Cells) -> Result<(Cells, LocalMap), usize> {
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

/// Leaves out markers whose fit is much worse than most.
pub fn leave_out_poor(labelled: &mut BTreeMap<Label, FittedRing>) {
    if let Some(usual) = median(labelled.values().map(|ring| ring.residual_rms)) {
        labelled.retain(|_, ring| ring.residual_rms <= MAX_RESIDUAL_RATIO * usual);
    }
}

/// The map from the target's plane (pitches) through labelled markers.
pub fn target_map(markers: &Markers, labelled: &BTreeMap<Label, FittedRing>) -> Option<LocalMap> {
    let pairs: Vec<_> = labelled
        .iter()
        .filter_map(|(label, ring)| Some((markers.get(label)?.at, at(ring.pixel))))
        .collect();
    LocalMap::fit(&pairs)
}

/// Looks for the markers that are still missing where the others say that they are.
pub fn complete(
    image: &GrayImage,
    markers: &Markers,
    reach: f64,
    labelled: &mut BTreeMap<Label, FittedRing>,
) {
    let Some(map) = target_map(markers, labelled) else {
        return;
    };
    let rings = || labelled.values();
    let (Some(usual), Some(first)) = (
        median(rings().map(|ring| ring.residual_rms)),
        rings().next(),
    ) else {
        return;
    };
    let hollow_ratios = rings().map(|ring| ring.ratio).filter(|ratio| *ratio > 0.0);
    let hollow = median(hollow_ratios).unwrap_or(USUAL_RATIO);
    let polarity = first.as_guess().polarity;
    let mut added = Vec::new();
    for (&label, marker) in markers {
        if labelled.contains_key(&label) {
            continue;
        }
        let px_from_grid = map.derivative(&marker.at);
        let guess = RingGuess {
            center: map.at(&marker.at),
            shape: shape_of_circle(&px_from_grid, marker.outer),
            ratio: if marker.hollow { hollow } else { 0.0 },
            polarity,
        };
        let Some(ring) = FittedRing::fit(image, &guess, &EdgeOffsets::NONE, reach) else {
            continue;
        };
        let pitch_px = px_from_grid.determinant().abs().sqrt();
        let aside = (at(ring.pixel) - guess.center).norm() / pitch_px;
        let size = ring.mean_radius_px() / guess.mean_radius_px();
        let is_marker = aside <= MAX_ASIDE
            && (1.0 / MAX_SIZE..MAX_SIZE).contains(&size)
            && ring.residual_rms <= MAX_RESIDUAL_RATIO * usual;
        if is_marker {
            added.push((label, ring));
        }
    }
    labelled.extend(added);
}

/// The markers fitted anew with what the map does to each edge, as often as asked for.
pub fn corrected(
    image: &GrayImage,
    markers: &Markers,
    reach: f64,
    rounds: usize,
    labelled: &BTreeMap<Label, FittedRing>,
) -> BTreeMap<Label, FittedRing> {
    let mut rings = labelled.clone();
    for _ in 0..rounds {
        let Some(map) = target_map(markers, &rings) else {
            break;
        };
        rings = rings
            .into_iter()
            .filter_map(|(label, ring)| {
                let marker = markers.get(&label)?;
                let inner = marker.outer * ring.ratio;
                let offsets = edge_offsets(&map, &marker.at, marker.outer, inner)?;
                let ring = FittedRing::fit(image, &ring.as_guess(), &offsets, reach)?;
                Some((label, ring))
            })
            .collect();
    }
    rings
}
