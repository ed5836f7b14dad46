//! What a blob says of the arithmetic of integers: the content of [`tag::ARITHMETIC`](super::tag::ARITHMETIC).

/// The number of the arithmetic of integers; no other is given.
pub const INTEGER: u16 = 1;
/// Bytes in front of the answers.
pub const ARITHMETIC_HEADER_LEN: usize = 8;

/// The error that was proven for another arithmetic than f32, and its answers to the blob's self-tests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arithmetic<'a> {
    /// No pixel in the calibrated area is further than this from the field that was packed, px.
    pub max_error_px: f32,
    /// Numbers of f32, of each self-test in turn: origin and direction of a ray, or point and square of the gap
    /// of a match. Those of standard deviations have none.
    pub answers: &'a [[u8; 4]],
}

impl<'a> Arithmetic<'a> {
    /// From a section's content. `None` of another length or arithmetic, or of an error that is none.
    pub fn read(content: &'a [u8]) -> Option<Self> {
        let (header, answers) = content.split_first_chunk::<ARITHMETIC_HEADER_LEN>()?;
        let [a, b, c, d, error @ ..] = *header;
        let number = u16::from_le_bytes([a, b]);
        let count = u16::from_le_bytes([c, d]);
        let max_error_px = f32::from_le_bytes(error);
        let (answers, rest) = answers.as_chunks::<4>();
        let is_whole = rest.is_empty() && answers.len() == usize::from(count);
        // Bits, as those of numbers above zero are in their order.
        let is_error = (1..f32::INFINITY.to_bits()).contains(&max_error_px.to_bits());
        (number == INTEGER && is_whole && is_error).then_some(Self {
            max_error_px,
            answers,
        })
    }

    /// The content's bytes in front of so many answers.
    pub fn header(max_error_px: f32, count: u16) -> [u8; ARITHMETIC_HEADER_LEN] {
        let [a, b] = INTEGER.to_le_bytes();
        let [c, d] = count.to_le_bytes();
        let [e, f, g, h] = max_error_px.to_le_bytes();
        [a, b, c, d, e, f, g, h]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_where_the_format_says() {
        let header = Arithmetic::header(0.25, 1);
        assert_eq!(header, [1, 0, 1, 0, 0, 0, 0x80, 0x3e]);
        let mut content = [0; 12];
        content[..8].copy_from_slice(&header);
        content[8..].copy_from_slice(&1.5f32.to_le_bytes());
        let read = Arithmetic::read(&content).unwrap();
        assert_eq!(read.max_error_px, 0.25);
        assert_eq!(read.answers, [1.5f32.to_le_bytes()]);
        assert_eq!(Arithmetic::read(&content[..8]), None);
        assert_eq!(Arithmetic::read(&content[..11]), None);
        for (at, byte) in [(0, 2), (2, 2), (7, 0xbe), (7, 0x7f)] {
            let mut content = content;
            content[at] = byte;
            if at == 7 {
                content[6] = 0x80;
            }
            assert_eq!(Arithmetic::read(&content), None, "{at}");
        }
    }
}
