//! The blob's schema, the only definition of it: what the runtime reads and the packer writes.
//! `FORMAT.md` says the same byte by byte.
//!
//! ```text
//! header | metadata (postcard) | pad to 8 | records | tables | pairs
//! ```

mod pair;

pub use pair::{MAX_NODES, MAX_STEP_PX, NODE_LEN, PAIR_HEADER_LEN, PairHeader, TRIANGLE};

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use serde::{Deserialize, Serialize};

/// The first four bytes of a blob.
pub const MAGIC: [u8; 4] = *b"RAYS";
/// The format version that the packer writes and the newest that this library reads.
pub const VERSION: u16 = 2;
/// The oldest version that this library reads: the same, but without any [`PairHeader`].
pub const OLDEST_VERSION: u16 = 1;
/// Length of the header of both versions.
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

/// First message of the metadata; a [`CameraMeta`] for each camera and the [`SelfTest`]s follow it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Meta<'a> {
    /// First 16 bytes of a hash that identifies the calibration.
    pub identity: &'a [u8],
    /// The frame of rays and points, in words.
    pub frame: &'a str,
    /// Program and version that wrote the blob.
    pub written_by: &'a str,
    /// Where (0, 0) is.
    pub pixel_convention: PixelConvention,
    /// Unit of lengths.
    pub length_unit: LengthUnit,
    /// No pixel in the calibrated area is further than this from the field that was packed, px.
    pub max_error_px: f32,
    /// The distance at which a ray's offset was turned into pixels for that bound, mm.
    pub working_distance_mm: f32,
    /// How many [`SelfTest`]s there are.
    pub self_test_count: u16,
}

/// Where pixel coordinates have their zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum PixelConvention {
    /// The center of the sensor's top-left pixel is (0, 0); u points right, v down.
    TopLeftPixelCenter,
}

/// Unit of lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum LengthUnit {
    /// Millimeters.
    Millimeter,
}

/// What is to be known of a camera besides its [`Record`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct CameraMeta<'a> {
    /// Unique in the blob, not empty.
    pub name: &'a str,
    /// Columns of the sensor, px.
    pub sensor_width: u32,
    /// Rows of the sensor, px.
    pub sensor_height: u32,
    /// First column of the calibrated region, px. Pixel coordinates stay those of the sensor.
    pub region_u: u32,
    /// First row of the calibrated region, px.
    pub region_v: u32,
    /// Columns of the calibrated region, px.
    pub region_width: u32,
    /// Rows of the calibrated region, px.
    pub region_height: u32,
}

/// A question with the bits of its answer, so that a device can check itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum SelfTest {
    /// A pixel and its ray.
    Ray {
        /// Index of the camera.
        camera: u16,
        /// (u, v), px.
        pixel: [f32; 2],
        /// Origin in the rig frame, mm.
        origin_mm: [f32; 3],
        /// Direction in the rig frame.
        direction: [f32; 3],
    },
    /// A match and its point.
    Pair {
        /// Indices of the two cameras.
        cameras: [u16; 2],
        /// (u, v) in each, px.
        pixels: [[f32; 2]; 2],
        /// The point in the rig frame, mm.
        point_mm: [f32; 3],
        /// Square of the gap, mm2.
        gap_squared_mm2: f32,
    },
    /// A match and the standard deviations of its point, of a pair whose uncertainty is known.
    Sigma {
        /// Indices of the two cameras.
        cameras: [u16; 2],
        /// (u, v) in each, px.
        pixels: [[f32; 2]; 2],
        /// Along x, y and z of the rig frame, mm.
        sigma_mm: [f32; 3],
    },
}

/// How a control grid's numbers are stored, and how many numbers a knot has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Half-angle vector, f32: 2 numbers a knot. All rays start in the camera's reference point.
    CentralF32,
    /// Half-angle vector and scaled offset, f32: 4 numbers a knot.
    NonCentralF32,
}

impl Encoding {
    /// The number that stands in the record; `None` if it is not known.
    pub const fn from_number(number: u32) -> Option<Self> {
        match number {
            1 => Some(Self::CentralF32),
            2 => Some(Self::NonCentralF32),
            _ => None,
        }
    }

    /// The number that stands in the record.
    pub const fn number(self) -> u32 {
        match self {
            Self::CentralF32 => 1,
            Self::NonCentralF32 => 2,
        }
    }

    /// Numbers per knot.
    pub const fn channels(self) -> usize {
        match self {
            Self::CentralF32 => 2,
            Self::NonCentralF32 => 4,
        }
    }
}

/// Words of 4 bytes in a camera's record.
pub const RECORD_WORDS: usize = 32;
/// Bytes of a camera's record.
pub const RECORD_LEN: usize = 4 * RECORD_WORDS;

/// What a lookup needs of a camera, read in place: 32 words, integers and f32 bits.
///
/// (A plain array of words, because that is what can be viewed in a byte slice without copying
/// and without unsafe code.)
#[derive(Debug, Clone, Copy)]
pub struct Record<'a>(pub &'a [u32; RECORD_WORDS]);

/// A camera's record as the packer holds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordFields {
    /// [`Encoding::number`].
    pub encoding: u32,
    /// Cells of the control grid along u and v.
    pub cells: [u32; 2],
    /// Cells of the mask along u and v.
    pub mask_cells: [u32; 2],
    /// Where the control grid starts in the blob, bytes.
    pub grid_offset: u32,
    /// Where the mask starts in the blob, bytes.
    pub mask_offset: u32,
    /// Working numbers along u and v.
    pub axes: [Axis; 2],
    /// Rotation of `rig_from_camera`, row-major.
    pub rotation: [f32; 9],
    /// Translation of `rig_from_camera`, mm.
    pub translation_mm: [f32; 3],
}

impl RecordFields {
    /// The record's words.
    pub fn to_words(&self) -> [u32; RECORD_WORDS] {
        let mut words = [0; RECORD_WORDS];
        let integers = [
            self.encoding,
            self.cells[0],
            self.cells[1],
            self.mask_cells[0],
            self.mask_cells[1],
            self.grid_offset,
            self.mask_offset,
            0,
        ];
        let numbers = self.axes.iter().flat_map(|axis| axis.to_numbers());
        let pose = self.rotation.iter().chain(&self.translation_mm).copied();
        let all = integers
            .into_iter()
            .chain(numbers.chain(pose).map(f32::to_bits));
        for (word, value) in words.iter_mut().zip(all) {
            *word = value;
        }
        words
    }
}

impl Record<'_> {
    /// Number of the encoding.
    pub const fn encoding(self) -> u32 {
        self.0[0]
    }

    /// Cells of the control grid along u and v.
    pub const fn cells(self) -> [u32; 2] {
        [self.0[1], self.0[2]]
    }

    /// Cells of the mask along u and v.
    pub const fn mask_cells(self) -> [u32; 2] {
        [self.0[3], self.0[4]]
    }

    /// Where the control grid starts in the blob, bytes.
    pub const fn grid_offset(self) -> u32 {
        self.0[5]
    }

    /// Where the mask starts in the blob, bytes.
    pub const fn mask_offset(self) -> u32 {
        self.0[6]
    }

    /// The word that must be zero.
    pub const fn reserved(self) -> u32 {
        self.0[7]
    }

    /// Working numbers along u.
    pub const fn axis_u(self) -> Axis {
        let w = self.0;
        Axis::from_bits([w[8], w[9], w[10], w[11], w[12], w[13]])
    }

    /// Working numbers along v.
    pub const fn axis_v(self) -> Axis {
        let w = self.0;
        Axis::from_bits([w[14], w[15], w[16], w[17], w[18], w[19]])
    }

    /// Rotation of `rig_from_camera`, row-major.
    pub const fn rotation(self) -> [f32; 9] {
        let w = self.0;
        [
            f32::from_bits(w[20]),
            f32::from_bits(w[21]),
            f32::from_bits(w[22]),
            f32::from_bits(w[23]),
            f32::from_bits(w[24]),
            f32::from_bits(w[25]),
            f32::from_bits(w[26]),
            f32::from_bits(w[27]),
            f32::from_bits(w[28]),
        ]
    }

    /// Translation of `rig_from_camera`, mm.
    pub const fn translation_mm(self) -> [f32; 3] {
        let w = self.0;
        [
            f32::from_bits(w[29]),
            f32::from_bits(w[30]),
            f32::from_bits(w[31]),
        ]
    }
}

/// Numbers that turn a pixel coordinate into a cell and a fraction, along one axis.
///
/// They follow from the region, the cells and the mask's cells ([`Axis::new`]); they stand in the
/// blob so that a lookup need not divide, and `open` checks that they are the ones that follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Outer edge of the region's first pixel, px.
    pub min_px: f32,
    /// Outer edge of the region's last pixel, px.
    pub max_px: f32,
    /// Cells per pixel.
    pub cells_per_px: f32,
    /// Size of a cell, its first 12 binary digits, px: times a cell number it is exact.
    pub cell_high_px: f32,
    /// Size of a cell, what `cell_high_px` leaves, px.
    pub cell_low_px: f32,
    /// Mask cells per pixel, rounded up: a pixel on a border belongs to the cell after it.
    pub mask_cells_per_px: f32,
}

impl Axis {
    /// The numbers of an axis with `extent_px` pixels from number `first_px` on.
    ///
    /// Extents, first pixels up to [`MAX_EXTENT_PX`] and cells from 1 to [`MAX_CELLS`] give finite
    /// numbers; anything else gives some numbers.
    pub fn new(first_px: u32, extent_px: u32, cells: u32, mask_cells: u32) -> Self {
        let (first, extent, cells) = (first_px as f32, extent_px as f32, cells as f32);
        // Sign, exponent and 11 stored binary digits.
        let cell_high_px = f32::from_bits((extent / cells).to_bits() & 0xffff_f000);
        let mask_cells_per_px = mask_cells as f32 / extent;
        Self {
            min_px: first - 0.5,
            max_px: first + extent - 0.5,
            cells_per_px: cells / extent,
            cell_high_px,
            cell_low_px: (extent - cells * cell_high_px) / cells,
            mask_cells_per_px: f32::from_bits(mask_cells_per_px.to_bits().wrapping_add(1)),
        }
    }

    /// The six numbers in the order of the record.
    pub const fn to_numbers(self) -> [f32; 6] {
        [
            self.min_px,
            self.max_px,
            self.cells_per_px,
            self.cell_high_px,
            self.cell_low_px,
            self.mask_cells_per_px,
        ]
    }

    /// From the six words of the record.
    pub const fn from_bits(bits: [u32; 6]) -> Self {
        Self {
            min_px: f32::from_bits(bits[0]),
            max_px: f32::from_bits(bits[1]),
            cells_per_px: f32::from_bits(bits[2]),
            cell_high_px: f32::from_bits(bits[3]),
            cell_low_px: f32::from_bits(bits[4]),
            mask_cells_per_px: f32::from_bits(bits[5]),
        }
    }
}

/// Bytes of a control grid: `(cells_u + 3) * (cells_v + 3)` knots.
pub const fn grid_len(encoding: Encoding, cells: [u32; 2]) -> usize {
    (cells[0] as usize + 3) * (cells[1] as usize + 3) * encoding.channels() * 4
}

/// Bytes of a mask without its padding.
pub const fn mask_len(cells: [u32; 2]) -> usize {
    (cells[0] as usize * cells[1] as usize).div_ceil(8)
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn cell_size_is_kept_to_beyond_single_precision() {
        for (extent, cells) in [(6000, 97), (1280, 30), (32768, 1023), (7, 3), (1, 1)] {
            let axis = Axis::new(0, extent, cells, 48);
            let size = f64::from(axis.cell_high_px) + f64::from(axis.cell_low_px);
            let exact = f64::from(extent) / f64::from(cells);
            // 12 digits in the high part, 24 more in the low part.
            assert!(
                (size - exact).abs() <= exact * 2.0f64.powi(-35),
                "{extent} {cells}"
            );
            let product = axis.cell_high_px * cells as f32;
            assert_eq!(
                f64::from(product),
                f64::from(axis.cell_high_px) * f64::from(cells)
            );
        }
    }

    #[test]
    fn a_pixel_on_a_mask_border_is_in_the_cell_after_it() {
        for (extent, cells) in [
            (1224u32, 48u32),
            (1280, 48),
            (6000, 48),
            (4500, 36),
            (6001, 48),
        ] {
            let axis = Axis::new(0, extent, 4, cells);
            for u in 0..extent {
                let exact = (2 * u + 1) * cells / (2 * extent);
                let x = u as f32 + 0.5;
                assert_eq!(
                    (x * axis.mask_cells_per_px) as u32,
                    exact,
                    "{extent} {cells} {u}"
                );
            }
        }
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

    #[test]
    fn record_survives_a_round_trip() {
        let fields = RecordFields {
            encoding: 2,
            cells: [7, 5],
            mask_cells: [48, 38],
            grid_offset: 1000,
            mask_offset: 2000,
            axes: [Axis::new(0, 640, 7, 48), Axis::new(0, 480, 5, 38)],
            rotation: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
            translation_mm: [10.0, 11.0, 12.0],
        };
        let words = fields.to_words();
        let record = Record(&words);
        assert_eq!(record.encoding(), fields.encoding);
        assert_eq!(record.cells(), fields.cells);
        assert_eq!(record.mask_cells(), fields.mask_cells);
        assert_eq!(record.grid_offset(), fields.grid_offset);
        assert_eq!(record.mask_offset(), fields.mask_offset);
        assert_eq!(record.reserved(), 0);
        assert_eq!([record.axis_u(), record.axis_v()], fields.axes);
        assert_eq!(record.rotation(), fields.rotation);
        assert_eq!(record.translation_mm(), fields.translation_mm);
    }
}
