//! Points with known places: each place is a label of the target, in a fixed order.

use super::row::{Label, Row};
use calib_rays::board::{BoardSpec, KnownPlace, Layout};
use nalgebra::Vector3;
use std::collections::HashMap;

/// The target that the rows are points of: every place once, by z, then y, then x. Of several standard deviations
/// that are given for one place, the largest counts.
pub(super) fn target(rows: &[Row]) -> BoardSpec {
    let mut places: Vec<KnownPlace> = rows
        .iter()
        .filter_map(|row| match row.label {
            Label::Place(place) => Some(place),
            Label::RowCol(..) => None,
        })
        .collect();
    places.sort_by(|a, b| {
        let by = |axis: usize| a.at_mm[axis].total_cmp(&b.at_mm[axis]);
        by(2)
            .then_with(|| by(1))
            .then_with(|| by(0))
            .then_with(|| b.sigma_mm.total_cmp(&a.sigma_mm))
    });
    places.dedup_by(|next, first| next.at_mm == first.at_mm);
    BoardSpec::points(places)
}

/// Finds the label of a place.
pub(super) struct Labels(HashMap<[u64; 3], usize>);

impl Labels {
    /// Of a target; empty for a grid.
    pub fn of(board: &BoardSpec) -> Self {
        let places = match &board.layout {
            Layout::Points(places) => &places[..],
            Layout::Grid | Layout::Rectangles(_) | Layout::Face(_) => &[],
        };
        let places = places.iter().enumerate();
        Self(places.map(|(k, place)| (key(&place.at_mm), k)).collect())
    }

    /// The column; `None` if the target has no such place.
    pub fn col(&self, at_mm: &Vector3<f64>) -> Option<usize> {
        self.0.get(&key(at_mm)).copied()
    }
}

fn key(at_mm: &Vector3<f64>) -> [u64; 3] {
    [at_mm.x, at_mm.y, at_mm.z].map(f64::to_bits)
}
