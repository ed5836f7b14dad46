//! Splines of f32 knots, the form of old versions, in fixed point.

use super::float::Digits;
use super::product::product;

/// A third and a sixth of one, in 2^-30.
const THIRD: i32 = 0x1555_5555;
const SIXTH: i32 = THIRD / 2;

/// Four knots along each axis.
#[derive(Clone, Copy)]
pub struct Window {
    /// Number of the first knot of the 4 x 4.
    first: usize,
    /// Knots in a row.
    stride: usize,
    along_u: [i32; 3],
    along_v: [i32; 3],
}

impl Window {
    /// From the cell and the share of it, in 2^-30, along both axes.
    pub fn at(cells_u: u32, (cell_u, share_u): (u32, i32), (cell_v, share_v): (u32, i32)) -> Self {
        let stride = cells_u.wrapping_add(3);
        Self {
            first: cell_v.wrapping_mul(stride).wrapping_add(cell_u) as usize,
            stride: stride as usize,
            along_u: weights(share_u),
            along_v: weights(share_v),
        }
    }

    /// Two channels at the place: each knot has `step` pairs, of which the first is meant. `None` if there
    /// are too few.
    #[inline(never)]
    pub fn blend(&self, knots: &[[f32; 2]], step: usize, digits: Digits) -> Option<[i32; 2]> {
        let mut rows = [[0; 2]; 4];
        for (j, row) in rows.iter_mut().enumerate() {
            let mut four = [[0; 2]; 4];
            for (i, knot) in four.iter_mut().enumerate() {
                let at = (self.first + j * self.stride + i) * step;
                *knot = knots.get(at)?.map(|number| digits.fixed(number));
            }
            *row = mean(&four, self.along_u);
        }
        Some(mean(&rows, self.along_v))
    }
}

/// Weights of the knots 0, 2 and 3 at a share of a cell, in 2^-30.
fn weights(share: i32) -> [i32; 3] {
    let rest = (1 << 30) - share;
    let cube = |r: i32| product::<2>(product::<2>(product::<2>(r, r), r), SIXTH);
    let middle = 2 * THIRD - product::<2>(product::<2>(rest, rest), (1 << 30) - rest / 2);
    [cube(rest), middle, cube(share)]
}

fn mean(knots: &[[i32; 2]; 4], [first, third, fourth]: [i32; 3]) -> [i32; 2] {
    core::array::from_fn(|k| {
        let [a, b, c, d] = knots.map(|knot| if k == 0 { knot[0] } else { knot[1] });
        let part = |knot: i32, weight: i32| product::<2>(knot.wrapping_sub(b), weight);
        let parts = part(a, first).wrapping_add(part(c, third));
        b.wrapping_add(parts.wrapping_add(part(d, fourth)))
    })
}
