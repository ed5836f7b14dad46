//! The knots of a quantized table, blended as the small integers that they are: in fewer instructions
//! than made into numbers first, and with the same bits on every target.

use crate::PixelPoint;
use crate::format::{PLACES_PER_CELL, Record};
use crate::weights::{Weights, high, low};

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

    /// The knots of i16 behind the first so many pairs of a table, blended with weights along u in each of
    /// the four rows, without any rounding, and then along v. `None` if there are too few knots.
    #[inline(always)]
    pub fn blend_words(
        &self,
        pairs: &[[f32; 2]],
        knots_start: usize,
        along: [Weights; 2],
    ) -> Option<(i32, i32)> {
        let knots = self.words(pairs, knots_start)?;
        blend_rows(knots, self.stride.into(), along, |row| row.map(word))
    }

    /// The knots of i16 behind the first so many pairs of a table, from this window's first one on.
    #[inline(always)]
    pub fn words<'a>(&self, pairs: &'a [[f32; 2]], knots_start: usize) -> Option<&'a [f32]> {
        // A knot takes half a pair.
        pairs.as_flattened().get(2 * knots_start + self.first..)
    }

    /// The knots of a cell of the same row of cells, whose number is `cell`, from those of its first one on,
    /// blended.
    #[inline(always)]
    pub fn blend_cell(
        &self,
        knots: &[f32],
        cell: usize,
        along: [Weights; 2],
    ) -> Option<(i32, i32)> {
        let stride = self.stride.into();
        blend_rows(knots.get(cell..)?, stride, along, |row| row.map(word))
    }

    /// The same of i8, if that is what a number has bytes, or of i16.
    #[inline(never)]
    pub fn blend(
        &self,
        pairs: &[[f32; 2]],
        knots_start: usize,
        number_len: u8,
        along: [Weights; 2],
    ) -> Option<(i32, i32)> {
        if number_len != 1 {
            return self.blend_words(pairs, knots_start, along);
        }
        let knots: &[[i8; 2]] = bytemuck::cast_slice(pairs);
        let knots = knots.get(4 * knots_start + self.first..)?;
        blend_rows(knots, self.stride.into(), along, |row| {
            row.map(|[a, b]| (i32::from(a) & 0xffff) | i32::from(b) << 16)
        })
    }
}

/// A knot of i16 as a word.
#[inline(always)]
fn word(knot: f32) -> i32 {
    knot.to_bits().cast_signed()
}

/// `words` has the two numbers of a knot in the two halves of a word.
#[inline(always)]
fn blend_rows<K>(
    knots: &[K],
    stride: usize,
    [along_u, along_v]: [Weights; 2],
    words: impl Fn(&[K; 4]) -> [i32; 4],
) -> Option<(i32, i32)> {
    // One check in place of four: the compiler sees what follows from it.
    if knots.len() < 3 * stride + 4 {
        return None;
    }
    let mut sums = (0, 0);
    for (j, weight) in along_v.each().into_iter().enumerate() {
        let row = words(knots.get(j * stride..j * stride + 4)?.first_chunk()?);
        // Below 2^31, as the weights add up to less than 2^16.
        sums.0 += upper(along_u.applied_to(row.map(low)), weight);
        sums.1 += upper(along_u.applied_to(row.map(high)), weight);
    }
    Some(sums)
}

/// The product with a weight, without its lowest 16 binary digits.
#[inline(always)]
fn upper(sum: i32, weight: i32) -> i32 {
    ((i64::from(sum) * i64::from(weight)) >> 16) as i32
}
