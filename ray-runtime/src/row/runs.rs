//! Where along a row something changes: the region's edges, a cell, the mask.

use super::Row;
use crate::format::Axis;
use crate::mask::MaskRow;
use core::hint::black_box;

/// Pixels whose columns are whole multiples of this have exact distances from the region's edge, px.
const GRAIN_PX: f32 = 1.0 / 256.0;
/// No pixel of a region is as far away as this from the row's first one, where that lies on a sensor.
const BEYOND_PX: u32 = 1 << 17;

/// How a form of tables cuts the region in cells along u: `(from_edge_px * per_px) as u32 >> digits`, and
/// none behind the last.
#[derive(Clone, Copy)]
pub(super) struct Cut {
    pub per_px: f32,
    pub digits: u32,
    pub last_cell: u32,
    /// About the size of a cell.
    pub size_px: f32,
}

/// Where the pixels of a row are, from the region's first edge.
#[derive(Clone, Copy)]
pub(super) struct Places {
    first_px: f32,
    step_px: u32,
    /// Of a pixel, less than one: to make guesses with.
    per_step: f32,
    /// Pixels behind this one are behind the region.
    counted: usize,
    extent_px: f32,
}

impl Places {
    /// Those of `count` pixels from number `start` on; `None` if they are not exactly where they are
    /// taken to be: for columns that are no whole multiples of 1/256 px.
    pub fn of(axis: Axis, row: &Row, start: usize, count: usize) -> Option<Self> {
        let grains = row.first.u / GRAIN_PX;
        // What is not a number is not equal to itself.
        if !(grains.abs() < 8_388_608.0 && grains as i32 as f32 == grains) {
            return None;
        }
        let step_px = u32::from(row.step_px);
        // Where this is not exact, it is behind the region.
        let start_px = start.min(BEYOND_PX as usize) as u32 * step_px;
        let counted = BEYOND_PX.checked_div(step_px).unwrap_or(u32::MAX) as usize;
        Some(Self {
            first_px: (row.first.u - axis.min_px) + start_px as f32,
            step_px,
            per_step: 1.0 / step_px as f32,
            counted: count.min(counted),
            extent_px: axis.extent_px(),
        })
    }

    #[inline(always)]
    pub fn at(&self, k: usize) -> f32 {
        self.first_px + (k as u32).wrapping_mul(self.step_px) as f32
    }

    pub fn step_px(&self) -> f32 {
        self.step_px as f32
    }

    /// The pixels that lie in the region: the first, and the one behind the last.
    #[inline(never)]
    pub fn in_region(&self) -> [usize; 2] {
        let last = self.counted.wrapping_sub(1);
        if self.at(0) >= 0.0 && self.at(last) <= self.extent_px {
            return [0, self.counted];
        }
        let begin = self.end_of(0, self.counted, 0.0, |x| x < 0.0);
        let is_within = |x: f32| x <= self.extent_px;
        [
            begin,
            self.end_of(begin, self.counted, self.extent_px, is_within),
        ]
    }

    /// The first pixel from `from` on, up to `to`, that does not have a property which pixels lose once,
    /// at about `border_px`: that is a guess, which saves looking at each.
    #[inline(always)]
    fn end_of(&self, from: usize, to: usize, border_px: f32, has: impl Fn(f32) -> bool) -> usize {
        // Saturating; what is not a number is 0.
        let steps = ((border_px - self.at(from)) * self.per_step) as u32 as usize;
        let mut end = from.saturating_add(steps).saturating_add(1).min(to);
        // Hardly ever more than once: the black boxes keep the compiler from unrolling.
        while end < to && has(self.at(end)) {
            black_box(());
            end += 1;
        }
        while end > from && !has(self.at(end - 1)) {
            black_box(());
            end -= 1;
        }
        end
    }

    /// The cell of a pixel of the region, and the first pixel up to `to` that lies in another one.
    #[inline(always)]
    pub fn cell_from(&self, from: usize, to: usize, cut: &Cut) -> (u32, usize) {
        let cell = (self.at(from) * cut.per_px) as u32 >> cut.digits;
        if cell >= cut.last_cell {
            return (cut.last_cell, to);
        }
        // The next one is reached where the product is: both are exact.
        let next = ((cell + 1) << cut.digits) as f32;
        let border_px = (cell + 1) as f32 * cut.size_px;
        let end = self.end_of(from, to, border_px, |x| x * cut.per_px < next);
        // Never: so that there is always a step on.
        (cell, end.max(from + 1))
    }
}

/// What of a row is calibrated.
pub(super) struct Calibrated<'a> {
    mask: MaskRow<'a>,
    /// All cells of the mask from one that was asked for up to this one are.
    set_until: usize,
}

impl<'a> Calibrated<'a> {
    pub fn of(mask: MaskRow<'a>) -> Self {
        Self { mask, set_until: 0 }
    }

    /// Whether the pixels from one of the region up to another one all are, to go by what is known.
    #[inline(always)]
    pub fn is_known(&self, places: &Places, to: usize) -> bool {
        self.mask.cell(places.at(to.wrapping_sub(1))) < self.set_until
    }

    /// Whether a pixel of the region is, and the first one up to `to` of which that is not known.
    #[inline(never)]
    pub fn from(&mut self, places: &Places, from: usize, to: usize) -> (bool, usize) {
        let first = self.mask.cell(places.at(from));
        if first >= self.set_until {
            self.set_until = self.mask.set_until(first);
        }
        let is_set = first < self.set_until;
        if is_set && self.is_known(places, to) {
            return (true, to);
        }
        let end = if is_set { self.set_until } else { first + 1 };
        let is_known = |k: &usize| self.mask.cell(places.at(*k)) < end;
        (is_set, (from + 1..to).find(|k| !is_known(k)).unwrap_or(to))
    }
}
