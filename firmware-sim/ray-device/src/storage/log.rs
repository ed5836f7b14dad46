//! A slot's log: commit records in its first erase block, one behind the other.
//!
//! ```text
//! entry:  magic u32 | sequence u32 || length u32 | checksum of the blob u32 || checksum of the 16
//!         bytes before u32 | its complement u32 || seal: magic u32 | that checksum again u32
//! ```
//! Four program units of 8 bytes, little endian, programmed one by one. The log stands for its *last
//! valid record*, sealed or not.
//!
//! # Why a decision lasts
//! The unit that a cut of power hit may read differently each time; all units before it are sound. A
//! seal is programmed only after its record was complete, so *a seal proves its record*, even when
//! the seal itself is the unit that wavers: with it or without it, the last valid record is the same.
//! A log that ends in anything but a sealed record ([`Log::is_settled`]) may have a record that
//! wavers. Before a device acts on what it read there, it appends that record once more, with its
//! seal: this one is sound and is the last from now on, whatever the wavering one reads as. A log
//! in which no record can be read, but which is not blank either, is erased.

use embedded_storage::nor_flash::NorFlash;

use super::program;
use crate::frame::checksum;
use crate::port::UNIT;
use crate::protocol::{FlashOperation, Refusal};

/// Length of an entry, its seal included, bytes.
pub const ENTRY_LENGTH: usize = 32;

const RECORD_LENGTH: usize = ENTRY_LENGTH - UNIT;

const RECORD_MAGIC: u32 = u32::from_le_bytes(*b"RayC");
const SEAL_MAGIC: u32 = u32::from_le_bytes(*b"Seal");

/// Entries that may fail to program before an append is given up.
const APPEND_TRIES: u32 = 4;

/// Entries kept free for what a boot may have to write, so that a commit can always be settled.
const RESERVE: u32 = 8;

/// What makes the blob behind it count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// The highest one wins; from 1.
    pub sequence: u32,
    /// Length of the blob, bytes.
    pub length: u32,
    /// CRC-32 of all its bytes.
    pub checksum: u32,
}

impl Record {
    fn to_entry(self) -> [u8; ENTRY_LENGTH] {
        let mut entry = [0; ENTRY_LENGTH];
        put(&mut entry, 0, RECORD_MAGIC);
        put(&mut entry, 1, self.sequence);
        put(&mut entry, 2, self.length);
        put(&mut entry, 3, self.checksum);
        let sum = checksum(entry.split_at_checked(16).map_or(&[], |(head, _)| head));
        put(&mut entry, 4, sum);
        put(&mut entry, 5, !sum);
        put(&mut entry, 6, SEAL_MAGIC);
        put(&mut entry, 7, sum);
        entry
    }

    /// The record of an entry, and whether it is sealed.
    fn read(entry: &[u8; ENTRY_LENGTH]) -> Option<(Self, bool)> {
        let record = Self {
            sequence: word(entry, 1)?,
            length: word(entry, 2)?,
            checksum: word(entry, 3)?,
        };
        let expected = record.to_entry();
        let (record_bytes, seal) = entry.split_at_checked(RECORD_LENGTH)?;
        let (expected_record, expected_seal) = expected.split_at_checked(RECORD_LENGTH)?;
        (record_bytes == expected_record).then_some((record, seal == expected_seal))
    }
}

fn put(entry: &mut [u8; ENTRY_LENGTH], at: usize, word: u32) {
    let place = entry.iter_mut().skip(4 * at);
    for (place, byte) in place.zip(word.to_le_bytes()) {
        *place = byte;
    }
}

fn word(entry: &[u8; ENTRY_LENGTH], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*entry.get(4 * at..)?.first_chunk()?))
}

/// What a log says now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Log {
    last: Option<Record>,
    is_settled: bool,
    /// The first entry behind all that is not blank.
    next: u32,
    entries: u32,
}

impl Log {
    /// Reads the log at the start of a slot. What cannot be read counts as damaged.
    #[inline(never)]
    pub fn read<R: NorFlash>(slot: &mut R) -> Self {
        let entries = (R::ERASE_SIZE / ENTRY_LENGTH) as u32;
        let mut log = Self {
            last: None,
            is_settled: true,
            next: 0,
            entries,
        };
        for index in 0..entries {
            let mut entry = [0; ENTRY_LENGTH];
            if slot.read(index * ENTRY_LENGTH as u32, &mut entry).is_err() {
                entry = [0; ENTRY_LENGTH];
            }
            if entry.iter().all(|&byte| byte == 0xff) {
                continue;
            }
            log.next = index + 1;
            match Record::read(&entry) {
                Some((record, is_sealed)) => {
                    log.last = Some(record);
                    log.is_settled = is_sealed;
                }
                None => log.is_settled = false,
            }
        }
        log
    }

    /// The last valid record.
    pub fn record(&self) -> Option<Record> {
        self.last
    }

    /// Whether it will say the same at every reading.
    pub fn is_settled(&self) -> bool {
        self.is_settled
    }

    /// Whether a commit may be appended, with enough left for what a boot may have to add.
    pub fn has_room(&self) -> bool {
        self.next.saturating_add(RESERVE) <= self.entries
    }

    /// Appends a record and its seal. An entry that does not take it is left behind for the next.
    ///
    /// # Errors
    /// [`Refusal::LogFull`], or [`Refusal::FlashFailed`] when several entries failed in a row.
    #[inline(never)]
    pub fn append<R: NorFlash>(&self, slot: &mut R, record: Record) -> Result<(), Refusal> {
        let bytes = record.to_entry();
        let mut outcome = Err(Refusal::LogFull);
        for index in (self.next..self.entries).take(APPEND_TRIES as usize) {
            outcome = program(slot, index * ENTRY_LENGTH as u32, &bytes);
            if outcome.is_ok() {
                break;
            }
        }
        outcome
    }

    /// Makes a commit: a record with its seal, and the same once more, so that no flipped bit can
    /// take it away. What counts is the first; the log is left as it was, or empty, if that fails.
    ///
    /// # Errors
    /// As [`Log::append`], and [`Refusal::LogFull`] if there is no reserve left.
    #[inline(never)]
    pub fn commit<R: NorFlash>(slot: &mut R, record: Record) -> Result<(), Refusal> {
        let before = Self::read(slot);
        if !before.has_room() {
            return Err(Refusal::LogFull);
        }
        if let Err(refusal) = before.append(slot, record) {
            before.restore(slot);
            return Err(refusal);
        }
        let _ = Self::read(slot).append(slot, record);
        Ok(())
    }

    /// After a commit that failed, whose record may yet read as valid one day.
    fn restore<R: NorFlash>(self, slot: &mut R) {
        let now = Self::read(slot);
        let is_restored = match self.last {
            _ if now == self => true,
            Some(record) => now.append(slot, record).is_ok(),
            None => false,
        };
        if !is_restored {
            let _ = erase_block(slot, 0);
        }
    }
}

/// Erases the block at `address`.
///
/// # Errors
/// [`Refusal::FlashFailed`].
pub fn erase_block<R: NorFlash>(slot: &mut R, address: u32) -> Result<(), Refusal> {
    slot.erase(address, address.saturating_add(R::ERASE_SIZE as u32))
        .map_err(|_| Refusal::FlashFailed {
            operation: FlashOperation::Erase,
            address,
        })
}
