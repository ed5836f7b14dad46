//! The header of a table of [`Form::Quantized`](super::Form::Quantized), and where its parts lie.

use super::{aligned, coefficient_count};

/// Bytes of a [`QuantizedHeader`].
pub const QUANTIZED_HEADER_LEN: usize = 4 * WORDS;
/// Largest total degree of a predictor.
pub const MAX_DEGREE: u8 = 9;

const WORDS: usize = 8;

/// One of the two maps of a quantized table: the half-angle vector, or the scaled offset.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct QuantizedMap {
    /// Total degree of the polynomial, at most [`MAX_DEGREE`].
    pub degree: u8,
    /// Bytes of a knot's number: 0 where there are no knots, 1 (i8) or 2 (i16).
    pub number_len: u8,
    /// What a knot's number counts.
    pub step: f32,
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
    /// Where the polynomial of the offset and the knots of both maps start, bytes from the start of
    /// the table; the polynomial of the direction stands behind the header.
    pub starts: [u32; 3],
}

impl QuantizedHeader {
    /// The header of these maps over a grid of `cells`, and the length of its table without the
    /// padding behind it.
    pub const fn new(
        [direction, offset]: [QuantizedMap; 2],
        is_central: bool,
        extent_px: [u32; 2],
        cells: [u32; 2],
    ) -> (Self, usize) {
        let direction_len = coefficient_count(direction.degree as usize) * 8;
        let offset_len = if is_central {
            0
        } else {
            coefficient_count(offset.degree as usize) * 8
        };
        let knots = (cells[0] as usize + 3) * (cells[1] as usize + 3);
        let offset_start = QUANTIZED_HEADER_LEN + direction_len;
        let direction_knots = offset_start + offset_len;
        let offset_knots = aligned(direction_knots + knots * 2 * direction.number_len as usize);
        let header = Self {
            direction,
            offset,
            scale: [2.0 / extent_px[0] as f32, 2.0 / extent_px[1] as f32],
            starts: [
                offset_start as u32,
                direction_knots as u32,
                offset_knots as u32,
            ],
        };
        (
            header,
            offset_knots + knots * 2 * offset.number_len as usize,
        )
    }

    /// The header at the start of a table. Nothing is judged. `None` if there are too few bytes.
    pub fn read(pairs: &[[f32; 2]]) -> Option<Self> {
        let [a, b, c, d] = pairs.first_chunk::<{ WORDS / 2 }>()?;
        let [direction_degree, direction_len, offset_degree, offset_len] = a[0].to_le_bytes();
        Some(Self {
            direction: QuantizedMap {
                degree: direction_degree,
                number_len: direction_len,
                step: a[1],
            },
            offset: QuantizedMap {
                degree: offset_degree,
                number_len: offset_len,
                step: b[0],
            },
            scale: [b[1], c[0]],
            starts: [c[1].to_bits(), d[0].to_bits(), d[1].to_bits()],
        })
    }

    /// The header's bytes.
    pub fn to_bytes(self) -> [u8; QUANTIZED_HEADER_LEN] {
        let maps = [self.direction, self.offset];
        let [direction, offset] = maps.map(|map| [map.degree, map.number_len]);
        let kinds = [direction[0], direction[1], offset[0], offset[1]];
        let numbers = [maps[0].step, maps[1].step, self.scale[0], self.scale[1]];
        let mut bytes = [0; QUANTIZED_HEADER_LEN];
        let all = kinds
            .into_iter()
            .chain(numbers.into_iter().flat_map(f32::to_le_bytes))
            .chain(self.starts.into_iter().flat_map(u32::to_le_bytes));
        for (place, byte) in bytes.iter_mut().zip(all) {
            *place = byte;
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_where_the_format_says() {
        let map = |degree, number_len, step| QuantizedMap {
            degree,
            number_len,
            step,
        };
        let maps = [map(5, 2, 0.001), map(3, 1, 0.5)];
        let (header, len) = QuantizedHeader::new(maps, false, [64, 48], [3, 2]);
        // 21 coefficients and 10 of two f32; 6 x 5 knots of two i16 and of two i8.
        assert_eq!(header.starts, [32 + 168, 32 + 248, 32 + 248 + 120]);
        assert_eq!(len, 400 + 60);
        let bytes = header.to_bytes();
        assert_eq!(bytes[..4], [5, 2, 3, 1]);
        assert_eq!(bytes[4..8], 0.001f32.to_le_bytes());
        assert_eq!(bytes[12..16], (1.0f32 / 32.0).to_le_bytes());
        assert_eq!(bytes[24..28], 280u32.to_le_bytes());

        let pairs: [[f32; 2]; 4] = bytemuck::cast(bytes);
        assert_eq!(QuantizedHeader::read(&pairs), Some(header));
        assert_eq!(QuantizedHeader::read(&pairs[1..]), None);

        let (central, len) = QuantizedHeader::new(
            [map(7, 0, 0.0), QuantizedMap::default()],
            true,
            [64, 48],
            [1, 1],
        );
        assert_eq!((len, central.starts), (32 + 288, [320; 3]));
    }
}
