//! The header of a table of [`Form::Quantized`](super::Form::Quantized), and where its parts lie.

use super::{aligned, coefficient_count};

/// Bytes of a [`QuantizedHeader`].
pub const QUANTIZED_HEADER_LEN: usize = 8 * PAIRS;
/// Largest total degree of a predictor.
pub const MAX_DEGREE: u8 = 9;

/// Words of 4 bytes, in pairs.
const PAIRS: usize = 5;

/// One of the two maps of a quantized table: the half-angle vector, or the scaled offset.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct QuantizedMap {
    /// Total degree of the polynomial, at most [`MAX_DEGREE`].
    pub degree: u8,
    /// Bytes of a knot's number: 0 where there are no knots, 1 (i8) or 2 (i16).
    pub number_len: u8,
    /// What a knot's number counts.
    pub step: f32,
    /// Where the coefficients start, bytes from the start of the table.
    pub coefficients_start: u32,
    /// Where the knots start, or would, bytes from the start of the table.
    pub knots_start: u32,
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
}

impl QuantizedMap {
    /// A map of which nothing is placed yet.
    pub const fn new(degree: u8, number_len: u8, step: f32) -> Self {
        Self {
            degree,
            number_len,
            step,
            coefficients_start: 0,
            knots_start: 0,
        }
    }

    /// The map in two pairs of words; `None` if the first word has bits that mean nothing.
    pub fn read([[kind, step], [coefficients, knots]]: [[f32; 2]; 2]) -> Option<Self> {
        let [degree, number_len, 0, 0] = kind.to_bits().to_le_bytes() else {
            return None;
        };
        Some(Self {
            degree,
            number_len,
            step,
            coefficients_start: coefficients.to_bits(),
            knots_start: knots.to_bits(),
        })
    }

    fn to_words(self) -> [u32; 4] {
        [
            u32::from_le_bytes([self.degree, self.number_len, 0, 0]),
            self.step.to_bits(),
            self.coefficients_start,
            self.knots_start,
        ]
    }

    /// The map with its parts behind `start`; where they end.
    const fn placed(self, start: usize, cells: [u32; 2]) -> (Self, usize) {
        let knots = (cells[0] as usize + 3) * (cells[1] as usize + 3);
        let knots_start = start + coefficient_count(self.degree as usize) * 8;
        let placed = Self {
            coefficients_start: start as u32,
            knots_start: knots_start as u32,
            ..self
        };
        (placed, knots_start + knots * 2 * self.number_len as usize)
    }
}

impl QuantizedHeader {
    /// The header of these maps, wherever they were placed, over a grid of `cells`, and the length of
    /// its table without the padding behind it. A central camera has no second map.
    pub const fn new(
        direction: QuantizedMap,
        offset: Option<QuantizedMap>,
        extent_px: [u32; 2],
        cells: [u32; 2],
    ) -> (Self, usize) {
        let (direction, direction_end) = direction.placed(QUANTIZED_HEADER_LEN, cells);
        let (offset, end) = match offset {
            Some(offset) => offset.placed(aligned(direction_end), cells),
            None => (QuantizedMap::new(0, 0, 0.0), direction_end),
        };
        let header = Self {
            direction,
            offset,
            scale: [2.0 / extent_px[0] as f32, 2.0 / extent_px[1] as f32],
        };
        (header, end)
    }

    /// The header at the start of a table. Nothing is judged but bits that mean nothing. `None` if there
    /// are too few bytes.
    pub fn read(pairs: &[[f32; 2]]) -> Option<Self> {
        let [a, b, c, d, scale] = pairs.first_chunk::<PAIRS>()?;
        Some(Self {
            direction: QuantizedMap::read([*a, *b])?,
            offset: QuantizedMap::read([*c, *d])?,
            scale: *scale,
        })
    }

    /// The header's bytes.
    pub fn to_bytes(self) -> [u8; QUANTIZED_HEADER_LEN] {
        let mut bytes = [0; QUANTIZED_HEADER_LEN];
        let words = [self.direction.to_words(), self.offset.to_words()];
        let scale = self.scale.map(f32::to_bits);
        let all = words.as_flattened().iter().chain(&scale);
        for (place, byte) in bytes.iter_mut().zip(all.flat_map(|w| w.to_le_bytes())) {
            *place = byte;
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    #[test]
    fn bytes_are_where_the_format_says() {
        let direction = QuantizedMap::new(5, 2, 0.001);
        let offset = QuantizedMap::new(3, 1, 0.5);
        let (header, len) = QuantizedHeader::new(direction, Some(offset), [64, 48], [3, 2]);
        // 21 coefficients of two f32 and 6 x 5 knots of two i16; 10, and knots of two i8.
        assert_eq!(header.direction.coefficients_start, 40);
        assert_eq!(header.direction.knots_start, 40 + 168);
        assert_eq!(header.offset.coefficients_start, 208 + 120);
        assert_eq!(header.offset.knots_start, 328 + 80);
        assert_eq!(len, 408 + 60);
        let bytes = header.to_bytes();
        assert_eq!(bytes[..4], [5, 2, 0, 0]);
        assert_eq!(bytes[4..8], 0.001f32.to_le_bytes());
        assert_eq!(bytes[12..16], 208u32.to_le_bytes());
        assert_eq!(bytes[16..20], [3, 1, 0, 0]);
        assert_eq!(bytes[32..36], (1.0f32 / 32.0).to_le_bytes());

        let mut pairs: Vec<[f32; 2]> = bytes
            .chunks(8)
            .map(|pair| [0, 4].map(|k| f32::from_le_bytes(pair[k..k + 4].try_into().unwrap())))
            .collect();
        assert_eq!(QuantizedHeader::read(&pairs), Some(header));
        assert_eq!(QuantizedHeader::read(&pairs[1..]), None);
        pairs[2][0] = f32::from_bits(0x0001_0103);
        assert_eq!(QuantizedHeader::read(&pairs), None);

        let (central, len) =
            QuantizedHeader::new(QuantizedMap::new(7, 0, 0.0), None, [64, 48], [1, 1]);
        assert_eq!((len, central.offset), (40 + 288, QuantizedMap::default()));
    }
}
