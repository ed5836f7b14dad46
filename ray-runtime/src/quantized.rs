//! A table of a polynomial and of quantized spline knots, borrowed from the blob.
//!
//! What is not inlined takes and gives its numbers in registers: pairs come back as tuples, and a
//! number that is none stands for what is missing.

use crate::PixelPoint;
use crate::format::{ALIGNMENT, QUANTIZED_HEADER_PAIRS, Record, coefficient_count, knots_len};
use crate::knots::{Knot, Window};
use crate::lookup::{self, Evaluated, Sample};
use crate::polynomial::{self, Dual};
use crate::weights::Weights;
use crate::{LookupError, Ray};

/// The ray of a pixel of the calibrated area, seen from the outer edge of the region.
///
/// Its arguments fit the registers, so that it takes the place of what calls it last, on the stack too.
#[inline(never)]
pub(crate) fn lookup(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    from_edge: PixelPoint,
) -> Result<Ray, LookupError> {
    // Nothing of this is missing in a blob that was opened: the sizes of its parts were checked.
    let table = Table::of(pairs, record).ok_or(LookupError::Outside)?;
    let Some(polynomials) = table.usual_polynomials() else {
        return lookup_any(pairs, record, from_edge);
    };
    let sample = table.usual_sample(polynomials, from_edge);
    Ok(lookup::ray(record, sample.ok_or(LookupError::Outside)?))
}

/// [`lookup`] of any degrees and knots.
#[inline(never)]
fn lookup_any(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    from_edge: PixelPoint,
) -> Result<Ray, LookupError> {
    let table = Table::of(pairs, record).ok_or(LookupError::Outside)?;
    let sample = table.sample(from_edge).ok_or(LookupError::Outside)?;
    Ok(lookup::ray(record, sample))
}

/// The sample at a pixel of the region, with its derivatives by the pixel.
#[inline(never)]
pub(crate) fn sample_moving(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    pixel: PixelPoint,
) -> Option<Sample<Dual>> {
    let table = Table::of(pairs, record)?;
    let from_edge = lookup::from_edge(record, pixel);
    let s = table.value_moving(table.direction()?, from_edge)?;
    let n = if record.is_central() {
        [Dual::from(0.0); 2]
    } else {
        table.value_moving(table.offset()?, from_edge)?
    };
    Some(Sample { s, n })
}

/// A table, and whatever follows it.
#[derive(Clone, Copy)]
struct Table<'a> {
    record: Record<'a>,
    pairs: &'a [[f32; 2]],
    header: &'a [[f32; 2]; QUANTIZED_HEADER_PAIRS],
}

/// One of a table's maps.
#[derive(Clone, Copy)]
struct Map<'a> {
    degree: u8,
    number_len: u8,
    /// What a blend of knots counts.
    unit: f32,
    /// And whatever follows them.
    coefficients: &'a [[f32; 2]],
    /// Pairs of the table before the knots.
    knots_start: usize,
}

/// Coefficients of a cubic.
const CUBIC: usize = coefficient_count(3);

impl<'a> Table<'a> {
    #[inline(always)]
    fn of(pairs: &'a [[f32; 2]], record: Record<'a>) -> Option<Self> {
        let start = (record.grid_offset() >> 3) as usize;
        let pairs = pairs.get(start..)?;
        Some(Self {
            record,
            pairs,
            header: pairs.first_chunk()?,
        })
    }

    /// Degree and bytes of a number of the direction, and of the offset.
    #[inline(always)]
    fn kinds(&self) -> [u8; 4] {
        self.header[0][0].to_bits().to_le_bytes()
    }

    /// Pairs of the table before the knots of the direction.
    #[inline(always)]
    fn knots_start(&self) -> usize {
        (self.header[0][1].to_bits() >> 3) as usize
    }

    fn direction(&self) -> Option<Map<'a>> {
        let [degree, number_len, ..] = self.kinds();
        Some(Map {
            degree,
            number_len,
            unit: self.header[1][0],
            coefficients: self.pairs.get(QUANTIZED_HEADER_PAIRS..)?,
            knots_start: self.knots_start(),
        })
    }

    fn offset(&self) -> Option<Map<'a>> {
        let [direction_degree, direction_len, degree, number_len] = self.kinds();
        let start = QUANTIZED_HEADER_PAIRS + coefficient_count(direction_degree.into());
        let direction_knots = knots_len(self.record.cells(), direction_len).div_ceil(ALIGNMENT);
        Some(Map {
            degree,
            number_len,
            unit: self.header[1][1],
            coefficients: self.pairs.get(start..)?,
            knots_start: self.knots_start() + direction_knots,
        })
    }

    /// The variables of the polynomials.
    #[inline(always)]
    fn variables(&self, from_edge: PixelPoint) -> (f32, f32) {
        let [scale_u, scale_v] = self.header[2];
        (from_edge.u * scale_u - 1.0, from_edge.v * scale_v - 1.0)
    }

    /// The polynomials of what most tables are: knots of i16 on a cubic and, unless the camera is
    /// central, a polynomial of degree 3 at most for the offset. `None` of other tables.
    #[inline(always)]
    fn usual_polynomials(&self) -> Option<&'a [[f32; 2]; 2 * CUBIC]> {
        let [degree, number_len, offset_degree, offset_number_len] = self.kinds();
        if degree == 3 && number_len == 2 && offset_degree <= 3 && offset_number_len == 0 {
            let (_, polynomials) = self
                .pairs
                .first_chunk::<{ QUANTIZED_HEADER_PAIRS + 2 * CUBIC }>()?
                .split_first_chunk::<QUANTIZED_HEADER_PAIRS>()?;
            polynomials.first_chunk()
        } else {
            None
        }
    }

    /// The sample of such a table at a pixel, written out.
    #[inline(always)]
    fn usual_sample(
        &self,
        polynomials: &[[f32; 2]; 2 * CUBIC],
        from_edge: PixelPoint,
    ) -> Option<Sample<f32>> {
        let (direction, offset) = polynomials.split_first_chunk()?;
        let left = self.blend::<f32>(self.knots_start(), from_edge)?;
        let (x, y) = self.variables(from_edge);
        let [a, b] = polynomial::cubic(direction, x, y);
        let unit = self.header[1][0];
        let [_, _, offset_degree, _] = self.kinds();
        Some(Sample {
            s: [a + unit * left.0, b + unit * left.1],
            n: if self.record.is_central() {
                [0.0; 2]
            } else {
                polynomial::up_to_cubic(offset, offset_degree, x, y)?.into()
            },
        })
    }

    /// The sample at a pixel.
    fn sample(&self, from_edge: PixelPoint) -> Option<Sample<f32>> {
        let s = self.value(self.direction()?, from_edge)?;
        let n = if self.record.is_central() {
            [0.0; 2]
        } else {
            self.value(self.offset()?, from_edge)?
        };
        Some(Sample { s, n })
    }

    fn value(&self, map: Map<'_>, from_edge: PixelPoint) -> Option<[f32; 2]> {
        let (x, y) = self.variables(from_edge);
        let (a, b) = polynomial::evaluate(map.coefficients, map.degree, x, y);
        let left = match map.number_len {
            0 => return Some([a, b]),
            1 => self.blend::<[i8; 2]>(map.knots_start, from_edge)?,
            _ => self.blend::<f32>(map.knots_start, from_edge)?,
        };
        Some([a + map.unit * left.0, b + map.unit * left.1])
    }

    /// The knots' blend at a pixel, in units.
    #[inline(always)]
    fn blend<K: Knot>(&self, knots_start: usize, from_edge: PixelPoint) -> Option<(f32, f32)> {
        let window = Window::at(self.record, self.header[3], from_edge);
        let [along_u, along_v] = window.shares.map(Weights::at);
        let (a, b) = window.blend::<K>(self.pairs, knots_start, along_u, along_v)?;
        Some((a as f32, b as f32))
    }

    fn value_moving(&self, map: Map<'_>, from_edge: PixelPoint) -> Option<[Dual; 2]> {
        let (x, y) = self.variables(from_edge);
        let [scale_u, scale_v] = self.header[2];
        let (x, y) = (Dual::along_u(x, scale_u), Dual::along_v(y, scale_v));
        let (a, b) = polynomial::row_by_row(map.coefficients, map.degree, x, y);
        let mut sums = [a, b];
        if map.number_len == 0 {
            return Some(sums);
        }
        let window = Window::at(self.record, self.header[3], from_edge);
        let [value_u, value_v] = window.shares.map(Weights::at);
        let [slope_u, slope_v] = window.shares.map(Weights::half_slopes);
        let per_px = [self.record.axis_u(), self.record.axis_v()].map(|axis| axis.cells_per_px);
        let ways = [
            (value_u, value_v, map.unit),
            (slope_u, value_v, map.unit * (2.0 * per_px[0])),
            (value_u, slope_v, map.unit * (2.0 * per_px[1])),
        ];
        for (way, (along_u, along_v, unit)) in ways.into_iter().enumerate() {
            let blend = if map.number_len == 1 {
                Window::blend::<[i8; 2]>
            } else {
                Window::blend::<f32>
            };
            let left = blend(&window, self.pairs, map.knots_start, along_u, along_v)?;
            for (sum, left) in sums.iter_mut().zip([left.0, left.1]) {
                let part = match way {
                    0 => &mut sum.value,
                    1 => &mut sum.by_u,
                    _ => &mut sum.by_v,
                };
                *part += unit * left as f32;
            }
        }
        Some(sums)
    }
}
