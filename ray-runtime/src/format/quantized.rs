//! The header of a table of [`Form::Quantized`](super::Form::Quantized), and where its parts lie.

use super::encoding::coefficient_count;
use super::header::aligned;

/// Bytes of a [`QuantizedHeader`].
pub const QUANTIZED_HEADER_LEN: usize = 8 * QUANTIZED_HEADER_PAIRS;
/// Largest total degree of a predictor.
pub const MAX_DEGREE: u8 = 9;
/// How many units there are to a step of a knot's number: the product of the sums of the weights along
/// both axes, without its lowest 16 binary digits.
pub const UNITS_PER_STEP: f32 = 36.0 * 1024.0;

/// Places along an axis of the grid to one of its cells: a lookup rounds them down.
pub const PLACES_PER_CELL: u32 = 1 << 14;

/// Words of 4 bytes, in pairs.
pub(crate) const QUANTIZED_HEADER_PAIRS: usize = 4;

/// One of the two maps of a quantized table: the half-angle vector, or the scaled offset.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct QuantizedMap {
    /// Total degree of the polynomial, at most [`MAX_DEGREE`].
    pub degree: u8,
    /// Bytes of a knot's number: 0 where there are no knots, 1 (i8) or 2 (i16).
    pub number_len: u8,
    /// What a blend of knots counts, one of [`UNITS_PER_STEP`] to a step.
    pub unit: f32,
}

/// What stands in front of the coefficients and knots of a quantized table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuantizedHeader {
    /// The half-angle vector.
    pub direction: QuantizedMap,
    /// The scaled offset, mm; all zero for a central camera.
    pub offset: QuantizedMap,
    /// `2 / extent` of the region along u and v: the polynomials' variables run from -1 to 1.
    pub scale: [f32; 2],
    /// [`places_per_px`] along u and v.
    pub places_per_px: [f32; 2],
    /// Where the knots of the half-angle vector start, or would: [`QuantizedLayout::direction_knots`].
    pub knots_start: u32,
}

/// Where the parts of a quantized table lie, bytes from its start: the coefficients of both maps, then
/// the knots of both, each map's with zeros up to a multiple of 8.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QuantizedLayout {
    /// Where the knots of the half-angle vector start, or would.
    pub direction_knots: usize,
    /// Where they end.
    pub direction_knots_end: usize,
    /// Where the knots of the offset start, or would.
    pub offset_knots: usize,
    /// Where they end.
    pub offset_knots_end: usize,
}

/// Bytes of a map's knots without what follows up to a multiple of 8.
pub(crate) const fn knots_len(cells: [u32; 2], number_len: u8) -> usize {
    (cells[0] as usize + 3) * (cells[1] as usize + 3) * 2 * number_len as usize
}

impl QuantizedHeader {
    /// The header of these maps over a grid of `cells`. A central camera has no second map.
    pub const fn new(
        direction: QuantizedMap,
        offset: Option<QuantizedMap>,
        extent_px: [u32; 2],
        cells: [u32; 2],
    ) -> Self {
        let direction_end = QUANTIZED_HEADER_LEN + coefficients_len(direction);
        let (offset, knots_start) = if let Some(offset) = offset {
            (offset, direction_end + coefficients_len(offset))
        } else {
            let none = QuantizedMap {
                degree: 0,
                number_len: 0,
                unit: 0.0,
            };
            (none, direction_end)
        };
        Self {
            direction,
            offset,
            scale: [2.0 / extent_px[0] as f32, 2.0 / extent_px[1] as f32],
            places_per_px: [
                places_per_px(cells[0], extent_px[0]),
                places_per_px(cells[1], extent_px[1]),
            ],
            knots_start: knots_start as u32,
        }
    }

    /// Where the parts of the table are, over a grid of `cells`.
    pub const fn layout(&self, cells: [u32; 2]) -> QuantizedLayout {
        let direction_knots = self.knots_start as usize;
        let direction_knots_end =
            direction_knots.saturating_add(knots_len(cells, self.direction.number_len));
        let offset_knots = aligned(direction_knots_end);
        QuantizedLayout {
            direction_knots,
            direction_knots_end,
            offset_knots,
            offset_knots_end: offset_knots.saturating_add(knots_len(cells, self.offset.number_len)),
        }
    }

    /// The header at the start of a table. Nothing is judged. `None` if there are too few bytes.
    pub fn read(pairs: &[[f32; 2]]) -> Option<Self> {
        let [
            [kinds, knots_start],
            [unit, offset_unit],
            scale,
            places_per_px,
        ] = *pairs.first_chunk::<QUANTIZED_HEADER_PAIRS>()?;
        let [degree, number_len, offset_degree, offset_number_len] = kinds.to_bits().to_le_bytes();
        Some(Self {
            direction: QuantizedMap {
                degree,
                number_len,
                unit,
            },
            offset: QuantizedMap {
                degree: offset_degree,
                number_len: offset_number_len,
                unit: offset_unit,
            },
            scale,
            places_per_px,
            knots_start: knots_start.to_bits(),
        })
    }

    /// The header's bytes.
    pub fn to_bytes(self) -> [u8; QUANTIZED_HEADER_LEN] {
        let (direction, offset) = (self.direction, self.offset);
        let kinds = [
            direction.degree,
            direction.number_len,
            offset.degree,
            offset.number_len,
        ];
        let [[scale_u, scale_v], [places_u, places_v]] = [self.scale, self.places_per_px];
        let numbers = [
            direction.unit,
            offset.unit,
            scale_u,
            scale_v,
            places_u,
            places_v,
        ];
        let mut bytes = [0; QUANTIZED_HEADER_LEN];
        let words = [u32::from_le_bytes(kinds), self.knots_start];
        let all = words.into_iter().chain(numbers.map(f32::to_bits));
        for (place, byte) in bytes.iter_mut().zip(all.flat_map(u32::to_le_bytes)) {
            *place = byte;
        }
        bytes
    }
}

const fn coefficients_len(map: QuantizedMap) -> usize {
    coefficient_count(map.degree as usize) * 8
}

/// Places on the grid to a pixel: [`PLACES_PER_CELL`], and two less to all of the axis, so that its far
/// end belongs to the last cell whatever is rounded.
pub const fn places_per_px(cells: u32, extent_px: u32) -> f32 {
    (cells * PLACES_PER_CELL - 2) as f32 / extent_px as f32
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::format::{MAX_CELLS, MAX_EXTENT_PX};
    use std::vec::Vec;

    #[test]
    fn bytes_are_where_the_format_says() {
        let map = |degree, number_len, unit| QuantizedMap {
            degree,
            number_len,
            unit,
        };
        let (direction, offset) = (map(5, 2, 0.001), map(3, 1, 0.5));
        let header = QuantizedHeader::new(direction, Some(offset), [64, 48], [3, 2]);
        let layout = header.layout([3, 2]);
        // 21 coefficients of two f32, and 10; 6 x 5 knots of two i16, and of two i8.
        assert_eq!(layout.direction_knots, 32 + 168 + 80);
        assert_eq!(layout.direction_knots_end, 280 + 120);
        assert_eq!(layout.offset_knots, 400);
        assert_eq!(layout.offset_knots_end, 400 + 60);
        let bytes = header.to_bytes();
        assert_eq!(bytes[..8], [5, 2, 3, 1, 24, 1, 0, 0]);
        assert_eq!(bytes[8..12], 0.001f32.to_le_bytes());
        assert_eq!(bytes[12..16], 0.5f32.to_le_bytes());
        assert_eq!(bytes[16..20], (1.0f32 / 32.0).to_le_bytes());
        assert_eq!(bytes[28..], (32766.0f32 / 48.0).to_le_bytes());

        let pairs: Vec<[f32; 2]> = bytes
            .chunks(8)
            .map(|pair| [0, 4].map(|k| f32::from_le_bytes(pair[k..k + 4].try_into().unwrap())))
            .collect();
        assert_eq!(QuantizedHeader::read(&pairs), Some(header));
        assert_eq!(QuantizedHeader::read(&pairs[1..]), None);

        let central = QuantizedHeader::new(map(7, 0, 0.0), None, [64, 48], [1, 1]);
        assert_eq!(central.layout([1, 1]).offset_knots_end, 32 + 288);
        assert_eq!(central.offset, QuantizedMap::default());
    }

    #[test]
    fn no_pixel_is_behind_the_last_cell() {
        for cells in 1..=MAX_CELLS {
            for extent in (1..=MAX_EXTENT_PX).step_by(if cells % 64 == 0 { 1 } else { 997 }) {
                let header =
                    QuantizedHeader::new(QuantizedMap::default(), None, [extent; 2], [cells; 2]);
                let place = extent as f32 * header.places_per_px[0];
                assert!((place as u32) < cells * PLACES_PER_CELL, "{cells} {extent}");
            }
        }
    }
}
