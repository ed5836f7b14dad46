//! What the use of a mesh loses, at every pixel of the output image.

use super::grid::Grid;
use super::view::View;
use crate::loss::Loss;
use crate::sight::{Seen, Sight, Target};
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector2;
use rayon::prelude::*;

/// The loss of a mesh, and the pixels of the output image that it was not taken at: no calibrated pixel sees what they show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lost {
    pub loss: Loss,
    pub outside: usize,
}

#[derive(Default)]
struct Row {
    px2: f64,
    max_px: f64,
    mm2: f64,
    max_mm: f64,
    count: usize,
    outside: usize,
}

/// Every pixel of the output image: where the chip takes it from, rounded at its worst, against the pixel that sees what it shows; and
/// how far beside that point the chip's pixel looks, mm, to first order. `None` if no pixel is seen. Cost: some four lookups a pixel.
pub(super) fn lost(sight: &Sight<'_>, view: &View, grid: &Grid, distance_mm: f64) -> Option<Lost> {
    let rows: Vec<Row> = (0..view.size.height)
        .into_par_iter()
        .map(|v| row(sight, view, grid, distance_mm, v))
        .collect();
    let count: usize = rows.iter().map(|row| row.count).sum();
    let rms = |of: fn(&Row) -> f64| (rows.iter().map(of).sum::<f64>() / count as f64).sqrt();
    let max = |of: fn(&Row) -> f64| rows.iter().map(of).fold(0.0, f64::max);
    (count > 0).then(|| Lost {
        loss: Loss {
            rms_px: rms(|row| row.px2),
            max_px: max(|row| row.max_px),
            rms_mm: rms(|row| row.mm2),
            max_mm: max(|row| row.max_mm),
            count,
        },
        outside: rows.iter().map(|row| row.outside).sum(),
    })
}

fn row(sight: &Sight<'_>, view: &View, grid: &Grid, distance_mm: f64, v: u32) -> Row {
    let from_mm = view.rig_from_view.translation_mm;
    let mut row = Row::default();
    let mut last: Option<Seen> = None;
    for u in 0..view.size.width {
        let taken = grid.taken_from(u, v);
        let point_mm = view.point_mm([f64::from(u), f64::from(v)], distance_mm);
        let slope = last.map(|seen| seen.slope);
        let near = Some(PixelPoint::new(taken[0], taken[1]));
        let target = Target::new(point_mm, &from_mm);
        let Some(seen) = sight.seen(&target, near, slope) else {
            row.outside += 1;
            continue;
        };
        let truth = [seen.pixel.u, seen.pixel.v];
        let missed = [0, 1].map(|axis| worst(taken[axis], truth[axis], grid.layout.steps_per_px));
        let px = missed[0].hypot(missed[1]);
        // The signs of a worst case are open.
        let mm = [1.0, -1.0]
            .map(|sign| (seen.slope * Vector2::new(missed[0], sign * missed[1])).norm())
            .into_iter()
            .fold(0.0, f64::max);
        row.px2 += px * px;
        row.mm2 += mm * mm;
        row.max_px = row.max_px.max(px);
        row.max_mm = row.max_mm.max(mm);
        row.count += 1;
        last = Some(seen);
    }
    row
}

/// The farthest of what a place may be rounded to from the truth, px.
fn worst(taken: f64, truth: f64, steps_per_px: Option<f64>) -> f64 {
    let missed = (taken - truth).abs();
    let Some(steps) = steps_per_px else {
        return missed;
    };
    let down = (taken * steps).floor() / steps;
    let nearest = (taken * steps + 0.5).floor() / steps;
    missed
        .max((down - truth).abs())
        .max((nearest - truth).abs())
}
