//! Bicubic B-splines of two channels over the cells of a grid, with f32 knots: the form of old versions.

use crate::PixelPoint;
use crate::format::Record;
use crate::grid::{Place, blend_slopes};
use crate::lookup::{Evaluated, Sample};
use crate::polynomial::Dual;

/// The sample of a table of f32 knots. `None` cannot happen in a blob that was opened: the size of
/// the table was checked.
#[inline(never)]
pub(crate) fn sample<T: Evaluated>(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    pixel: PixelPoint,
) -> Option<Sample<T>> {
    let is_central = record.is_central();
    let knots = |channels: usize| {
        let first = (record.grid_offset() >> 3) as usize + channels;
        Some(Knots {
            pairs: pairs.get(first..)?,
            stride: if is_central { 1 } else { 2 },
        })
    };
    let window = Window::at(record, pixel);
    Some(Sample {
        s: T::blend(&window, knots(0)?)?,
        n: if is_central {
            [T::from(0.0); 2]
        } else {
            T::blend(&window, knots(1)?)?
        },
    })
}

/// The knots of two channels of a camera, borrowed from the blob.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Knots<'a> {
    pairs: &'a [[f32; 2]],
    /// Every `stride`-th pair belongs to these channels.
    stride: usize,
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

    /// The spline at the pixel: first along u in each of four rows, then along v. `None` if there
    /// are too few knots.
    #[inline(always)]
    pub fn blend(&self, knots: Knots<'_>) -> Option<[f32; 2]> {
        self.blend_with(knots, Weights::of(self.u), Weights::of(self.v))
    }

    /// [`Window::blend`], the same bits, and its derivatives by u and v.
    #[inline(never)]
    pub fn blend_moving(&self, knots: Knots<'_>) -> Option<[Dual; 2]> {
        let [cells_u, cells_v] = self.record.cells();
        let slope_u = self.record.axis_u().slopes(self.pixel.u, cells_u);
        let slope_v = self.record.axis_v().slopes(self.pixel.v, cells_v);
        let [along_u, along_v] = [self.u, self.v].map(Weights::of);
        let value = self.blend_with(knots, along_u, along_v)?;
        let by_u = self.blend_with(knots, Weights::slope(slope_u), along_v)?;
        let by_v = self.blend_with(knots, along_u, Weights::slope(slope_v))?;
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

    /// Numbers of full size are blended as one of them and differences to it, whose round-off is
    /// smaller.
    #[inline(never)]
    fn blend_with(
        &self,
        Knots { pairs, stride }: Knots<'_>,
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
