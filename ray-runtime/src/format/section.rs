//! Optional parts of a blob, behind its pairs, since version 4.
//!
//! A reader passes over what it does not know, unless the writer has marked it as required. So a later
//! writer can say more without a new version of the format, as long as what it says is not needed to
//! answer rightly; and where it is needed, no reader answers wrongly.

use crate::match_noise::MatchNoise;

/// The first version that has sections.
pub const SECTIONS_SINCE: u16 = 4;
/// Bytes in front of a section's content.
pub const SECTION_HEADER_LEN: usize = 8;
/// Most sections in a blob.
pub const MAX_SECTIONS: u16 = 64;
/// The bit of a section's flags that says that a reader which does not know it must refuse the blob.
const REQUIRED: u16 = 1;

/// What a section is about. In a blob they stand in ascending order, none twice.
pub mod tag {
    /// How noisy the pixels of matches are: a [`MatchNoise`](crate::MatchNoise).
    pub const MATCH_NOISE: u16 = 1;
    /// Reserved: the rig's name, serial numbers, date and notes.
    pub const MANIFEST: u16 = 2;
    /// Reserved: uncertainty by which points of more than two rays have standard deviations.
    pub const SINGLE_RAYS: u16 = 3;
    /// Reserved: more tables, for other temperatures or focus settings.
    pub const CONDITIONS: u16 = 4;
    /// The proven error of the arithmetic of integers, and its answers to the self-tests. Known with the feature `integer`.
    pub const ARITHMETIC: u16 = 5;
    /// From here on anybody may give a section a meaning of their own; the format never will.
    pub const FIRST_PRIVATE: u16 = 0x8000;
}

/// What stands in front of a section's content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SectionHeader {
    /// See [`tag`]; never 0.
    pub tag: u16,
    /// Whether a reader that does not know the tag must refuse the blob.
    pub is_required: bool,
    /// Bytes of the content, without its padding.
    pub length: u32,
}

impl SectionHeader {
    /// The header at the start of `bytes`, and what follows it. `None` if there are too few bytes or a
    /// flag that has no meaning.
    pub fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let (b, rest) = bytes.split_first_chunk::<SECTION_HEADER_LEN>()?;
        let flags = u16::from_le_bytes([b[2], b[3]]);
        let header = Self {
            tag: u16::from_le_bytes([b[0], b[1]]),
            is_required: flags & REQUIRED != 0,
            length: u32::from_le_bytes([b[4], b[5], b[6], b[7]]),
        };
        (flags & !REQUIRED == 0).then_some((header, rest))
    }

    /// The header's bytes.
    pub fn to_bytes(self) -> [u8; SECTION_HEADER_LEN] {
        let mut bytes = [0; SECTION_HEADER_LEN];
        bytes[..2].copy_from_slice(&self.tag.to_le_bytes());
        bytes[2] = self.is_required.into();
        bytes[4..].copy_from_slice(&self.length.to_le_bytes());
        bytes
    }
}

/// A section where it lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Section<'a> {
    /// What stands in front.
    pub header: SectionHeader,
    /// As many bytes as it says.
    pub content: &'a [u8],
}

impl<'a> Section<'a> {
    /// The section at the start of `bytes`, and the bytes behind its content. `None` if it is cut short
    /// or has a flag without a meaning.
    pub fn read(bytes: &'a [u8]) -> Option<(Self, &'a [u8])> {
        let (header, rest) = SectionHeader::read(bytes)?;
        let (content, behind) = rest.split_at_checked(header.length as usize)?;
        Some((Self { header, content }, behind))
    }

    /// The content of [`tag::MATCH_NOISE`]: one f32, px. `None` of any other length or number.
    pub fn match_noise(&self) -> Option<MatchNoise> {
        let bytes = self.content.try_into().ok()?;
        MatchNoise::from_px(f32::from_le_bytes(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_where_the_format_says() {
        let header = SectionHeader {
            tag: 0x8102,
            is_required: true,
            length: 0x0102,
        };
        let bytes = header.to_bytes();
        assert_eq!(bytes, [0x02, 0x81, 1, 0, 0x02, 0x01, 0, 0]);
        assert_eq!(SectionHeader::read(&bytes), Some((header, &[][..])));
        assert_eq!(SectionHeader::read(&bytes[1..]), None);
        assert_eq!(Section::read(&bytes), None);
        for flags in [[2, 0], [1, 1], [0, 0x80]] {
            let mut bytes = bytes;
            bytes[2..4].copy_from_slice(&flags);
            assert_eq!(SectionHeader::read(&bytes), None, "{flags:?}");
        }
    }

    #[test]
    fn the_noise_of_matches_is_one_number() {
        let of = |content: &[u8]| {
            let header = SectionHeader {
                tag: tag::MATCH_NOISE,
                is_required: false,
                length: content.len() as u32,
            };
            Section { header, content }.match_noise()
        };
        assert_eq!(of(&0.25f32.to_le_bytes()), MatchNoise::from_px(0.25));
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[0; 3]), None);
        assert_eq!(of(&[0; 5]), None);
        assert_eq!(of(&f32::NAN.to_le_bytes()), None);
    }
}
