//! The knots of a quantized table, blended as the small integers that they are: in a third of the
//! instructions that numbers take, and the same bits on every target.

use crate::PixelPoint;
use crate::format::{PLACES_PER_CELL, Record};
use crate::weights::{Weights, high, low};

/// A knot of two channels.
pub(crate) trait Knot: Copy {
    /// The same pairs of numbers, seen as knots.
    fn seen_in(pairs: &[[f32; 2]]) -> &[Self];

    /// The two channels of a row of knots, weighed. The sum stays below 2^31, as the weights' does
    /// below 2^16.
    fn weighed(row: &[Self; 4], weights: Weights) -> (i32, i32);
}

/// Two i16 in a word of a table, which is seen as f32.
impl Knot for f32 {
    #[inline(always)]
    fn seen_in(pairs: &[[f32; 2]]) -> &[Self] {
        pairs.as_flattened()
    }

    #[inline(always)]
    fn weighed(row: &[Self; 4], weights: Weights) -> (i32, i32) {
        let words = row.map(|knot| knot.to_bits().cast_signed());
        (
            weights.applied_to(words.map(low)),
            weights.applied_to(words.map(high)),
        )
    }
}

impl Knot for [i8; 2] {
    #[inline(always)]
    fn seen_in(pairs: &[[f32; 2]]) -> &[Self] {
        bytemuck::cast_slice(pairs)
    }

    #[inline(always)]
    fn weighed(row: &[Self; 4], weights: Weights) -> (i32, i32) {
        (
            weights.applied_to(row.map(|knot| knot[0].into())),
            weights.applied_to(row.map(|knot| knot[1].into())),
        )
    }
}

/// The 4 x 4 knots that matter at a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Window {
    /// Number of the first.
    first: usize,
    /// Knots in a row.
    stride: u16,
    /// The share of the cell before the pixel, along u and along v.
    pub shares: [i32; 2],
}

impl Window {
    /// The window of a pixel in the region, seen from the region's outer edge.
    #[inline(always)]
    pub fn at(record: Record<'_>, places_per_px: [f32; 2], from_edge: PixelPoint) -> Self {
        let [cells_u, _] = record.cells();
        let place_u = (from_edge.u * places_per_px[0]) as u32;
        let place_v = (from_edge.v * places_per_px[1]) as u32;
        // No more cells than fit, as `open` saw.
        let stride = (cells_u + 3) as u16;
        let first = (place_v / PLACES_PER_CELL) * u32::from(stride) + place_u / PLACES_PER_CELL;
        Self {
            first: first as usize,
            stride,
            shares: [place_u, place_v].map(|place| (place % PLACES_PER_CELL).cast_signed()),
        }
    }

    /// The knots behind the first so many pairs of a table, blended with weights along u in each of the
    /// four rows, without any rounding, and then along v. `None` if there are too few knots.
    #[inline(always)]
    pub fn blend<K: Knot>(
        &self,
        pairs: &[[f32; 2]],
        knots_start: usize,
        along_u: Weights,
        along_v: Weights,
    ) -> Option<(i32, i32)> {
        let knots = K::seen_in(pairs);
        let stride = usize::from(self.stride);
        let first = knots_start * (size_of::<[f32; 2]>() / size_of::<K>()) + self.first;
        // One check in place of four: the compiler sees what follows from it.
        let rows = knots.get(first..)?;
        if rows.len() < 3 * stride + 4 {
            return None;
        }
        let mut sums = (0, 0);
        for (j, weight) in along_v.each().into_iter().enumerate() {
            let row = rows.get(j * stride..j * stride + 4)?.first_chunk()?;
            let (a, b) = K::weighed(row, along_u);
            sums.0 += upper(a, weight);
            sums.1 += upper(b, weight);
        }
        Some(sums)
    }
}

/// The product with a weight, without its lowest 16 binary digits.
#[inline(always)]
fn upper(sum: i32, weight: i32) -> i32 {
    ((i64::from(sum) * i64::from(weight)) >> 16) as i32
}
