//! The header of a blob, the limits of what it may hold, and its checksum.

use crc::{CRC_32_ISO_HDLC, Crc, Table};

/// The first four bytes of a blob.
pub const MAGIC: [u8; 4] = *b"RAYS";
/// The format version that the packer writes and the newest that this library reads.
pub const VERSION: u16 = 4;
/// The oldest version that this library reads. Version 3 has no [`Section`](super::Section)s, version 2 besides that no
/// other [`Form`](super::Form) than splines, version 1 no [`PairHeader`](super::PairHeader) either; the feature `old-versions` is
/// for these two.
pub const OLDEST_VERSION: u16 = if cfg!(feature = "old-versions") { 1 } else { 3 };
/// Length of the header of all versions.
pub const HEADER_LEN: usize = 24;
/// Every part after the metadata starts on a multiple of this.
pub const ALIGNMENT: usize = 8;
/// Bytes of an identity.
pub const IDENTITY_LEN: usize = 16;
/// Largest sensor width or height, px: half pixels then are exact in f32 with digits to spare.
pub const MAX_EXTENT_PX: u32 = 32768;
/// Most cells of a grid or a mask along one axis: `cell * cell_high_px` then is exact in f32.
pub const MAX_CELLS: u32 = 1024;
/// Most cameras in a blob.
pub const MAX_CAMERAS: u16 = 64;
/// Largest magnitude of any number in a table, mm or ratio: products of a few stay finite in f32.
pub const MAX_MAGNITUDE: f32 = 1e6;

/// CRC-32/ISO-HDLC, the one of zlib and of Ethernet; one 1 KiB table.
static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Where the checksum stands in the header.
pub const CRC_OFFSET: usize = 12;

/// The checksum of a blob: over all bytes but the four that hold it. `None` if there are fewer
/// bytes than a header has.
pub fn checksum(blob: &[u8]) -> Option<u32> {
    let before = blob.get(..CRC_OFFSET)?;
    let after = blob.get(CRC_OFFSET + 4..)?;
    let mut digest = CRC.digest();
    digest.update(before);
    digest.update(after);
    Some(digest.finalize())
}

/// [`checksum`] from `crc_of_all`, zlib's CRC-32 of all bytes, with a look at the first 16 alone. `None` if there are
/// fewer.
///
/// A CRC of two parts is `crc(first) * x^(8 bytes of second) + crc(second)`, in polynomials over one bit modulo that
/// of the CRC. So leaving four bytes out of the first part changes it by a multiple of that power.
pub fn checksum_from_all(blob: &[u8], crc_of_all: u32) -> Option<u32> {
    let with = CRC.checksum(blob.get(..CRC_OFFSET + 4)?);
    let without = CRC.checksum(blob.get(..CRC_OFFSET)?);
    let behind = blob.len().checked_sub(CRC_OFFSET + 4)?;
    Some(crc_of_all ^ times(with ^ without, x_to_the_8(behind)))
}

/// `x^(8 n)` modulo the CRC's polynomial; the highest bit is the coefficient of `x^0`.
fn x_to_the_8(n: usize) -> u32 {
    let (mut power, mut square, mut left) = (1 << 31, 1 << 23, n);
    while left != 0 {
        if left & 1 == 1 {
            power = times(power, square);
        }
        square = times(square, square);
        left >>= 1;
    }
    power
}

/// The product modulo the CRC's polynomial.
fn times(a: u32, mut b: u32) -> u32 {
    let polynomial = CRC_32_ISO_HDLC.poly.reverse_bits();
    let mut product = 0;
    for bit in (0..u32::BITS).rev() {
        if a >> bit & 1 == 1 {
            product ^= b;
        }
        // Times x.
        b = b >> 1 ^ if b & 1 == 1 { polynomial } else { 0 };
    }
    product
}

/// `length` rounded up to a multiple of [`ALIGNMENT`].
pub const fn aligned(length: usize) -> usize {
    length.saturating_add(ALIGNMENT - 1) & !(ALIGNMENT - 1)
}

/// The header's fields behind magic, version and its own length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Format version.
    pub version: u16,
    /// Length of the header, bytes.
    pub header_len: u16,
    /// Length of the whole blob, bytes.
    pub total_len: u32,
    /// [`checksum`] of the blob.
    pub crc: u32,
    /// Length of the metadata without its padding, bytes.
    pub meta_len: u32,
    /// Number of cameras.
    pub camera_count: u16,
    /// Number of pairs of cameras whose uncertainty is known; 0 in version 1.
    pub pair_count: u16,
}

impl Header {
    /// The header at the start of `bytes`, and the magic in front of it. Nothing is judged.
    /// `None` if there are too few bytes.
    pub fn read(bytes: &[u8]) -> Option<([u8; 4], Self)> {
        let (b, _) = bytes.split_first_chunk::<HEADER_LEN>()?;
        let magic = [b[0], b[1], b[2], b[3]];
        Some((
            magic,
            Self {
                version: u16::from_le_bytes([b[4], b[5]]),
                header_len: u16::from_le_bytes([b[6], b[7]]),
                total_len: u32::from_le_bytes([b[8], b[9], b[10], b[11]]),
                crc: u32::from_le_bytes([b[12], b[13], b[14], b[15]]),
                meta_len: u32::from_le_bytes([b[16], b[17], b[18], b[19]]),
                camera_count: u16::from_le_bytes([b[20], b[21]]),
                pair_count: u16::from_le_bytes([b[22], b[23]]),
            },
        ))
    }

    /// The header's bytes, magic included.
    pub fn to_bytes(self) -> [u8; HEADER_LEN] {
        let mut bytes = [0; HEADER_LEN];
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4..6].copy_from_slice(&self.version.to_le_bytes());
        bytes[6..8].copy_from_slice(&self.header_len.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.total_len.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.crc.to_le_bytes());
        bytes[16..20].copy_from_slice(&self.meta_len.to_le_bytes());
        bytes[20..22].copy_from_slice(&self.camera_count.to_le_bytes());
        bytes[22..24].copy_from_slice(&self.pair_count.to_le_bytes());
        bytes
    }
}

/// Bytes of a mask without its padding.
pub const fn mask_len(cells: [u32; 2]) -> usize {
    (cells[0] as usize * cells[1] as usize).div_ceil(8)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    #[test]
    fn checksum_is_the_one_of_zlib() {
        // zlib.crc32(b"123456789123") leaves out nothing; here the four bytes "????" are skipped.
        assert_eq!(
            checksum(b"123456789abc????def"),
            Some(CRC.checksum(b"123456789abcdef"))
        );
        assert_eq!(CRC.checksum(b"123456789"), 0xcbf4_3926);
        assert_eq!(checksum(b"123456789abc???"), None);
    }

    #[test]
    fn the_checksum_follows_from_that_of_all_bytes() {
        for length in [16, 17, 24, 255, 256, 5704] {
            let bytes: Vec<u8> = (0..length).map(|k: u32| (k * k / 8) as u8).collect();
            let all = CRC.checksum(&bytes);
            assert_eq!(checksum_from_all(&bytes, all), checksum(&bytes));
            assert_ne!(checksum_from_all(&bytes, all ^ 1), checksum(&bytes));
        }
        assert_eq!(checksum_from_all(&[0; 15], 0), None);
    }

    #[test]
    fn header_survives_a_round_trip() {
        let header = Header {
            version: VERSION,
            header_len: HEADER_LEN as u16,
            total_len: 0x01020304,
            crc: 0xdeadbeef,
            meta_len: 99,
            camera_count: 2,
            pair_count: 1,
        };
        assert_eq!(Header::read(&header.to_bytes()), Some((MAGIC, header)));
        assert_eq!(Header::read(&header.to_bytes()[..HEADER_LEN - 1]), None);
    }
}
