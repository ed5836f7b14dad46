//! The knots of a quantized table, blended as the small integers that they are: in a third of the
//! instructions that numbers take, and the same bits on every target.

use crate::PixelPoint;
use crate::format::{PLACES_PER_CELL, Record};
use crate::weights::{Weights, high, low};

/// A knot of two channels.
pub(crate) trait Knot: Copy {
    /// The two channels of a row of knots, weighed. The sum stays below 2^31, as the weights' does
    /// below 2^16.
    fn weighed(row: &[Self; 4], weights: Weights) -> (i32, i32);
}

/// Two i16 in a word of a table, which is seen as f32.
impl Knot for f32 {
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
    stride: usize,
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
        let stride = cells_u.wrapping_add(3);
        let first = (place_v / PLACES_PER_CELL)
            .wrapping_mul(stride)
            .wrapping_add(place_u / PLACES_PER_CELL);
        Self {
            first: first as usize,
            stride: stride as usize,
            shares: [place_u, place_v].map(|place| (place % PLACES_PER_CELL).cast_signed()),
        }
    }

    /// The knots blended with weights along u in each of the four rows, without any rounding, and then
    /// along v. `None` if there are too few knots.
    #[inline(always)]
    pub fn blend<K: Knot>(
        self,
        knots: &[K],
        along_u: Weights,
        along_v: Weights,
    ) -> Option<(i32, i32)> {
        let rows = knots.get(self.first..)?;
        // One check in place of four: the compiler sees what follows from it.
        if rows.len() < self.stride.checked_mul(3)?.checked_add(4)? {
            return None;
        }
        let mut sums = (0, 0);
        for (j, weight) in along_v.each().into_iter().enumerate() {
            let row = rows.get(j * self.stride..)?.first_chunk()?;
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
