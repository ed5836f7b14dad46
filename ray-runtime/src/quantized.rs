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
#[inline(always)]
pub(crate) fn lookup(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    from_edge: PixelPoint,
) -> Result<Ray, LookupError> {
    // Nothing of this is missing in a blob that was opened: the sizes of its parts were checked.
    let table = Table::of(pairs, record).ok_or(LookupError::Outside)?;
    let direction = table.direction().ok_or(LookupError::Outside)?;
    let s = table.value(direction, from_edge);
    if record.is_central() {
        return Ok(lookup::central_ray(record, s));
    }
    let offset = table.offset().ok_or(LookupError::Outside)?;
    let n = table.value(offset, from_edge);
    Ok(lookup::shifted_ray(record, Sample { s, n }))
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

/// A table: its header, and what follows.
#[derive(Clone, Copy)]
struct Table<'a> {
    record: Record<'a>,
    header: &'a [[f32; 2]; QUANTIZED_HEADER_PAIRS],
    rest: &'a [[f32; 2]],
}

/// One of a table's maps. Behind its coefficients and its knots, whatever follows.
#[derive(Clone, Copy)]
struct Map<'a> {
    degree: u8,
    number_len: u8,
    /// What a blend of knots counts.
    unit: f32,
    coefficients: &'a [[f32; 2]],
    knots: &'a [[f32; 2]],
}

impl<'a> Table<'a> {
    #[inline(always)]
    fn of(pairs: &'a [[f32; 2]], record: Record<'a>) -> Option<Self> {
        let start = (record.grid_offset() >> 3) as usize;
        let (header, rest) = pairs.get(start..)?.split_first_chunk()?;
        Some(Self {
            record,
            header,
            rest,
        })
    }

    /// Degree and bytes of a number of the direction, and of the offset.
    #[inline(always)]
    fn kinds(&self) -> [u8; 4] {
        self.header[0][0].to_bits().to_le_bytes()
    }

    #[inline(always)]
    fn direction(&self) -> Option<Map<'a>> {
        let [degree, number_len, offset_degree, _] = self.kinds();
        let offset_count = if self.record.is_central() {
            0
        } else {
            coefficient_count(offset_degree.into())
        };
        let knots = coefficient_count(degree.into()) + offset_count;
        Some(Map {
            degree,
            number_len,
            unit: self.header[1][0],
            coefficients: self.rest,
            knots: self.rest.get(knots..)?,
        })
    }

    #[inline(always)]
    fn offset(&self) -> Option<Map<'a>> {
        let direction = self.direction()?;
        let [_, _, degree, number_len] = self.kinds();
        let start = coefficient_count(direction.degree.into());
        let knots = if number_len == 0 {
            0
        } else {
            knots_len(self.record.cells(), direction.number_len).div_ceil(ALIGNMENT)
        };
        Some(Map {
            degree,
            number_len,
            unit: self.header[1][1],
            coefficients: self.rest.get(start..)?,
            knots: direction.knots.get(knots..)?,
        })
    }

    /// The variables of the polynomials.
    #[inline(always)]
    fn variables(&self, from_edge: PixelPoint) -> (f32, f32) {
        let [scale_u, scale_v] = self.header[2];
        (from_edge.u * scale_u - 1.0, from_edge.v * scale_v - 1.0)
    }

    #[inline(always)]
    fn places_per_px(&self) -> [f32; 2] {
        self.header[3]
    }

    #[inline(always)]
    fn value(&self, map: Map<'_>, from_edge: PixelPoint) -> [f32; 2] {
        let (x, y) = self.variables(from_edge);
        let (a, b) = polynomial::evaluate(map.coefficients, map.degree, x, y);
        let blend = match map.number_len {
            0 => return [a, b],
            1 => blend_of_bytes,
            _ => blend_of_words,
        };
        let left = blend(map.knots, self.record, self.places_per_px(), from_edge);
        [a + map.unit * left.0, b + map.unit * left.1]
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
        let window = Window::at(self.record, self.places_per_px(), from_edge);
        let [value_u, value_v] = window.shares.map(Weights::at);
        let [slope_u, slope_v] = window.shares.map(Weights::half_slopes);
        let per_px = [self.record.axis_u(), self.record.axis_v()].map(|axis| axis.cells_per_px);
        let ways = [
            (value_u, value_v, map.unit),
            (slope_u, value_v, map.unit * (2.0 * per_px[0])),
            (value_u, slope_v, map.unit * (2.0 * per_px[1])),
        ];
        for (way, (along_u, along_v, unit)) in ways.into_iter().enumerate() {
            let left = if map.number_len == 1 {
                window.blend::<[i8; 2]>(bytemuck::cast_slice(map.knots), along_u, along_v)?
            } else {
                window.blend(map.knots.as_flattened(), along_u, along_v)?
            };
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

/// The knots' blend at a pixel; not a number if there are too few.
#[inline(never)]
fn blend_of_words(
    knots: &[[f32; 2]],
    record: Record<'_>,
    places_per_px: [f32; 2],
    from_edge: PixelPoint,
) -> (f32, f32) {
    blend(knots.as_flattened(), record, places_per_px, from_edge)
}

/// The same of i8.
#[inline(never)]
fn blend_of_bytes(
    knots: &[[f32; 2]],
    record: Record<'_>,
    places_per_px: [f32; 2],
    from_edge: PixelPoint,
) -> (f32, f32) {
    blend::<[i8; 2]>(
        bytemuck::cast_slice(knots),
        record,
        places_per_px,
        from_edge,
    )
}

#[inline(always)]
fn blend<K: Knot>(
    knots: &[K],
    record: Record<'_>,
    places_per_px: [f32; 2],
    from_edge: PixelPoint,
) -> (f32, f32) {
    let window = Window::at(record, places_per_px, from_edge);
    let [along_u, along_v] = window.shares.map(Weights::at);
    match window.blend(knots, along_u, along_v) {
        Some((a, b)) => (a as f32, b as f32),
        None => (f32::NAN, f32::NAN),
    }
}
