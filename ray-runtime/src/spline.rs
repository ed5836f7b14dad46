//! Bicubic B-splines of two channels over the cells of a grid.

use crate::PixelPoint;
use crate::format::Record;
use crate::grid::{Place, blend, blend_slopes};
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
    pub fn blend(&self, knots: Knots<'_>) -> Option<[f32; 2]> {
        match knots {
            Knots::I16(pairs) => self.blend_pairs(pairs),
            Knots::I8(pairs) => self.blend_pairs(pairs),
            Knots::F32 { .. } => self.blend_any(knots, Weights::of(self.u), Weights::of(self.v)),
        }
    }

    /// [`Window::blend`], the same bits, and its derivatives by u and v.
    ///
    /// It is for size, where the other is for speed.
    #[inline(never)]
    pub fn blend_moving(&self, knots: Knots<'_>) -> Option<[Dual; 2]> {
        let [cells_u, cells_v] = self.record.cells();
        let [along_u, along_v] = [self.u, self.v].map(Weights::of);
        let slope_u = Weights::slope(self.record.axis_u().slopes(self.pixel.u, cells_u));
        let slope_v = Weights::slope(self.record.axis_v().slopes(self.pixel.v, cells_v));
        let value = self.blend_any(knots, along_u, along_v)?;
        let by_u = self.blend_any(knots, slope_u, along_v)?;
        let by_v = self.blend_any(knots, along_u, slope_v)?;
        let dual = |value, by_u, by_v| Dual { value, by_u, by_v };
        Some([
            dual(value[0], by_u[0], by_v[0]),
            dual(value[1], by_u[1], by_v[1]),
        ])
    }

    /// Number of the first knot in row `j` of the four.
    fn start(&self, j: usize) -> usize {
        (self.v.cell + j) * self.knots_u + self.u.cell
    }

    fn blend_pairs<T: Copy + Into<f32>>(&self, pairs: &[[T; 2]]) -> Option<[f32; 2]> {
        let row = |j: usize| -> Option<[f32; 2]> {
            let [a, b, c, d] = pairs.get(self.start(j)..)?.first_chunk::<4>()?;
            let along_u = |knots: [T; 4]| blend(self.u.weights, knots.map(<T as Into<f32>>::into));
            Some([
                along_u([a[0], b[0], c[0], d[0]]),
                along_u([a[1], b[1], c[1], d[1]]),
            ])
        };
        let (a, b, c, d) = (row(0)?, row(1)?, row(2)?, row(3)?);
        let along_v = |knots| blend(self.v.weights, knots);
        Some([
            along_v([a[0], b[0], c[0], d[0]]),
            along_v([a[1], b[1], c[1], d[1]]),
        ])
    }

    #[inline(never)]
    fn blend_any(&self, knots: Knots<'_>, along_u: Weights, along_v: Weights) -> Option<[f32; 2]> {
        let mut rows = [[0.0; 4]; 2];
        for j in 0..4 {
            let mut row = [[0.0; 4]; 2];
            for i in 0..4 {
                let pair = knots.get(self.start(j) + i)?;
                for (channel, value) in row.iter_mut().zip(pair) {
                    *channel.get_mut(i)? = value;
                }
            }
            for (channel, knots) in rows.iter_mut().zip(row) {
                *channel.get_mut(j)? = along_u.applied_to(knots);
            }
        }
        Some(rows.map(|knots| along_v.applied_to(knots)))
    }
}

impl Knots<'_> {
    fn get(&self, number: usize) -> Option<[f32; 2]> {
        match *self {
            Self::F32 { pairs, stride } => pairs.get(number * stride).copied(),
            Self::I16(pairs) => pairs.get(number).map(|pair| pair.map(f32::from)),
            Self::I8(pairs) => pairs.get(number).map(|pair| pair.map(f32::from)),
        }
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
        self.of_knot_1 * knots[1] + blend_slopes(self.of_differences, knots)
    }
}
