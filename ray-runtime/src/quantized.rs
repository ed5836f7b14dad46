//! A table of a polynomial and of quantized spline knots, borrowed from the blob.
//!
//! What most tables are is written out in one function that calls no other; everything else is put
//! together from parts.

use crate::PixelPoint;
use crate::format::{
    ALIGNMENT, PLACES_PER_CELL, QUANTIZED_HEADER_PAIRS, Record, coefficient_count, knots_len,
};
use crate::grid::Inside;
use crate::knots::Window;
use crate::lookup::{self, Evaluated, Sample};
use crate::polynomial::{self, AlongX, Dual};
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
    if table.is_usual() {
        lookup_usual(table.pairs, record, from_edge)
    } else {
        lookup_any(table.pairs, record, from_edge)
    }
}

/// The ray from a usual table, written out.
///
/// The arguments of this and of [`lookup_any`] fit the registers, so that they take the place of what
/// calls them last, on the stack too.
#[inline(never)]
fn lookup_usual(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    from_edge: PixelPoint,
) -> Result<Ray, LookupError> {
    let sample = Table::starting(pairs, record).and_then(|table| table.usual_sample(from_edge));
    Ok(lookup::ray(record, sample.ok_or(LookupError::Outside)?))
}

/// The ray from any table.
#[inline(never)]
fn lookup_any(
    pairs: &[[f32; 2]],
    record: Record<'_>,
    from_edge: PixelPoint,
) -> Result<Ray, LookupError> {
    let sample = Table::starting(pairs, record).and_then(|table| table.sample(from_edge));
    Ok(lookup::ray(record, sample.ok_or(LookupError::Outside)?))
}

/// A row of a usual table: what of it does not depend on u.
#[derive(Clone, Copy)]
pub(crate) struct UsualRow<'a> {
    record: Record<'a>,
    direction: AlongX<'a>,
    offset: AlongX<'a>,
    /// What a blend of knots counts.
    unit: f32,
    scale: f32,
    places_per_px: f32,
    along_v: Weights,
    window: Window,
    /// The row's first knot, and all behind it.
    knots: &'a [f32],
}

impl<'a> UsualRow<'a> {
    /// The row of a place along v; `None` if the table is not a usual one.
    pub fn of(pairs: &'a [[f32; 2]], record: Record<'a>, v: Inside) -> Option<Self> {
        let table = Table::of(pairs, record).filter(Table::is_usual)?;
        let from_edge = PixelPoint::new(0.0, v.from_edge_px);
        let (_, y) = table.variables(from_edge);
        let (_, coefficients) = table.pairs.split_first_chunk::<QUANTIZED_HEADER_PAIRS>()?;
        let (direction, rest) = coefficients.split_first_chunk::<CUBIC>()?;
        let offset = if record.is_central() {
            // Not asked for.
            direction
        } else {
            rest.first_chunk()?
        };
        let window = Window::at(record, table.header[3], from_edge);
        Some(Self {
            record,
            direction: AlongX::new(direction, y),
            offset: AlongX::new(offset, y),
            unit: table.header[1][0],
            scale: table.header[2][0],
            places_per_px: table.header[3][0],
            along_v: Weights::at(window.shares[1]),
            window,
            knots: window.words(table.pairs, table.knots_start())?,
        })
    }

    #[inline(always)]
    pub fn record(&self) -> Record<'a> {
        self.record
    }

    /// Along u.
    #[inline(always)]
    pub fn places_per_px(&self) -> f32 {
        self.places_per_px
    }

    /// The half-angle vector at a pixel of a cell, and the variable of the polynomials.
    #[inline(always)]
    pub fn direction(&self, cell: usize, from_edge_px: f32) -> Option<([f32; 2], f32)> {
        let place = (from_edge_px * self.places_per_px) as u32;
        let share = place % PLACES_PER_CELL;
        let along_u = Weights::at(share.cast_signed());
        let along = [along_u, self.along_v];
        let left = self.window.blend_cell(self.knots, cell, along)?;
        let x = from_edge_px * self.scale - 1.0;
        let [a, b] = self.direction.at(x);
        let s = [a + self.unit * left.0 as f32, b + self.unit * left.1 as f32];
        Some((s, x))
    }

    /// The offset at a variable of the polynomials.
    #[inline(always)]
    pub fn offset(&self, x: f32) -> [f32; 2] {
        self.offset.at(x)
    }
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
    /// Bytes of a knot's number.
    number_len: u8,
    /// What a blend of knots counts.
    unit: f32,
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
        Self::starting(pairs.get(start..)?, record)
    }

    #[inline(always)]
    fn starting(pairs: &'a [[f32; 2]], record: Record<'a>) -> Option<Self> {
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
            number_len,
            unit: self.header[1][0],
            coefficients: self.coefficients(QUANTIZED_HEADER_PAIRS, degree)?,
            knots_start: self.knots_start(),
        })
    }

    fn offset(&self) -> Option<Map<'a>> {
        let [direction_degree, direction_len, degree, number_len] = self.kinds();
        let start = QUANTIZED_HEADER_PAIRS + coefficient_count(direction_degree.into());
        let direction_knots = knots_len(self.record.cells(), direction_len).div_ceil(ALIGNMENT);
        Some(Map {
            number_len,
            unit: self.header[1][1],
            coefficients: self.coefficients(start, degree)?,
            knots_start: self.knots_start() + direction_knots,
        })
    }

    fn coefficients(&self, start: usize, degree: u8) -> Option<&'a [[f32; 2]]> {
        self.pairs
            .get(start..)?
            .get(..coefficient_count(degree.into()))
    }

    /// The variables of the polynomials.
    #[inline(always)]
    fn variables(&self, from_edge: PixelPoint) -> (f32, f32) {
        let [scale_u, scale_v] = self.header[2];
        (from_edge.u * scale_u - 1.0, from_edge.v * scale_v - 1.0)
    }

    /// Whether it is what most tables are: knots of i16 on a cubic and, unless the camera is central, a
    /// cubic for the offset.
    #[inline(always)]
    fn is_usual(&self) -> bool {
        let kinds = if self.record.is_central() {
            [3, 2, 0, 0]
        } else {
            [3, 2, 3, 0]
        };
        self.header[0][0].to_bits() == u32::from_le_bytes(kinds)
    }

    /// The sample of such a table at a pixel.
    #[inline(always)]
    fn usual_sample(&self, from_edge: PixelPoint) -> Option<Sample<f32>> {
        let (_, coefficients) = self.pairs.split_first_chunk::<QUANTIZED_HEADER_PAIRS>()?;
        let (direction, rest) = coefficients.split_first_chunk::<CUBIC>()?;
        let window = Window::at(self.record, self.header[3], from_edge);
        let along = window.shares.map(Weights::at);
        let left = window.blend_words(self.pairs, self.knots_start(), along)?;
        let (x, y) = self.variables(from_edge);
        let [a, b] = polynomial::cubic(direction, x, y);
        let unit = self.header[1][0];
        let s = [a + unit * left.0 as f32, b + unit * left.1 as f32];
        let n = if self.record.is_central() {
            [0.0; 2]
        } else {
            polynomial::cubic(rest.first_chunk()?, x, y)
        };
        Some(Sample { s, n })
    }

    /// The sample at a pixel.
    #[inline(always)]
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
        let (a, b) = polynomial::evaluate(map.coefficients, x, y);
        if map.number_len == 0 {
            return Some([a, b]);
        }
        let window = Window::at(self.record, self.header[3], from_edge);
        let along = window.shares.map(Weights::at);
        let left = window.blend(self.pairs, map.knots_start, map.number_len, along)?;
        Some([a + map.unit * left.0 as f32, b + map.unit * left.1 as f32])
    }

    fn value_moving(&self, map: Map<'_>, from_edge: PixelPoint) -> Option<[Dual; 2]> {
        let (x, y) = self.variables(from_edge);
        let [scale_u, scale_v] = self.header[2];
        let (x, y) = (Dual::along_u(x, scale_u), Dual::along_v(y, scale_v));
        let mut sums = polynomial::evaluate_moving(map.coefficients, x, y);
        if map.number_len == 0 {
            return Some(sums);
        }
        let window = Window::at(self.record, self.header[3], from_edge);
        let [value_u, value_v] = window.shares.map(Weights::at);
        let [slope_u, slope_v] = window.shares.map(Weights::half_slopes);
        let per_px = [self.record.axis_u(), self.record.axis_v()].map(|axis| axis.cells_per_px);
        let ways = [
            ([value_u, value_v], map.unit),
            ([slope_u, value_v], map.unit * (2.0 * per_px[0])),
            ([value_u, slope_v], map.unit * (2.0 * per_px[1])),
        ];
        for (way, (along, unit)) in ways.into_iter().enumerate() {
            let left = window.blend(self.pairs, map.knots_start, map.number_len, along)?;
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
