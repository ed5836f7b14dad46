//! Grids of circles: every circle's outline is fitted, and its center corrected for what perspective
//! and lens do to the middle of an outline.
//!
//! Circles are joined to a square lattice from neighbor to neighbor; that of an asymmetric grid stands
//! on its corner. Where the lattice lies is decided by how far it reaches and by the marked circles: those
//! with a hole, or clearly larger or smaller than most. A grid that looks the same after a turn gets the
//! numbering whose columns count to the right in the image, or nearest to it.

use super::ends::circles_end;
use super::found::{Found, PrintedTarget, quarter_turns};
use super::instead::{self, Stated};
use super::smooth::keep_smooth;
use crate::dataset::image::GrayImage;
use crate::detect::illegible::EDGE_WIDTH_OF_BLUR;
use crate::detect::ring_target::candidates::Sought;
use crate::detect::ring_target::grid::{Cells, largest_grid};
use crate::detect::ring_target::local_map::{LocalMap, MIN_POINTS};
use crate::detect::ring_target::markers::{
    Label, Marker, Markers, checked_cells, complete, corrected, fitted_candidates, grid_point,
    leave_out_poor, node, target_map,
};
use crate::detect::ring_target::ring_fit::FittedRing;
use crate::detect::settings::DetectSettings;
use crate::detect::verdict::{ImageFigures, Refusal, why_nothing_found};
use calib_rays::numerics::median;
use calib_rays::observed::Corner;
use calib_rays::print::Circles;
use nalgebra::Vector2;
use std::collections::BTreeMap;
use std::f64::consts::SQRT_2;

/// The manifest's word for it.
const KIND: &str = "circles";

/// The window around a circle ends here at the latest, radii from its middle.
const MAX_REACH: f64 = 1.6;
/// How often centers are corrected; the second time the map is free of the first error.
const CORRECTIONS: usize = 2;
/// A circle so much larger or smaller than most is marked.
const MARKED_SIZE: f64 = 1.15;
/// One circle in so many, and no more than two, may lie off the grid.
const CIRCLES_PER_STRAY: usize = 20;
const MAX_STRAYS: usize = 2;
/// So many circles are marked as stated for each that is not.
const MARKS_PER_CONTRADICTION: usize = 5;
/// A diameter is another one beyond this.
const OTHER_DIAMETER: f64 = 1.15;

/// The residual of a circle's fit may be so many times the usual one, ...
const MAX_RESIDUAL_OF_MEDIAN: f64 = 1.5;
/// ... and this part of its contrast more: dust, and light that is not a plane.
const LEAST_RESIDUAL: f64 = 0.01;

/// A circle of the lattice.
#[derive(Debug, Clone, Copy)]
struct Seen {
    cell: (i64, i64),
    /// `None` where it is unclear: something covers it in part.
    is_marked: Option<bool>,
}

/// A circle of the turned lattice, in pitches, and whether it is marked.
type Turned = ((i64, i64), Option<bool>);

/// A place of the lattice on the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    quarter_turns: u8,
    shift: (i64, i64),
}

impl PrintedTarget for Circles {
    fn find(&self, image: &GrayImage, _: &DetectSettings) -> Result<Found, Refusal> {
        let spacing = if self.asymmetric { SQRT_2 } else { 1.0 };
        // In steps of the lattice.
        let radius = self.diameter_mm / 2.0 / self.pitch_mm / spacing;
        let reach = ((1.0 - radius) / radius)
            .min(0.5 / radius)
            .clamp(1.15, MAX_REACH);
        let count = self.rows * self.cols;
        let rings = fitted_candidates(image, Sought::RingsAndDisks, count, reach);
        let nodes: Vec<_> = rings.iter().map(node).collect();
        let cells = largest_grid(&nodes, (radius, radius));
        let other =
            |refusal: Refusal| instead::other(image, &Stated::circles(self)).unwrap_or(refusal);
        let (cells, map) =
            checked_cells(&rings, cells).map_err(|_| other(why_nothing_found(image, KIND)))?;
        let measured = instead::measured_diameter(&rings, &cells, &map).unwrap_or(0.0);
        let hollow = cells.keys().filter(|i| rings[**i].ratio > 0.0).count();
        let as_wide = 1.0 / OTHER_DIAMETER..OTHER_DIAMETER;
        if 2 * hollow > cells.len() || !as_wide.contains(&(measured / (2.0 * radius))) {
            return Err(other(Refusal::NoBoard { kind: KIND }));
        }
        let seen = marked(&rings, &cells, &map);
        let place = self.placed(&seen, &map).map_err(&other)?;
        let mut labelled: BTreeMap<Label, FittedRing> = cells
            .iter()
            .filter_map(|(&i, &cell)| Some((self.label(cell, &place)?, rings[i])))
            .collect();
        leave_out_poor(&mut labelled);
        let markers = self.markers(&labelled);
        complete(image, &markers, reach, &mut labelled);
        let mut labelled = corrected(image, &markers, reach, CORRECTIONS, &labelled);
        keep_uncovered(&mut labelled);
        let mut pixels: BTreeMap<Label, Vector2<f64>> = labelled
            .iter()
            .map(|(&label, ring)| (label, Vector2::new(ring.pixel.u, ring.pixel.v)))
            .collect();
        keep_smooth(&mut pixels, |label| markers.get(label).map(|m| m.at));
        labelled.retain(|label, _| pixels.contains_key(label));
        if labelled.len() < MIN_POINTS {
            return Err(other(why_nothing_found(image, KIND)));
        }
        if circles_end((self.rows, self.cols), image, &markers, &labelled) {
            return Err(other(Refusal::NoBoard { kind: KIND }));
        }
        self.found(image, &markers, &labelled)
            .ok_or(Refusal::NoBoard { kind: KIND })
    }

    fn numberings(&self) -> u8 {
        let marked = !self.direction.is_empty();
        if marked || (self.asymmetric && !self.rows.is_multiple_of(2)) {
            1
        } else if self.rows == self.cols && !self.asymmetric {
            4
        } else {
            2
        }
    }
}

/// Leaves out circles that something covers in part: their fit is worse than most.
fn keep_uncovered(labelled: &mut BTreeMap<Label, FittedRing>) {
    let relative = |ring: &FittedRing| ring.residual_rms / ring.contrast.abs();
    if let Some(usual) = median(labelled.values().map(relative)) {
        let limit = MAX_RESIDUAL_OF_MEDIAN * usual + LEAST_RESIDUAL;
        labelled.retain(|_, ring| relative(ring) <= limit);
    }
}

/// Which circles of the lattice are marked.
fn marked(rings: &[FittedRing], cells: &Cells, map: &LocalMap) -> Vec<Seen> {
    let size = |i: usize, cell: (i64, i64)| {
        let step_px = map.derivative(&grid_point(cell)).determinant().abs().sqrt();
        rings[i].mean_radius_px() / step_px
    };
    let usual = median(cells.iter().map(|(&i, &cell)| size(i, cell))).unwrap_or(1.0);
    let ordinary = 1.0 / MARKED_SIZE..MARKED_SIZE;
    let residual = |i: usize| rings[i].residual_rms / rings[i].contrast.abs();
    let usual_residual = median(cells.keys().map(|&i| residual(i))).unwrap_or(0.0);
    let limit = MAX_RESIDUAL_OF_MEDIAN * usual_residual + LEAST_RESIDUAL;
    cells
        .iter()
        .map(|(&i, &cell)| {
            let is_marked = !ordinary.contains(&(size(i, cell) / usual)) || rings[i].ratio > 0.0;
            Seen {
                cell,
                is_marked: (residual(i) <= limit).then_some(is_marked),
            }
        })
        .collect()
}

trait OnGrid {
    fn label_at(&self, at: (i64, i64)) -> Option<Label>;
    fn label(&self, cell: (i64, i64), place: &Place) -> Option<Label>;
    fn cell_turned(&self, cell: (i64, i64), quarter_turns: u8) -> (i64, i64);
    fn placed(&self, seen: &[Seen], map: &LocalMap) -> Result<Place, Refusal>;
    fn places(&self, seen: &[Seen]) -> Vec<(usize, Place)>;
    fn contradictions(
        &self,
        turned: &[Turned],
        shift: (i64, i64),
        most_strays: usize,
    ) -> Option<usize>;
    fn markers(&self, labelled: &BTreeMap<Label, FittedRing>) -> Markers;
    fn found(
        &self,
        image: &GrayImage,
        markers: &Markers,
        labelled: &BTreeMap<Label, FittedRing>,
    ) -> Option<Found>;
}

impl OnGrid for Circles {
    /// The circle at a place in pitches.
    fn label_at(&self, (x, y): (i64, i64)) -> Option<Label> {
        let row = usize::try_from(y).ok().filter(|row| *row < self.rows)?;
        let x = usize::try_from(x).ok()?;
        let col = if self.asymmetric {
            let x = x.checked_sub(row % 2)?;
            x.is_multiple_of(2).then_some(x / 2)?
        } else {
            x
        };
        (col < self.cols).then_some((row, col))
    }

    fn label(&self, cell: (i64, i64), place: &Place) -> Option<Label> {
        let (x, y) = self.cell_turned(cell, place.quarter_turns);
        self.label_at((x + place.shift.0, y + place.shift.1))
    }

    /// A cell in pitches, turned.
    fn cell_turned(&self, (a, b): (i64, i64), quarter_turns: u8) -> (i64, i64) {
        let at = if self.asymmetric {
            (a - b, a + b)
        } else {
            (a, b)
        };
        (0..quarter_turns).fold(at, |(x, y), _| (-y, x))
    }

    fn placed(&self, seen: &[Seen], map: &LocalMap) -> Result<Place, Refusal> {
        let places = self.places(seen);
        let Some(&(least, _)) = places.first() else {
            return Err(Refusal::NoBoard { kind: KIND });
        };
        if self.direction.is_empty() {
            // Marks that are not stated.
            let marks = seen.iter().filter(|s| s.is_marked == Some(true)).count();
            if marks * CIRCLES_PER_STRAY >= seen.len() + CIRCLES_PER_STRAY {
                return Err(Refusal::NoBoard { kind: KIND });
            }
        }
        let margin = if self.direction.is_empty() { 1 } else { 2 };
        let close: Vec<Place> = places
            .iter()
            .filter(|(contradictions, _)| *contradictions < least + margin)
            .map(|(_, place)| *place)
            .collect();
        // Turns of the whole grid onto itself are no doubt where nothing marks a direction.
        let mut turns: Vec<u8> = close.iter().map(|place| place.quarter_turns).collect();
        turns.sort_unstable();
        turns.dedup();
        let only_turns = turns.len() == close.len() && self.direction.is_empty();
        if close.len() > 1 && !only_turns {
            return Err(Refusal::AmbiguousCircles {
                circle_count: seen.len(),
                placement_count: close.len(),
            });
        }
        let to_the_right = |place: &Place| {
            // The image of the grid's x axis: what turns onto it.
            let back = (0..(4 - place.quarter_turns) % 4).fold((1.0, 0.0), |(x, y), _| (-y, x));
            let along = if self.asymmetric {
                Vector2::new(back.0 + back.1, back.1 - back.0)
            } else {
                Vector2::new(back.0, back.1)
            };
            let middle = seen
                .iter()
                .map(|s| grid_point(s.cell))
                .sum::<Vector2<f64>>();
            let image = map.derivative(&(middle / seen.len() as f64)) * along;
            image.x / image.norm()
        };
        close
            .into_iter()
            .max_by(|a, b| to_the_right(a).total_cmp(&to_the_right(b)))
            .ok_or(Refusal::NoBoard { kind: KIND })
    }

    /// Places with few contradictions, best first.
    fn places(&self, seen: &[Seen]) -> Vec<(usize, Place)> {
        let last_x = (0..self.rows.min(2))
            .map(|row| self.place(row, self.cols - 1).0)
            .max()
            .unwrap_or(0);
        let last_y = self.rows as i64 - 1;
        let most_strays = (seen.len() / CIRCLES_PER_STRAY).min(MAX_STRAYS);
        let mut places = Vec::new();
        for quarter_turns in 0..4 {
            let turned: Vec<_> = seen
                .iter()
                .map(|s| (self.cell_turned(s.cell, quarter_turns), s.is_marked))
                .collect();
            let range = |of: fn(&Turned) -> i64, last: i64| {
                let low = turned.iter().map(of).min().unwrap_or(0);
                let high = turned.iter().map(of).max().unwrap_or(0);
                // A stray circle or two may lie beyond the grid.
                (-low - 2).min(last - high - 2)..=(last - high + 2).max(-low + 2)
            };
            for dy in range(|t| t.0.1, last_y) {
                for dx in range(|t| t.0.0, last_x) {
                    let shift = (dx, dy);
                    let counted = self.contradictions(&turned, shift, most_strays);
                    if let Some(contradictions) = counted {
                        let place = Place {
                            quarter_turns,
                            shift,
                        };
                        places.push((contradictions, place));
                    }
                }
            }
        }
        places.sort_by_key(|place| place.0);
        places
    }

    /// Circles off the grid, and those that are marked and should not be or the other way round; `None` if that
    /// is too many.
    fn contradictions(
        &self,
        turned: &[Turned],
        (dx, dy): (i64, i64),
        most_strays: usize,
    ) -> Option<usize> {
        let (mut strays, mut agreeing, mut wrong) = (0, 0, 0);
        for ((x, y), is_marked) in turned {
            let Some((row, col)) = self.label_at((x + dx, y + dy)) else {
                strays += 1;
                if strays > most_strays {
                    return None;
                }
                continue;
            };
            if let (Some(is_marked), false) = (is_marked, self.direction.is_empty()) {
                let stated = self.is_marked(row, col);
                agreeing += usize::from(*is_marked && stated);
                wrong += usize::from(*is_marked != stated);
            }
        }
        (wrong * MARKS_PER_CONTRADICTION <= agreeing + wrong).then_some(strays + wrong)
    }

    /// The circles as printed, in pitches; marked ones as they are seen.
    fn markers(&self, labelled: &BTreeMap<Label, FittedRing>) -> Markers {
        let radius = self.diameter_mm / 2.0 / self.pitch_mm;
        let labels = (0..self.rows).flat_map(|row| (0..self.cols).map(move |col| (row, col)));
        labels
            .map(|(row, col)| {
                let [x, y] = self.center_mm(row, col);
                let ring = labelled.get(&(row, col));
                let marker = Marker {
                    at: Vector2::new(x, y) / self.pitch_mm,
                    outer: radius,
                    hollow: ring.map_or(self.is_marked(row, col), |ring| ring.ratio > 0.0),
                };
                ((row, col), marker)
            })
            .collect()
    }

    fn found(
        &self,
        image: &GrayImage,
        markers: &Markers,
        labelled: &BTreeMap<Label, FittedRing>,
    ) -> Option<Found> {
        let median_of = |of: fn(&FittedRing) -> f64| median(labelled.values().map(of));
        let contrast = median_of(|ring| ring.contrast.abs())?;
        let map = target_map(markers, labelled)?;
        let seen = labelled.keys().filter_map(|label| markers.get(label));
        let pitch_px = median(seen.clone().map(|marker| {
            let sides = map.derivative(&marker.at);
            sides.column(0).norm().min(sides.column(1).norm())
        }))?;
        let along: Vector2<f64> = seen
            .map(|marker| map.derivative(&marker.at).column(0).normalize())
            .sum();
        Some(Found {
            figures: ImageFigures {
                corner_count: labelled.len(),
                contrast_percent: 100.0 * contrast / f64::from(image.white_level),
                edge_px: EDGE_WIDTH_OF_BLUR * median_of(|ring| ring.blur_px)?,
                square_px: pitch_px,
                residual_percent: 100.0 * median_of(|ring| ring.residual_rms)? / contrast,
                sigma_px: median_of(|ring| ring.sigma_px)?,
            },
            corners: labelled
                .iter()
                .map(|(&(row, col), ring)| Corner {
                    row,
                    col,
                    pixel: ring.pixel,
                    sigma_px: Some(ring.sigma_px),
                })
                .collect(),
            quarter_turns: quarter_turns(&along),
        })
    }
}
