//! Quantized knots blended to the integer of the f32 path, in multiplications of 16 by 16 binary digits.

use super::product::product_by_half;
use crate::weights::{Weights, high, low};

/// A place on the grid of knots.
#[derive(Clone, Copy)]
pub struct Window {
    /// Number of the first knot of the 4 x 4.
    first: usize,
    stride: usize,
    along_u: [i32; 4],
    along_v: [i32; 4],
}

impl Window {
    /// From the cell and the share of it, in 2^-14, along both axes.
    #[inline(always)]
    pub fn at(cells_u: u32, (cell_u, share_u): (u32, i32), (cell_v, share_v): (u32, i32)) -> Self {
        let stride = cells_u.wrapping_add(3);
        Self {
            first: cell_v.wrapping_mul(stride).wrapping_add(cell_u) as usize,
            stride: stride as usize,
            along_u: Weights::of_halves(share_u),
            along_v: Weights::of_halves(share_v),
        }
    }

    /// The knots of i16 behind the first so many pairs of a table.
    #[inline(always)]
    pub fn blend_words(&self, pairs: &[[f32; 2]], knots_start: usize) -> Option<[i32; 2]> {
        let knots = pairs.as_flattened().get(2 * knots_start + self.first..)?;
        self.blend_rows(knots, |knot| knot.to_bits().cast_signed())
    }

    /// The knots of i8, or of i16 where a number does not have one byte.
    #[inline(never)]
    pub fn blend(
        &self,
        pairs: &[[f32; 2]],
        knots_start: usize,
        number_len: u8,
    ) -> Option<[i32; 2]> {
        if number_len != 1 {
            return self.blend_words(pairs, knots_start);
        }
        let knots: &[[i8; 2]] = bytemuck::cast_slice(pairs);
        let knots = knots.get(4 * knots_start + self.first..)?;
        self.blend_rows(knots, |[a, b]| (i32::from(a) & 0xffff) | i32::from(b) << 16)
    }

    /// `word` has the two numbers of a knot in its halves.
    #[inline(always)]
    fn blend_rows<K: Copy>(&self, knots: &[K], word: impl Fn(K) -> i32) -> Option<[i32; 2]> {
        // One check in place of four.
        if knots.len() < 3 * self.stride + 4 {
            return None;
        }
        let mut sums = [0_i32; 2];
        for (j, weight) in self.along_v.into_iter().enumerate() {
            let row: &[K; 4] = knots.get(j * self.stride..)?.first_chunk()?;
            let (mut a, mut b) = (0_i32, 0_i32);
            for (knot, along) in row.iter().zip(self.along_u) {
                let word = word(*knot);
                a = a.wrapping_add(along.wrapping_mul(low(word)));
                b = b.wrapping_add(along.wrapping_mul(high(word)));
            }
            sums[0] = sums[0].wrapping_add(product_by_half(a, weight));
            sums[1] = sums[1].wrapping_add(product_by_half(b, weight));
        }
        Some(sums)
    }
}
