//! Bicubic B-splines of two channels over the cells of a grid.

use crate::PixelPoint;
use crate::format::Record;
use crate::grid::{Place, blend_slopes};
use crate::polynomial::Dual;

/// The knots of two channels of a camera, borrowed from the blob.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Knots<'a> {
    /// f32; every `stride`-th pair belongs to these channels.
    F32 {
        pairs: &'a [[f32; 2]],
        stride: usize,
    },
    /// Steps.
    I16(&'a [[i16; 2]]),
    /// Steps.
    I8(&'a [[i8; 2]]),
}

/// Where a pixel lies on a camera's grid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window<'r> {
    record: Record<'r>,
    pixel: PixelPoint,
    u: Place,
    v: Place,
    knots_u: usize,
}

impl<'r> Window<'r> {
    /// The window of a pixel in the region.
    #[inline(always)]
    pub fn at(record: Record<'r>, pixel: PixelPoint) -> Self {
        let [cells_u, cells_v] = record.cells();
        Self {
            record,
            pixel,
            u: record.axis_u().place(pixel.u, cells_u),
            v: record.axis_v().place(pixel.v, cells_v),
            knots_u: cells_u as usize + 3,
        }
    }

    /// The spline at the pixel, in steps if the knots are: first along u in each of four rows, then
    /// along v. `None` if there are too few knots.
    #[inline(always)]
    pub fn blend(&self, knots: Knots<'_>) -> Option<[f32; 2]> {
        match knots {
            Knots::I16(pairs) => self.blend_steps(pairs, self.u.of_all(), self.v.of_all()),
            Knots::I8(pairs) => self.blend_steps(pairs, self.u.of_all(), self.v.of_all()),
            Knots::F32 { pairs, stride } => {
                self.blend_numbers(pairs, stride, Weights::of(self.u), Weights::of(self.v))
            }
        }
    }

    /// [`Window::blend`], the same bits, and its derivatives by u and v.
    #[inline(never)]
    pub fn blend_moving(&self, knots: Knots<'_>) -> Option<[Dual; 2]> {
        let [cells_u, cells_v] = self.record.cells();
        let slope_u = self.record.axis_u().slopes(self.pixel.u, cells_u);
        let slope_v = self.record.axis_v().slopes(self.pixel.v, cells_v);
        let [value, by_u, by_v] = match knots {
            Knots::I16(pairs) => self.steps_moving(pairs, slope_u, slope_v)?,
            Knots::I8(pairs) => self.steps_moving(pairs, slope_u, slope_v)?,
            Knots::F32 { pairs, stride } => {
                let blend = |u, v| self.blend_numbers(pairs, stride, u, v);
                let [along_u, along_v] = [self.u, self.v].map(Weights::of);
                [
                    blend(along_u, along_v)?,
                    blend(Weights::slope(slope_u), along_v)?,
                    blend(along_u, Weights::slope(slope_v))?,
                ]
            }
        };
        let dual = |value, by_u, by_v| Dual { value, by_u, by_v };
        Some([
            dual(value[0], by_u[0], by_v[0]),
            dual(value[1], by_u[1], by_v[1]),
        ])
    }

    fn steps_moving<T: Copy + Into<f32>>(
        &self,
        pairs: &[[T; 2]],
        slope_u: [f32; 3],
        slope_v: [f32; 3],
    ) -> Option<[[f32; 2]; 3]> {
        let (along_u, along_v) = (self.u.of_all(), self.v.of_all());
        // The slopes of all four weights cancel.
        let of_all = |[a, c, d]: [f32; 3]| [a, -a - c - d, c, d];
        Some([
            self.blend_steps(pairs, along_u, along_v)?,
            self.blend_steps(pairs, of_all(slope_u), along_v)?,
            self.blend_steps(pairs, along_u, of_all(slope_v))?,
        ])
    }

    /// Number of the first knot in row `j` of the four.
    fn start(&self, j: usize) -> usize {
        (self.v.cell + j) * self.knots_u + self.u.cell
    }

    /// Integers are exact in f32 and what they add to is small: each counts with its own weight.
    #[inline(never)]
    fn blend_steps<T: Copy + Into<f32>>(
        &self,
        pairs: &[[T; 2]],
        along_u: [f32; 4],
        along_v: [f32; 4],
    ) -> Option<[f32; 2]> {
        let mut sum = [0.0; 2];
        let mut rest = pairs.get(self.start(0)..)?;
        for (j, weight) in along_v.into_iter().enumerate() {
            if j > 0 {
                rest = rest.get(self.knots_u..)?;
            }
            let [a, b, c, d] = rest.first_chunk::<4>()?;
            for (channel, sum) in sum.iter_mut().enumerate() {
                let at =
                    |pair: &[T; 2]| -> f32 { if channel == 0 { pair[0] } else { pair[1] }.into() };
                let row = along_u[0] * at(a)
                    + along_u[1] * at(b)
                    + along_u[2] * at(c)
                    + along_u[3] * at(d);
                *sum += weight * row;
            }
        }
        Some(sum)
    }

    /// Numbers of full size are blended as one of them and differences to it, whose round-off is
    /// smaller.
    #[inline(never)]
    fn blend_numbers(
        &self,
        pairs: &[[f32; 2]],
        stride: usize,
        along_u: Weights,
        along_v: Weights,
    ) -> Option<[f32; 2]> {
        let mut rows = [[0.0; 4]; 2];
        for j in 0..4 {
            let mut row = [[0.0; 4]; 2];
            for i in 0..4 {
                let pair = pairs.get((self.start(j) + i) * stride)?;
                for (channel, value) in row.iter_mut().zip(pair) {
                    *channel.get_mut(i)? = *value;
                }
            }
            for (channel, knots) in rows.iter_mut().zip(row) {
                *channel.get_mut(j)? = along_u.applied_to(knots);
            }
        }
        Some(rows.map(|knots| along_v.applied_to(knots)))
    }
}

/// Weights along one axis, of a place or of its derivative.
#[derive(Debug, Clone, Copy)]
struct Weights {
    /// 1 for the place, 0 for the derivative: exact either way.
    of_knot_1: f32,
    of_differences: [f32; 3],
}

impl Weights {
    fn of(place: Place) -> Self {
        Self {
            of_knot_1: 1.0,
            of_differences: place.weights,
        }
    }

    fn slope(of_differences: [f32; 3]) -> Self {
        Self {
            of_knot_1: 0.0,
            of_differences,
        }
    }

    fn applied_to(self, knots: [f32; 4]) -> f32 {
        let [_, b, ..] = knots;
        self.of_knot_1 * b + blend_slopes(self.of_differences, knots)
    }
}
