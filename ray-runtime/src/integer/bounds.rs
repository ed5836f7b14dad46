//! Whether the numbers of a blob's tables fit the digits of fixed point, and which unit of length fits.

use super::float::Digits;
use crate::format::{
    ALIGNMENT, Encoding, Form, PATCH_LEN, QUANTIZED_HEADER_PAIRS, QuantizedHeader, QuantizedMap,
    Record, coefficient_count,
};
use crate::lookup::Views;
use core::num::NonZero;

/// Digits behind the point in which magnitudes are added: lengths of up to 1e6 mm fit.
const LENGTH: i32 = 8;
/// The same of half-angle vectors.
const ANGLE: i32 = 24;
/// What the half-angle vector of any place of a table must be below, so that no step on the way to it overflows.
const MOST_ANGLE: u32 = 8 << 24;

/// What a camera's numbers come to at most.
pub struct Bounds {
    /// Half-angle vector, in 2^-24.
    angle: u32,
    /// Length of an origin along an axis, in 2^-8 mm.
    length: u32,
}

impl Bounds {
    /// Of a camera. `None` of a table that is not whole.
    pub fn of(views: Views<'_>, record: Record<'_>) -> Option<Self> {
        let encoding = Encoding::from_number(record.encoding())?;
        let pairs = views.pairs.get((record.grid_offset() >> 3) as usize..)?;
        let [cells_u, cells_v] = record.cells().map(|cells| cells as usize);
        let maps = encoding.channels() / 2;
        let mut sums = [0; 2];
        let mut add = |map: usize, sum: u32| {
            if let Some(most) = sums.get_mut(map) {
                *most = sum.max(*most);
            }
        };
        let digits = [ANGLE, LENGTH];
        match encoding.form {
            // The sums of a knot's differences to its neighbors, with weights that add up to one.
            Form::Spline => {
                let knots = pairs.get(..(cells_u + 3) * (cells_v + 3) * maps)?;
                for (at, knot) in knots.iter().enumerate() {
                    let map = at % maps;
                    add(map, times(sum(&[*knot], *digits.get(map)?), 2));
                }
            }
            // Shares are up to 1.25, and so their products of three below 2; nothing is multiplied with the last.
            Form::Patches => {
                let len = PATCH_LEN / ALIGNMENT;
                let patches = pairs.get(..cells_u * cells_v * maps * len)?;
                for (at, patch) in patches.chunks_exact(len).enumerate() {
                    let (cell, map) = (at / maps, at % maps);
                    // Where nothing is calibrated a patch may be anything.
                    if !is_used(views, record, cell as u32) {
                        continue;
                    }
                    let (last, bent) = patch.split_last()?;
                    let digits = *digits.get(map)?;
                    add(
                        map,
                        times(sum(bent, digits), 2).saturating_add(sum(&[*last], digits)),
                    );
                }
            }
            Form::Quantized => {
                let header = QuantizedHeader::read(pairs)?;
                let mut start = QUANTIZED_HEADER_PAIRS;
                for (map, of) in [header.direction, header.offset].into_iter().enumerate() {
                    if map < maps {
                        let digits = *digits.get(map)?;
                        let count = coefficient_count(of.degree.into());
                        let coefficients = pairs.get(start..)?.get(..count)?;
                        add(
                            map,
                            sum(coefficients, digits).saturating_add(knots(of, digits)),
                        );
                        start += count;
                    }
                }
            }
        }
        let [angle, offset] = sums;
        let at = record
            .translation_mm()
            .map(|number| Digits::new(LENGTH).magnitude(number));
        // An offset across is as long as its two parts times 1 + 4, as directions go to 127 degrees.
        let [x, y, z] = at;
        Some(Self {
            angle,
            length: times(offset, 8).saturating_add(x.max(y).max(z)),
        })
    }

    /// Whether every half-angle vector fits.
    pub fn has_angles(&self) -> bool {
        self.angle < MOST_ANGLE
    }
}

/// Whether a cell of the table has a part of a mask's cell in it that is calibrated.
fn is_used(views: Views<'_>, record: Record<'_>, cell: u32) -> bool {
    let ([cells_u, cells_v], [mask_u, mask_v]) = (record.cells(), record.mask_cells());
    let (Some(along_u), Some(along_v)) = (NonZero::new(cells_u), NonZero::new(cells_v)) else {
        return false;
    };
    let range = |cell: u32, cells: NonZero<u32>, mask: u32| {
        let end = (cell + 1) * mask + (cells.get() - 1);
        (cell * mask) / cells..end / cells
    };
    let mut rows = range(cell / along_u, along_v, mask_v);
    rows.any(|row| {
        range(cell % along_u, along_u, mask_u).any(|column| {
            let bit = row * mask_u + column;
            let byte = views
                .bytes
                .get((record.mask_offset() + (bit >> 3)) as usize);
            byte.is_some_and(|byte| byte >> (bit & 7) & 1 == 1)
        })
    })
}

/// Binary digits behind the point of millimeters such that lengths have 28 before it; `None` if there are none
/// left of a millimeter's eighth. The working distance gets 24.
pub fn length_digits(
    cameras: impl Iterator<Item = Bounds>,
    working_distance_mm: f32,
) -> Option<i32> {
    let distance = Digits::new(LENGTH).magnitude(working_distance_mm) >> 4;
    let most = cameras.fold(distance, |most, camera| camera.length.max(most));
    let digits = 36 - (32 - most.leading_zeros()).cast_signed();
    (most < u32::MAX >> 1).then_some(digits)
}

/// The magnitudes of the larger channel, added.
fn sum(pairs: &[[f32; 2]], digits: i32) -> u32 {
    let digits = Digits::new(digits);
    let add = |k: usize| {
        let numbers = pairs.iter().map(|[a, b]| if k == 0 { *a } else { *b });
        numbers.fold(0_u32, |sum, number| {
            sum.saturating_add(digits.magnitude(number))
        })
    };
    add(0).max(add(1))
}

/// What quantized knots add at most, in so many binary digits.
fn knots(map: QuantizedMap, digits: i32) -> u32 {
    // Less than 2^16 units to a step, and half as many steps as there are numbers of so many bytes.
    match map.number_len {
        0 => 0,
        1 => Digits::new(digits + 16 + 7).magnitude(map.unit),
        _ => Digits::new(digits + 16 + 15).magnitude(map.unit),
    }
}

fn times(magnitude: u32, by: u32) -> u32 {
    magnitude.saturating_mul(by)
}
