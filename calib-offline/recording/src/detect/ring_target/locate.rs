//! One image from pixels to labelled marker centers, step by step.

use super::candidates::Sought;
use super::grid::{Cells, Node, largest_grid};
use super::local_map::{LocalMap, MIN_POINTS};
use super::located::{LabelledMarker, Located, quarter_turns};
use super::markers::{
    Marker, Markers, checked_cells, complete, corrected, fitted_candidates, grid_point,
    leave_out_poor, node,
};
use super::placement::{Sized, Verdict, place};
use super::ring_fit::FittedRing;
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
    let count = target.marker_count();
    let rings = fitted_candidates(image, Sought::Rings, count, radii.reach);
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
    let printed = radii.markers(target);
    complete(image, &printed, radii.reach, &mut labelled);
    let rounds = settings.correction_rounds;
    let markers: Vec<LabelledMarker> = corrected(image, &printed, radii.reach, rounds, &labelled)
        .into_iter()
        .filter_map(|((row, col), ring)| {
            Some(LabelledMarker {
                row,
                col,
                ring,
                uncorrected: labelled.get(&(row, col))?.pixel,
            })
        })
        .collect();
    if markers.len() < MIN_POINTS {
        let (have, need) = (markers.len(), MIN_POINTS);
        return Err(TargetRefusal::TooFewMarkers { have, need });
    }
    Ok(Located {
        quarter_turns: quarter_turns(&labelled),
        markers,
    })
}

/// The markers as they are printed, in pitches.
pub fn printed(target: &TargetSpec) -> Markers {
    Radii::of(target).markers(target)
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

    fn markers(&self, target: &TargetSpec) -> Markers {
        let labels = (0..target.rows).flat_map(|row| (0..target.cols).map(move |col| (row, col)));
        labels
            .map(|(row, col)| {
                let outer = if target.is_direction(row, col) {
                    self.direction
                } else {
                    self.ordinary
                };
                let marker = Marker {
                    at: Vector2::new(col as f64, row as f64),
                    outer,
                    hollow: true,
                };
                ((row, col), marker)
            })
            .collect()
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
