//! The rays of a row's runs.

use super::Row;
use super::runs::{Calibrated, Cut, Places};
use crate::Ray;
use crate::format::{PLACES_PER_CELL, Record};
use crate::grid::Inside;
use crate::lookup::{
    CENTRAL_PATCHES, HAS_PATCHES, HAS_QUANTIZED, NON_CENTRAL_PATCHES, Pose, Sample, Views,
    central_ray, is_spline, shifted_ray,
};
use crate::mask::MaskRow;
use crate::polynomial::AlongX;
use crate::quantized::UsualRow;
use core::hint::black_box;

/// A row of one form of tables.
trait Form {
    fn cut(&self) -> Cut;

    /// Writes the rays of pixels of a cell, the first of which is so far from the region's first edge.
    fn write(&self, cell: u32, first_px: f32, step_px: f32, rays: &mut [Ray]);
}

impl<'a> Views<'a> {
    /// The rays of pixels of a row, from number `start` on.
    pub(super) fn lookup_row(self, record: Record<'a>, row: &Row, start: usize, rays: &mut [Ray]) {
        let Some(v) = record.axis_v().inside(row.first.v) else {
            mark(rays);
            return;
        };
        if let Some(places) = Places::of(record.axis_u(), row, start, rays.len()) {
            let mask = MaskRow::at(self.bytes, record, v);
            match record.encoding() {
                CENTRAL_PATCHES if HAS_PATCHES => {
                    return fill(&Patches::<1>::of(self, record, v), &places, mask, rays);
                }
                NON_CENTRAL_PATCHES if HAS_PATCHES => {
                    return fill(&Patches::<2>::of(self, record, v), &places, mask, rays);
                }
                _ if is_spline(record) || !HAS_QUANTIZED => {}
                _ => {
                    if let Some(usual) = UsualRow::of(self.pairs, record, v) {
                        return fill(&usual, &places, mask, rays);
                    }
                }
            }
        }
        for (k, ray) in rays.iter_mut().enumerate() {
            let found = self.lookup(record, row.pixel(start.saturating_add(k)));
            *ray = found.unwrap_or(Ray::OUTSIDE);
        }
    }
}

#[inline(always)]
fn fill(form: &impl Form, places: &Places, mask: MaskRow<'_>, rays: &mut [Ray]) {
    let (cut, step_px) = (form.cut(), places.step_px());
    let [begin, end] = places.in_region();
    let mut calibrated = Calibrated::of(mask);
    mark(rays.get_mut(..begin).unwrap_or_default());
    mark(rays.get_mut(end..).unwrap_or_default());
    let mut at = begin;
    while at < end {
        let (cell, cell_end) = places.cell_from(at, end, &cut);
        while at < cell_end {
            let (is_set, to) = if calibrated.is_known(places, cell_end) {
                (true, cell_end)
            } else {
                calibrated.from(places, at, cell_end)
            };
            let run = rays.get_mut(at..to).unwrap_or_default();
            if is_set {
                form.write(cell, places.at(at), step_px, run);
            } else {
                mark(run);
            }
            at = to;
        }
    }
}

#[inline(never)]
fn mark(rays: &mut [Ray]) {
    rays.fill(Ray::OUTSIDE);
}

/// Patches of half-angle vectors, and of offsets if `MAPS` is 2, of one row of cells.
struct Patches<'a, const MAPS: usize> {
    record: Record<'a>,
    /// The row's first cell, and all behind it.
    maps: &'a [[[f32; 2]; 10]],
    y: f32,
}

impl<'a, const MAPS: usize> Patches<'a, MAPS> {
    #[inline(always)]
    fn of(views: Views<'a>, record: Record<'a>, v: Inside) -> Self {
        let ([cells_u, _], axis) = (record.cells(), record.axis_v());
        let cell_v = axis.cell(v);
        let y = axis.share(v.from_edge_px, axis.cell_edge_px(cell_v));
        let first = (cell_v * cells_u) as usize * (10 * MAPS);
        let start = (record.grid_offset() >> 3) as usize + first;
        let (maps, _) = views.pairs.get(start..).unwrap_or_default().as_chunks();
        Self { record, maps, y }
    }
}

impl<const MAPS: usize> Form for Patches<'_, MAPS> {
    #[inline(always)]
    fn cut(&self) -> Cut {
        let axis = self.record.axis_u();
        Cut {
            per_px: axis.cells_per_px,
            digits: 0,
            last_cell: self.record.cells()[0].wrapping_sub(1),
            size_px: axis.cell_high_px,
        }
    }

    #[inline(never)]
    fn write(&self, cell: u32, first_px: f32, step_px: f32, mut rays: &mut [Ray]) {
        let axis = self.record.axis_u();
        let cell_edge_px = axis.cell_edge_px(cell);
        let rest = self.maps.get(cell as usize * MAPS..).unwrap_or_default();
        let Some(maps) = rest.first_chunk::<MAPS>() else {
            // Never, in a blob that was opened.
            return mark(rays);
        };
        let maps: [AlongX; MAPS] = core::array::from_fn(|k| AlongX::new(&maps[k], self.y));
        let pose = Pose::of(self.record);
        let mut from_edge_px = first_px;
        while let Some((ray, rest)) = rays.split_first_mut() {
            rays = rest;
            // Keeps the compiler from unrolling the loop, for which there are not registers enough.
            black_box(());
            let x = axis.share(from_edge_px, cell_edge_px);
            from_edge_px += step_px;
            let s = maps[0].at(x);
            *ray = if MAPS == 1 {
                central_ray(pose, s)
            } else {
                let n = maps[MAPS - 1].at(x);
                shifted_ray(pose, Sample { s, n })
            };
        }
    }
}

impl Form for UsualRow<'_> {
    #[inline(always)]
    fn cut(&self) -> Cut {
        Cut {
            per_px: self.places_per_px(),
            digits: PLACES_PER_CELL.ilog2(),
            // Never reached: places are two fewer than would reach behind the last cell.
            last_cell: u32::from(u16::MAX),
            size_px: self.record().axis_u().cell_high_px,
        }
    }

    #[inline(never)]
    fn write(&self, cell: u32, first_px: f32, step_px: f32, mut rays: &mut [Ray]) {
        let pose = Pose::of(self.record());
        let is_central = self.record().is_central();
        let mut from_edge_px = first_px;
        while let Some((ray, rest)) = rays.split_first_mut() {
            rays = rest;
            // Keeps the compiler from taking all knots of the cell apart in advance: it has no registers for
            // what comes out.
            black_box(());
            let found = self.direction(cell as usize, from_edge_px);
            from_edge_px += step_px;
            *ray = match found {
                Some((s, _)) if is_central => central_ray(pose, s),
                Some((s, x)) => {
                    let n = self.offset(x);
                    shifted_ray(pose, Sample { s, n })
                }
                // Never, in a blob that was opened.
                None => Ray::OUTSIDE,
            };
        }
    }
}
