//! A camera of a blob, prepared: what of its record and table can be taken apart once.

use super::axis::{Axis, Place};
use super::float::{Digits, normalized};
use super::knots;
use super::polynomial::{self, CUBIC, Shares};
use super::product::product;
use super::ray::{FixedPixel, Pose, Sample, ray};
use super::spline;
use crate::format::{
    ALIGNMENT, Encoding, Form, QUANTIZED_HEADER_PAIRS, QuantizedHeader, QuantizedMap, Record,
    coefficient_count, knots_len,
};
use crate::lookup::{HAS_PATCHES, HAS_QUANTIZED, HAS_SPLINES, Views};

/// Binary digits of half-angle vectors behind the point.
const S_DIGITS: Digits = Digits::new(28);
/// Binary digits of rotations behind the point.
const R_DIGITS: Digits = Digits::new(30);

/// A camera.
// In this order, so that instructions of 16 binary digits reach all but the last.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Camera<'a> {
    axes: [Axis; 2],
    views: Views<'a>,
    mask_offset: u32,
    /// Where the table starts, in pairs of the blob.
    start: usize,
    is_central: bool,
    /// Binary digits of lengths behind the point.
    n_digits: i32,
    pose: Pose,
    table: Table,
}

/// What a table is made of.
#[derive(Debug, Clone, Copy)]
enum Table {
    Patches,
    Spline,
    /// Knots of i16 on a cubic and, unless the camera is central, a cubic for the offset.
    Usual(Usual),
    Quantized(QuantizedHeader),
}

/// A usual quantized table.
#[derive(Debug, Clone, Copy)]
struct Usual {
    knots_start: usize,
    unit: Unit,
    direction: [[i32; 2]; CUBIC],
    offset: [[i32; 2]; CUBIC],
}

/// What a blend of quantized knots counts, as digits of what it is added to.
#[derive(Debug, Clone, Copy)]
struct Unit {
    /// The highest binary digits.
    digits: i32,
    /// By how much the product with them is shifted down; up where it is negative.
    down: i32,
}

impl Unit {
    fn new(unit: f32, digits: i32) -> Self {
        let (word, exponent) = normalized(unit);
        // Half of the word, and the product without its lower half.
        let down = -(exponent + 33 + digits);
        let is_some = unit.to_bits() != 0 && (-31..32).contains(&down);
        Self {
            digits: if is_some {
                (word >> 1).cast_signed()
            } else {
                0
            },
            down: if is_some { down } else { 0 },
        }
    }

    #[inline(always)]
    fn times(self, blend: i32) -> i32 {
        let product = product::<0>(blend, self.digits);
        if self.down >= 0 {
            product >> (self.down & 31)
        } else {
            product << (-self.down & 31)
        }
    }
}

impl<'a> Camera<'a> {
    /// From what [`Bounds`](super::bounds::Bounds) has found to fit; lengths have so many binary digits behind the point.
    /// `None` of cells that are smaller than a pixel.
    pub fn prepare(views: Views<'a>, record: Record<'a>, length_digits: i32) -> Option<Self> {
        let ([cells_u, cells_v], [mask_u, mask_v]) = (record.cells(), record.mask_cells());
        let n_digits = Digits::new(length_digits);
        let start = (record.grid_offset() >> 3) as usize;
        let table = match Encoding::from_number(record.encoding())?.form {
            Form::Spline => Table::Spline,
            Form::Patches => Table::Patches,
            Form::Quantized => {
                let pairs = views.pairs.get(start..)?;
                let header = QuantizedHeader::read(pairs)?;
                usual(pairs, header, record.is_central(), length_digits)
                    .map_or(Table::Quantized(header), Table::Usual)
            }
        };
        Some(Self {
            views,
            mask_offset: record.mask_offset(),
            axes: [
                Axis::prepare(record.axis_u(), cells_u, mask_u)?,
                Axis::prepare(record.axis_v(), cells_v, mask_v)?,
            ],
            pose: Pose {
                rotation: record.rotation().map(|number| R_DIGITS.fixed(number)),
                translation: record.translation_mm().map(|number| n_digits.fixed(number)),
            },
            n_digits: length_digits,
            table,
            is_central: record.is_central(),
            start,
        })
    }

    /// Origin and direction of a pixel's ray; `None` of a pixel that is not calibrated, or sees too far to the
    /// side.
    #[inline(always)]
    pub fn ray(&self, pixel: FixedPixel) -> Option<([i32; 3], [i32; 3])> {
        let [axis_u, axis_v] = &self.axes;
        let (u, v) = (axis_u.place(pixel.u)?, axis_v.place(pixel.v)?);
        let bit = axis_v.mask_cell(v) * axis_u.mask_cells() + axis_u.mask_cell(u);
        let byte = self
            .views
            .bytes
            .get((self.mask_offset + (bit >> 3)) as usize)?;
        if byte >> (bit & 7) & 1 == 0 {
            return None;
        }
        let sample = match &self.table {
            Table::Patches if HAS_PATCHES => self.patch(u, v)?,
            Table::Usual(table) if HAS_QUANTIZED => self.usual(table, u, v)?,
            Table::Quantized(header) if HAS_QUANTIZED => self.quantized(header, u, v)?,
            Table::Spline if HAS_SPLINES => self.spline(u, v)?,
            // No blob with another form is opened.
            _ => return None,
        };
        ray(&self.pose, sample, self.is_central)
    }

    #[inline(always)]
    fn patch(&self, u: Place, v: Place) -> Option<Sample> {
        let [axis_u, axis_v] = &self.axes;
        let ((cell_u, x), (cell_v, y)) = (axis_u.cell_and_share(u), axis_v.cell_and_share(v));
        let shares = Shares::new(x, y);
        let cell = (cell_v * self.axes[0].cells() + cell_u) as usize;
        let maps = if self.is_central { 1 } else { 2 };
        let pairs = self.views.pairs.get(self.start + cell * maps * CUBIC..)?;
        let (direction, rest) = pairs.split_first_chunk()?;
        Some(Sample {
            s: polynomial::patch(direction, S_DIGITS, &shares)?,
            n: if self.is_central {
                [0; 2]
            } else {
                polynomial::patch(rest.first_chunk()?, Digits::new(self.n_digits), &shares)?
            },
        })
    }

    #[inline(always)]
    fn usual(&self, table: &Usual, u: Place, v: Place) -> Option<Sample> {
        let pairs = self.views.pairs.get(self.start..)?;
        let left = self.window(u, v).blend_words(pairs, table.knots_start)?;
        let (x, y) = (u.centered(), v.centered());
        let [a, b] = polynomial::prepared_cubic(&table.direction, x, y)?;
        Some(Sample {
            s: [
                a.wrapping_add(table.unit.times(left[0])),
                b.wrapping_add(table.unit.times(left[1])),
            ],
            n: if self.is_central {
                [0; 2]
            } else {
                polynomial::prepared_cubic(&table.offset, x, y)?
            },
        })
    }

    fn window(&self, u: Place, v: Place) -> knots::Window {
        let [axis_u, axis_v] = &self.axes;
        knots::Window::at(
            self.axes[0].cells(),
            axis_u.knot_place(u),
            axis_v.knot_place(v),
        )
    }

    /// A quantized table of any kind.
    #[inline(never)]
    fn quantized(&self, header: &QuantizedHeader, u: Place, v: Place) -> Option<Sample> {
        let pairs = self.views.pairs.get(self.start..)?;
        let value = |map: QuantizedMap, start: usize, knots: usize, digits: i32| {
            let coefficients = pairs
                .get(start..)?
                .get(..coefficient_count(map.degree.into()))?;
            let sums = polynomial::any(
                coefficients,
                Digits::new(digits),
                u.centered(),
                v.centered(),
            );
            if map.number_len == 0 {
                return Some(sums);
            }
            let left = self.window(u, v).blend(pairs, knots, map.number_len)?;
            let unit = Unit::new(map.unit, digits);
            Some([0, 1].map(|k| sums[k].wrapping_add(unit.times(left[k]))))
        };
        let knots = (header.knots_start >> 3) as usize;
        let direction = header.direction;
        let start = QUANTIZED_HEADER_PAIRS;
        let behind = start + coefficient_count(direction.degree.into());
        let cells_v = self.axes[1].cells();
        let offset_knots = knots
            + knots_len([self.axes[0].cells(), cells_v], direction.number_len).div_ceil(ALIGNMENT);
        Some(Sample {
            s: value(direction, start, knots, 28)?,
            n: if self.is_central {
                [0; 2]
            } else {
                value(header.offset, behind, offset_knots, self.n_digits)?
            },
        })
    }

    #[inline(never)]
    fn spline(&self, u: Place, v: Place) -> Option<Sample> {
        let [axis_u, axis_v] = &self.axes;
        let places = (axis_u.cell_and_fraction(u), axis_v.cell_and_fraction(v));
        let window = spline::Window::at(self.axes[0].cells(), places.0, places.1);
        let knots = self.views.pairs.get(self.start..)?;
        let step = if self.is_central { 1 } else { 2 };
        Some(Sample {
            s: window.blend(knots, step, S_DIGITS)?,
            n: if self.is_central {
                [0; 2]
            } else {
                window.blend(knots.get(1..)?, step, Digits::new(self.n_digits))?
            },
        })
    }
}

/// The coefficients of a usual table; `None` of any other.
fn usual(
    pairs: &[[f32; 2]],
    header: QuantizedHeader,
    is_central: bool,
    length_digits: i32,
) -> Option<Usual> {
    let kind = |map: QuantizedMap| (map.degree, map.number_len);
    let offset_kind = if is_central { (0, 0) } else { (3, 0) };
    if (kind(header.direction), kind(header.offset)) != ((3, 2), offset_kind) {
        return None;
    }
    let (_, coefficients) = pairs.split_first_chunk::<QUANTIZED_HEADER_PAIRS>()?;
    let (direction, rest) = coefficients.split_first_chunk::<CUBIC>()?;
    let fixed = |cubic: &[[f32; 2]; CUBIC], digits: Digits| {
        cubic.map(|pair| pair.map(|number| digits.fixed(number)))
    };
    Some(Usual {
        knots_start: (header.knots_start >> 3) as usize,
        unit: Unit::new(header.direction.unit, 28),
        direction: fixed(direction, S_DIGITS),
        offset: if is_central {
            [[0; 2]; CUBIC]
        } else {
            fixed(rest.first_chunk()?, Digits::new(length_digits))
        },
    })
}
