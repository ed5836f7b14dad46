//! Commit records: what makes the blob of a slot count.
//!
//! All numbers are u32, little endian:
//! ```text
//!  0 magic "RayD"   12 checksum          24 least version      36 line
//!  4 sequence       16 manifest length   28 least key          40 CRC-32 of the 40 bytes before
//!  8 length         20 newest version    32 start of the blob  44 its complement
//! ```
//! The seal behind it, in a line of its own: magic "Seal", that CRC-32. What is left of either line is
//! as erased. The start of the blob and the line tell a record for another part.
//!
//! Records of the first layout are read, too: in entries of 32 bytes, for lines of 8 bytes,
//! ```text
//! magic "RayC" | sequence | length | checksum | CRC-32 of the 16 bytes before | its complement | seal
//! ```

use super::layout::{RECORD_LENGTH, Shape};
use crate::frame::checksum;
pub use crate::protocol::Claims;

/// What makes the blob of a slot count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Record {
    /// The highest one wins; from 1.
    pub sequence: u32,
    /// Length of the blob, bytes; 0: what counts is the [factory](super::factory::Factory)'s blob.
    pub length: u32,
    /// CRC-32 of all its bytes (zlib's).
    pub checksum: u32,
    /// Length of the manifest behind it, bytes; 0: none.
    pub manifest_length: u32,
    /// Of the device when the record was written.
    pub claims: Claims,
}

/// Length of an encoded record, bytes.
pub const LENGTH: usize = RECORD_LENGTH as usize;
/// Length of a seal, bytes.
pub const SEAL_LENGTH: usize = 8;
/// Length of a record of the first layout without its seal, bytes.
pub const OLD_LENGTH: usize = 24;

/// What an entry begins with where a record alone fits a line.
pub const MARK: [u8; 8] = *b"RaysMark";

const MAGIC: u32 = u32::from_le_bytes(*b"RayD");
const OLD_MAGIC: u32 = u32::from_le_bytes(*b"RayC");
const SEAL_MAGIC: u32 = u32::from_le_bytes(*b"Seal");

/// A record that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found {
    /// The record.
    pub record: Record,
    /// The seal that belongs to it.
    pub seal: [u8; SEAL_LENGTH],
    /// Whether it was written for a flash of this shape.
    pub is_of_this_part: bool,
}

impl Record {
    /// The record's bytes and its seal's, in a slot of this shape.
    pub fn to_bytes(&self, shape: Shape) -> ([u8; LENGTH], [u8; SEAL_LENGTH]) {
        let words = [
            MAGIC,
            self.sequence,
            self.length,
            self.checksum,
            self.manifest_length,
            self.claims.newest_version,
            self.claims.least_version,
            self.claims.least_key,
            shape.blob_start(),
            shape.blob.line(),
        ];
        let mut bytes = [0; LENGTH];
        let sum = put_checked(&mut bytes, &words);
        (bytes, seal(sum))
    }

    /// The record in these bytes, if they hold one.
    pub fn read(bytes: &[u8; LENGTH], shape: Shape) -> Option<Found> {
        let sum = sum_of(bytes)?;
        if word(bytes, 0)? != MAGIC {
            return None;
        }
        let record = Self {
            sequence: word(bytes, 1)?,
            length: word(bytes, 2)?,
            checksum: word(bytes, 3)?,
            manifest_length: word(bytes, 4)?,
            claims: Claims {
                newest_version: word(bytes, 5)?,
                least_version: word(bytes, 6)?,
                least_key: word(bytes, 7)?,
            },
        };
        Some(Found {
            record,
            seal: seal(sum),
            is_of_this_part: word(bytes, 8)? == shape.blob_start()
                && word(bytes, 9)? == shape.blob.line(),
        })
    }

    /// The record of the first layout in these bytes, if they hold one.
    pub fn read_old(bytes: &[u8; OLD_LENGTH]) -> Option<Found> {
        let sum = sum_of(bytes)?;
        if word(bytes, 0)? != OLD_MAGIC {
            return None;
        }
        let record = Self {
            sequence: word(bytes, 1)?,
            length: word(bytes, 2)?,
            checksum: word(bytes, 3)?,
            ..Self::default()
        };
        Some(Found {
            record,
            seal: seal(sum),
            is_of_this_part: true,
        })
    }
}

fn seal(sum: u32) -> [u8; SEAL_LENGTH] {
    let mut seal = [0; SEAL_LENGTH];
    put(&mut seal, &[SEAL_MAGIC, sum]);
    seal
}

/// Puts the words down, and behind them their checksum and its complement; the checksum.
fn put_checked(bytes: &mut [u8], words: &[u32]) -> u32 {
    put(bytes, words);
    let (head, tail) = bytes
        .split_at_mut_checked(4 * words.len())
        .unwrap_or_default();
    let sum = checksum(head);
    put(tail, &[sum, !sum]);
    sum
}

fn put(bytes: &mut [u8], words: &[u32]) {
    let places = bytes.iter_mut();
    let words = words.iter().flat_map(|word| word.to_le_bytes());
    for (place, byte) in places.zip(words) {
        *place = byte;
    }
}

/// The checksum at the end of these bytes, if it and its complement are right.
fn sum_of(bytes: &[u8]) -> Option<u32> {
    let (head, tail) = bytes.split_last_chunk::<8>()?;
    let sum = checksum(head);
    (word(tail, 0)? == sum && word(tail, 1)? == !sum).then_some(sum)
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(4 * at..)?.first_chunk()?))
}
