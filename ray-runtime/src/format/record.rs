//! What a lookup needs of a camera, at fixed places.

use super::axis::Axis;
use super::header::MAX_MAGNITUDE;

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
    /// [`Encoding::number`](super::Encoding::number).
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

    /// Whether all rays start in the camera's reference point: encodings with odd numbers.
    pub const fn is_central(self) -> bool {
        self.encoding() & 1 == 1
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

/// Whether a number is finite and not larger than any length or ratio of a rig.
pub(crate) fn is_moderate(x: f32) -> bool {
    // NaN is in no range.
    (-MAX_MAGNITUDE..=MAX_MAGNITUDE).contains(&x)
}

#[cfg(test)]
mod tests {
    use super::*;

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
