//! A table of a polynomial and of quantized spline knots, borrowed from the blob.
//!
//! The knots are small integers and are blended as such: the same bits on every target, in a third of
//! the instructions that numbers take. Weights are in units of 2^-15; those of the two middle knots
//! follow from the outer two so that a straight line through the knots comes out as that line, and
//! what the outer ones are rounded by meets second differences of the knots alone.
//!
//! What is not inlined takes and gives its numbers in registers: pairs come back as tuples, and a
//! number that is none stands for what is missing.

use crate::PixelPoint;
use crate::format::{Axis, Record};
use crate::lookup::{self, Evaluated, Sample};
use crate::polynomial::{self, Dual};
use crate::{LookupError, Ray};

/// The ray of a pixel of the calibrated area, seen from the outer edge of the region.
///
/// What is written out here is the cubic with knots of i16 and, unless the camera is central, a cubic
/// for the offset: one call, before there is much to keep.
#[inline(always)]
pub(crate) fn lookup(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    from_edge: PixelPoint,
) -> Result<Ray, LookupError> {
    // None of this is missing in a blob that was opened: the sizes of its parts were checked.
    let table = Table::of(pairs, record).ok_or(LookupError::Outside)?;
    let (direction, offset) = (Map::read(table.direction), Map::read(table.offset));
    // Odd numbers are central.
    let is_central = record.encoding() & 1 == 1;
    let is_written_out = direction.kind == CUBIC_AND_WORDS && (is_central || offset.kind == CUBIC);
    let [knots, of_direction, of_offset] = [
        direction.knots_start,
        direction.coefficients_start,
        offset.coefficients_start,
    ]
    .map(|start| table.behind(start));
    if let (true, Some(knots), Some(of_direction), Some(of_offset)) = (
        is_written_out,
        knots,
        of_direction.and_then(|c| c.first_chunk()),
        of_offset.and_then(|c| c.first_chunk()),
    ) {
        let left = left_of_words(knots, record, from_edge);
        let (x, y) = table.variables(from_edge);
        let [a, b] = polynomial::cubic(of_direction, x, y);
        let s = [a + direction.unit * left.0, b + direction.unit * left.1];
        return Ok(if is_central {
            lookup::central_ray(record, s)
        } else {
            let n = polynomial::cubic(of_offset, x, y);
            lookup::shifted_ray(record, Sample { s, n })
        });
    }
    lookup_any(pairs, record, from_edge)
}

/// [`lookup`] of any degrees and knots.
#[inline(never)]
fn lookup_any(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    from_edge: PixelPoint,
) -> Result<Ray, LookupError> {
    let table = Table::of(pairs, record).ok_or(LookupError::Outside)?;
    let value = |map| table.map(Map::read(map), record, from_edge);
    let s = value(table.direction).ok_or(LookupError::Outside)?;
    if record.encoding() & 1 == 1 {
        return Ok(lookup::central_ray(record, s));
    }
    let n = value(table.offset).ok_or(LookupError::Outside)?;
    Ok(lookup::shifted_ray(record, Sample { s, n }))
}

/// [`sample`], the same bits, and its derivatives by the pixel; for size, where that is for speed.
#[inline(never)]
pub(crate) fn sample_moving(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    pixel: PixelPoint,
) -> Option<Sample<Dual>> {
    let table = Table::of(pairs, record)?;
    let mut maps = [[Dual::from(0.0); 2]; 2];
    // Odd numbers are central.
    let count = 2 - (record.encoding() & 1) as usize;
    for (map, header) in maps
        .iter_mut()
        .zip([table.direction, table.offset])
        .take(count)
    {
        *map = table.map_moving(Map::read(header), record, pixel)?;
    }
    let [s, n] = maps;
    Some(Sample { s, n })
}

/// A table and the parts of its header.
struct Table<'a> {
    pairs: &'a [[f32; 2]],
    direction: [&'a [f32; 2]; 2],
    offset: [&'a [f32; 2]; 2],
    scale: [f32; 2],
}

impl<'a> Table<'a> {
    #[inline(always)]
    fn of(pairs: &'a [[f32; 2]], record: Record<'_>) -> Option<Self> {
        let start = (record.grid_offset() >> 3) as usize;
        let pairs = pairs.get(start..)?;
        let [direction_a, direction_b, offset_a, offset_b, scale] = pairs.first_chunk()?;
        Some(Self {
            pairs,
            direction: [direction_a, direction_b],
            offset: [offset_a, offset_b],
            scale: *scale,
        })
    }

    /// From a byte of the table on.
    #[inline(always)]
    fn behind(&self, start: u32) -> Option<&'a [[f32; 2]]> {
        self.pairs.get((start >> 3) as usize..)
    }

    /// The variables of the polynomials at a pixel.
    #[inline(always)]
    fn variables(&self, from_edge: PixelPoint) -> (f32, f32) {
        let [scale_u, scale_v] = self.scale;
        (from_edge.u * scale_u - 1.0, from_edge.v * scale_v - 1.0)
    }

    /// The value of one of the maps.
    fn map(&self, map: Map, record: Record<'_>, from_edge: PixelPoint) -> Option<[f32; 2]> {
        let coefficients = self.behind(map.coefficients_start)?;
        let (x, y) = self.variables(from_edge);
        let (a, b) = polynomial::evaluate(coefficients, map.degree(), x, y);
        if map.number_len() == 0 {
            return Some([a, b]);
        }
        let knots = self.behind(map.knots_start)?;
        let left = if map.number_len() == 1 {
            left_of_bytes(knots, record, from_edge)
        } else {
            left_of_words(knots, record, from_edge)
        };
        Some([a + map.unit * left.0, b + map.unit * left.1])
    }

    fn map_moving(&self, map: Map, record: Record<'_>, pixel: PixelPoint) -> Option<[Dual; 2]> {
        let (axis_u, axis_v) = (record.axis_u(), record.axis_v());
        let from_edge = lookup::from_edge(record, pixel);
        let (x, y) = self.variables(from_edge);
        let [scale_u, scale_v] = self.scale;
        let (x, y) = (Dual::along_u(x, scale_u), Dual::along_v(y, scale_v));
        let coefficients = self.behind(map.coefficients_start)?;
        let (a, b) = polynomial::row_by_row(coefficients, map.degree(), x, y);
        let mut sums = [a, b];
        if map.number_len() == 0 {
            return Some(sums);
        }
        let knots = self.behind(map.knots_start)?;
        let window = Window::at(record, from_edge);
        let (u, v) = (window.u, window.v);
        let ways = [
            (Weights::at(u), row_weights(v), 1.0),
            (Weights::slopes(u), row_weights(v), axis_u.cells_per_px),
            (Weights::at(u), row_slopes(v), axis_v.cells_per_px),
        ];
        for (way, (along_u, along_v, per_px)) in ways.into_iter().enumerate() {
            let left = if map.number_len() == 1 {
                window.blend_bytes(knots, along_u, along_v)?
            } else {
                window.blend_words(knots, along_u, along_v)?
            };
            let unit = map.unit * per_px;
            for (sum, left) in sums.iter_mut().zip(left) {
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

/// What a header says of one of the maps.
#[derive(Clone, Copy)]
struct Map {
    /// Degree, and bytes of a number.
    kind: u32,
    /// What a blend counts.
    unit: f32,
    coefficients_start: u32,
    knots_start: u32,
}

const CUBIC: u32 = 3;
const CUBIC_AND_WORDS: u32 = 0x0203;

impl Map {
    #[inline(always)]
    fn read([[kind, step], [coefficients, knots]]: [&[f32; 2]; 2]) -> Self {
        Self {
            kind: kind.to_bits(),
            unit: step * BLEND_UNIT,
            coefficients_start: coefficients.to_bits(),
            knots_start: knots.to_bits(),
        }
    }

    const fn degree(self) -> u8 {
        self.kind as u8
    }

    const fn number_len(self) -> u8 {
        (self.kind >> 8) as u8
    }
}

/// The knots' blend at a pixel; not a number if there are too few.
#[inline(never)]
fn left_of_words(knots: &[[f32; 2]], record: Record<'_>, from_edge: PixelPoint) -> (f32, f32) {
    let window = Window::at(record, from_edge);
    as_numbers(window.blend_words(knots, Weights::at(window.u), row_weights(window.v)))
}

/// The same of i8.
#[inline(never)]
fn left_of_bytes(knots: &[[f32; 2]], record: Record<'_>, from_edge: PixelPoint) -> (f32, f32) {
    let window = Window::at(record, from_edge);
    as_numbers(window.blend_bytes(knots, Weights::at(window.u), row_weights(window.v)))
}

#[inline(always)]
fn as_numbers(blend: Option<[i32; 2]>) -> (f32, f32) {
    blend.map_or((f32::NAN, f32::NAN), |[a, b]| (a as f32, b as f32))
}

/// What a blend counts, in steps of the knots.
const BLEND_UNIT: f32 = 1.0 / 16384.0;

/// One, in units of the weights.
const ONE: i32 = 1 << 15;

/// The 4 x 4 knots that matter at a pixel.
#[derive(Clone, Copy)]
struct Window {
    /// Number of the first.
    first: usize,
    /// Knots in a row.
    stride: u16,
    /// The shares of the cell before the pixel.
    u: i32,
    v: i32,
}

impl Window {
    /// The window of a pixel in the region, from the region's outer edge.
    #[inline(always)]
    fn at(record: Record<'_>, from_edge: PixelPoint) -> Self {
        let [cells_u, cells_v] = record.cells();
        let axes = (record.axis_u(), record.axis_v());
        // At the very end of a row the next cell may come out: its first three knots are the last of
        // the row, and the fourth has no weight. There always is one, as a mask follows the knots.
        let place_u = place(axes.0, from_edge.u);
        // `open` saw to it that there is a cell, and not too many.
        let place_v = place(axes.1, from_edge.v).min(cells_v.wrapping_shl(15).wrapping_sub(1));
        let (cell_u, u) = cell_and_share(place_u);
        let (cell_v, v) = cell_and_share(place_v);
        // No more cells than fit, as `open` saw.
        let stride = (cells_u + 3) as u16;
        Self {
            first: cell_v * usize::from(stride) + cell_u,
            stride,
            u,
            v,
        }
    }

    /// The knots blended with weights along u and v, in units of 2^-14: first along u in each of the
    /// four rows, without any rounding, then along v. `None` if there are too few knots.
    #[inline(always)]
    fn blend_words(
        &self,
        knots: &[[f32; 2]],
        along_u: Weights,
        along_v: RowWeights,
    ) -> Option<[i32; 2]> {
        self.blend_rows(knots.as_flattened(), along_u, along_v, row_of_words)
    }

    #[inline(always)]
    fn blend_bytes(
        &self,
        knots: &[[f32; 2]],
        along_u: Weights,
        along_v: RowWeights,
    ) -> Option<[i32; 2]> {
        self.blend_rows(bytemuck::cast_slice(knots), along_u, along_v, row_of_bytes)
    }

    /// A row's blend stays within 2^30, as the sum of the weights does within 2^15.
    #[inline(always)]
    fn blend_rows<K>(
        &self,
        knots: &[K],
        along_u: Weights,
        along_v: RowWeights,
        row: impl Fn(&[K; 4], Weights) -> (i32, i32),
    ) -> Option<[i32; 2]> {
        let rows = knots.get(self.first..)?;
        // One check in place of four: the compiler sees what follows from it.
        let stride = usize::from(self.stride);
        if rows.len() < 3 * stride + 4 {
            return None;
        }
        let mut sums = [0; 2];
        for (j, weight) in along_v.into_iter().enumerate() {
            let four = rows.get(j * stride..j * stride + 4)?;
            let (a, b) = row(four.first_chunk()?, along_u);
            sums[0] += high_word(a, weight);
            sums[1] += high_word(b, weight);
        }
        Some(sums)
    }
}

/// A row of knots blended along u. Not inlined: four at once are more than there are registers for.
#[inline(never)]
fn row_of_words(row: &[f32; 4], weights: Weights) -> (i32, i32) {
    // The first number of a knot is the lower half of its word.
    let [a, b, c, d] = row.map(|knot| knot.to_bits().cast_signed());
    let Weights(first, second) = weights;
    (
        low(first) * low(a) + high(first) * low(b) + low(second) * low(c) + high(second) * low(d),
        low(first) * high(a)
            + high(first) * high(b)
            + low(second) * high(c)
            + high(second) * high(d),
    )
}

#[inline(never)]
fn row_of_bytes(row: &[[i8; 2]; 4], weights: Weights) -> (i32, i32) {
    let [a, b, c, d] = row.map(|knot| knot.map(i32::from));
    let Weights(first, second) = weights;
    (
        low(first) * a[0] + high(first) * b[0] + low(second) * c[0] + high(second) * d[0],
        low(first) * a[1] + high(first) * b[1] + low(second) * c[1] + high(second) * d[1],
    )
}

/// Cells before a coordinate that the axis contains, in units of 2^-15: to half a unit, which moves
/// the blend by less than the knots' own rounding, even if neighbors differ by all of their range.
///
/// They are taken from one product, whose round-off of 2^-24 of the axis moves a place by less than
/// the unit on grids of up to 512 cells; only what the polynomial leaves sees it.
#[inline(always)]
fn place(axis: Axis, from_edge_px: f32) -> u32 {
    (from_edge_px * axis.cells_per_px * ONE as f32 + 0.5) as u32
}

/// The cell, and the share of it that lies before the place.
#[inline(always)]
fn cell_and_share(place: u32) -> (usize, i32) {
    ((place >> 15) as usize, (place & 0x7fff).cast_signed())
}

/// Weights of four knots, two to a word.
#[derive(Clone, Copy)]
struct Weights(i32, i32);

impl Weights {
    #[inline(always)]
    fn new(a: i32, b: i32, c: i32, d: i32) -> Self {
        Self((a & 0xffff) | b << 16, (c & 0xffff) | d << 16)
    }
}

#[inline(always)]
fn low(word: i32) -> i32 {
    i32::from(word as i16)
}

#[inline(always)]
fn high(word: i32) -> i32 {
    word >> 16
}

impl Weights {
    /// The weights of the cubic B-spline at a share of a cell, all negative; as those along the other
    /// axis are too, the signs cancel. (Of positive ones the compiler knows that they are, and
    /// multiplies them as numbers without a sign, for which there are no such instructions.)
    #[inline(always)]
    fn at(share: i32) -> Self {
        let behind = ONE - share;
        let (a, d) = (sixth_of_cube(behind) >> 16, sixth_of_cube(share) >> 16);
        Self::new(-a, 2 * a - d - behind, 2 * d - a - share, -d)
    }

    /// Their derivatives by the share.
    fn slopes(share: i32) -> Self {
        let [a, b, c, d] = slopes(share);
        Self::new(a, b, c, d)
    }
}

/// Weights of four rows, in units of 2^-31.
type RowWeights = [i32; 4];

/// [`Weights::at`] along v.
#[inline(always)]
fn row_weights(share: i32) -> RowWeights {
    let behind = ONE - share;
    let (a, d) = (sixth_of_cube(behind), sixth_of_cube(share));
    // A one does not fit, but what comes out does.
    let b = (2 * a).wrapping_sub(d).wrapping_sub(behind << 16);
    let c = (2 * d).wrapping_sub(a).wrapping_sub(share << 16);
    [-a, b, c, -d]
}

fn row_slopes(share: i32) -> RowWeights {
    slopes(share).map(|slope| slope << 16)
}

fn slopes(share: i32) -> [i32; 4] {
    let behind = ONE - share;
    let (a, d) = ((behind * behind) >> 16, -((share * share) >> 16));
    [a, ONE + d - 2 * a, a - 2 * d - ONE, d]
}

/// A sixth of the cube of a share, in units of 2^-31.
#[inline(always)]
fn sixth_of_cube(share: i32) -> i32 {
    // 2^18 / 6: the square is in units of 2^-30, and 32 binary digits are left out.
    const SIXTH: i32 = 43691;
    let (square, sixth) = (share * share, share * SIXTH);
    let product = u64::from(square.cast_unsigned()) * u64::from(sixth.cast_unsigned());
    (product >> 32) as i32
}

#[inline(always)]
fn high_word(a: i32, b: i32) -> i32 {
    ((i64::from(a) * i64::from(b)) >> 32) as i32
}
