//! Where the print ends: a target with fewer rows or columns than stated shows white where more would be.

use super::saddles::Label;
use crate::dataset::image::GrayImage;
use crate::detect::ring_target::markers::{Markers, target_map};
use crate::detect::ring_target::ring_fit::FittedRing;
use calib_rays::numerics::median;
use nalgebra::Vector2;
use std::collections::{BTreeMap, BTreeSet};

/// Part of a line's places that must be in view, ...
const IN_VIEW: f64 = 0.35;
/// ... and of those that must be blank.
const BLANK: f64 = 0.8;
/// Fewest of them.
const MIN_PLACES: usize = 2;
/// A circle's place is blank if it differs from what is beside its neighbor by less than this part of the contrast.
const BLANK_CONTRAST: f64 = 0.35;

/// Whether a whole line of the target next to those found is in view and blank. `is_blank` says of a place
/// whether nothing is printed there; `None` where that cannot be seen.
pub fn print_ends(
    (rows, cols): (usize, usize),
    found: &BTreeSet<Label>,
    is_blank: impl Fn(Label) -> Option<bool>,
) -> bool {
    let bounds = |of: fn(&Label) -> usize| {
        let values = || found.iter().map(of);
        Some((values().min()?, values().max()?))
    };
    let (Some((top, bottom)), Some((left, right))) = (bounds(|l| l.0), bounds(|l| l.1)) else {
        return false;
    };
    let row = |row: usize| -> Vec<Label> { (left..=right).map(|col| (row, col)).collect() };
    let col = |col: usize| -> Vec<Label> { (top..=bottom).map(|row| (row, col)).collect() };
    let lines = [
        (top > 0).then(|| row(top - 1)),
        (bottom + 1 < rows).then(|| row(bottom + 1)),
        (left > 0).then(|| col(left - 1)),
        (right + 1 < cols).then(|| col(right + 1)),
    ];
    lines.into_iter().flatten().any(|line| {
        let seen: Vec<bool> = line.iter().filter_map(|&label| is_blank(label)).collect();
        let blank = seen.iter().filter(|blank| **blank).count();
        seen.len() >= MIN_PLACES
            && seen.len() as f64 >= IN_VIEW * line.len() as f64
            && blank as f64 >= BLANK * seen.len() as f64
    })
}

/// Whether the image shows nothing where the next row or column of circles or rings would be.
pub fn circles_end(
    size: (usize, usize),
    image: &GrayImage,
    markers: &Markers,
    labelled: &BTreeMap<Label, FittedRing>,
) -> bool {
    let (Some(map), Some(contrast)) = (
        target_map(markers, labelled),
        median(labelled.values().map(|ring| ring.contrast.abs())),
    ) else {
        return false;
    };
    let found: BTreeSet<Label> = labelled.keys().copied().collect();
    // On the side towards another place: the plate may end on the other.
    let mean = |at: &Vector2<f64>, away: f64, towards: Vector2<f64>| {
        let (mut sum, mut count) = (0.0, 0.0);
        for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let step = Vector2::new(x, y);
            if step.dot(&towards) > 0.0 {
                let pixel = map.at(&(at + step * away));
                sum += image.between(pixel.x, pixel.y)?;
                count += 1.0;
            }
        }
        (count > 0.0).then(|| sum / count)
    };
    print_ends(size, &found, |(row, col)| {
        let marker = markers.get(&(row, col))?;
        let near = |label: &&Label| row.abs_diff(label.0) + col.abs_diff(label.1);
        let neighbor = markers.get(found.iter().min_by_key(near)?)?;
        // Inside the circle and outside its hole; in the middle between the neighbor and those next to it.
        let inward = neighbor.at - marker.at;
        let on = mean(&marker.at, 0.5 * marker.outer, inward)?;
        let beside = mean(&neighbor.at, 0.5 * (neighbor.outer + 0.5), -inward)?;
        Some((on - beside).abs() < BLANK_CONTRAST * contrast)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_blank_line_in_view_ends_the_print() {
        let found: BTreeSet<Label> = (0..3)
            .flat_map(|r| (0..5).map(move |c| (r, c + 1)))
            .collect();
        let ends =
            |size, is_blank: &dyn Fn(Label) -> Option<bool>| print_ends(size, &found, is_blank);
        assert!(ends((4, 6), &|_| Some(true)));
        assert!(!ends((4, 6), &|_| None));
        assert!(!ends((4, 6), &|(row, col)| Some((row + col) % 2 == 0)));
        // Column 0 is one more.
        assert!(ends((3, 6), &|(_, col)| Some(col == 0)));
        assert!(!ends((3, 6), &|(row, _)| Some(row == 3)));
    }
}
