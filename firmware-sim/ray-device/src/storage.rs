//! Two slots for a blob in NOR flash, of which one is active, whatever happens.
//!
//! ```text
//! factory block | slot 0: log block, blob | slot 1: log block, blob
//! ```
//! A slot's first erase block is its [log] of commit records; the blob starts behind it, on a multiple
//! of 8. An update erases the log of the inactive slot first, so that nothing there counts any more,
//! then each block of the blob as bytes come for it, programs, reads back, and at the very end
//! appends one commit record. The valid record with the highest sequence number wins, if the blob
//! behind it has its checksum and can be opened. A rollback appends a record to the other slot's log.
//! Of the active slot, nothing is erased or programmed while it is in use.
//!
//! # What a cut of power leaves
//! The unit that was being programmed may have lost some of its bits, or read differently each time.
//! What [`boot`] decides is therefore written down before the device serves: see [`log`].
//!
//! Assumed is that a cut hits one program unit of up to 8 bytes ([`UNIT`]), or one erase block, and nothing that
//! was complete before.

pub mod log;
pub mod rig;
pub mod transfer;
pub mod trust;

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use ray_runtime::{OpenError, RayBlob};

use crate::frame::checksum;
use crate::port::{MappedFlash, Regions, UNIT};
use crate::protocol::{FlashOperation, Refusal, SlotState, StoredBlob};
use log::{Log, Record};

/// Where the regions of a flash start and how long they are, bytes from its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Length of an erase block, and so of the factory record's.
    pub block: u32,
    /// Length of a slot.
    pub slot: u32,
}

impl Layout {
    /// For a flash of `capacity` bytes in blocks of `block`: one block for the factory record, and
    /// half of the rest for each slot. `None` if that leaves a slot less than two blocks, or the
    /// blocks are no multiple of an entry of the log.
    pub const fn of(capacity: u32, block: u32) -> Option<Self> {
        if block == 0 || !block.is_multiple_of(log::ENTRY_LENGTH as u32) {
            return None;
        }
        let Some(blocks) = (capacity / block).checked_sub(1) else {
            return None;
        };
        let slot = blocks / 2 * block;
        if slot < 2 * block {
            return None;
        }
        Some(Self { block, slot })
    }

    /// Where a slot starts.
    pub const fn slot_start(self, slot: usize) -> u32 {
        match slot {
            0 => self.block,
            _ => self.block + self.slot,
        }
    }

    /// Longest blob, bytes.
    pub const fn max_blob(self) -> u32 {
        self.slot - self.block
    }
}

/// Longest blob in a slot of this flash, bytes.
pub fn max_blob<R: NorFlash>(slot: &R) -> u32 {
    slot.capacity().saturating_sub(R::ERASE_SIZE) as u32
}

/// What a device starts with.
#[derive(Clone, Copy, Debug)]
pub struct Booted {
    /// The slot whose blob is in use.
    pub active: Option<usize>,
    /// What the slots hold.
    pub slots: [SlotState; 2],
    /// The stable code of the runtime's `OpenError` for why no slot can be used.
    pub open_error: u8,
    /// The next commit record's sequence number; `None` when they have run out.
    pub next_sequence: Option<u32>,
}

/// Decides which slot is active, and writes the decision down wherever the flash might say something
/// else the next time.
///
/// It never fails: flash that cannot be written leaves the decision as it is.
#[inline(never)]
pub fn boot<R: MappedFlash>(regions: &mut Regions<R>) -> Booted {
    let Regions {
        slots: [slot_0, slot_1],
        ..
    } = regions;
    let records = [settle(slot_0), settle(slot_1)];
    let mut slots = [
        inspect(0, slot_0, records[0]),
        inspect(1, slot_1, records[1]),
    ];
    let highest = records.iter().flatten().map(|record| record.sequence).max();
    let held = slots.map(|state| match state {
        SlotState::Holds(stored) => Some(stored),
        _ => None,
    });
    let active = match held {
        [Some(a), Some(b)] if b.sequence > a.sequence => Some((1, b)),
        [Some(a), _] => Some((0, a)),
        [None, Some(b)] => Some((1, b)),
        [None, None] => None,
    };
    let mut next_sequence = highest.unwrap_or(0).checked_add(1);
    if let (Some((slot, stored)), Some(highest), Some(next)) = (active, highest, next_sequence)
        && highest > stored.sequence
    {
        // The newest blob was damaged. Should it read well again one day, it must not come back.
        let region = if slot == 0 { slot_0 } else { slot_1 };
        let record = Record {
            sequence: next,
            length: stored.length,
            checksum: stored.checksum,
        };
        if Log::read(region).append(region, record).is_ok() {
            let state = SlotState::Holds(StoredBlob {
                sequence: next,
                ..stored
            });
            match slot {
                0 => slots[0] = state,
                _ => slots[1] = state,
            }
            next_sequence = next.checked_add(1);
        }
    }
    Booted {
        active: active.map(|(slot, _)| slot),
        slots,
        open_error: open_error(slots),
        next_sequence,
    }
}

/// The record that a slot's log stands for, made to last.
#[inline(never)]
fn settle<R: MappedFlash>(slot: &mut R) -> Option<Record> {
    let log = Log::read(slot);
    if log.is_settled() {
        return log.record();
    }
    if let Some(record) = log.record()
        && log.append(slot, record).is_ok()
    {
        return Some(record);
    }
    // Nothing of it reads as a record, or there is no room to write it again.
    if log.record().is_none() {
        let _ = slot.erase(0, R::ERASE_SIZE as u32);
    }
    log.record()
}

/// What a slot holds, by its record.
#[inline(never)]
fn inspect<R: MappedFlash>(index: u8, slot: &R, record: Option<Record>) -> SlotState {
    let Some(record) = record else {
        return SlotState::Empty;
    };
    match blob_of(slot, record) {
        Ok(blob) => SlotState::Holds(StoredBlob {
            slot: index,
            sequence: record.sequence,
            length: record.length,
            checksum: record.checksum,
            identity: *blob.identity(),
        }),
        Err(error) => SlotState::Unusable {
            sequence: record.sequence,
            open_error: error.code(),
        },
    }
}

/// The blob of a record, opened in place after a look at all of it.
///
/// # Errors
/// Any [`OpenError`], among them the checksum of the record that is not that of the bytes.
pub fn blob_of<R: MappedFlash>(slot: &R, record: Record) -> Result<RayBlob<'_>, OpenError> {
    let bytes = blob_bytes(slot, record.length)?;
    let blob = open(bytes)?;
    let computed = checksum(bytes);
    if computed != record.checksum {
        return Err(OpenError::BadCrc {
            stated: record.checksum,
            computed,
        });
    }
    Ok(blob)
}

/// [`RayBlob::open`], which is long, once in the image.
///
/// # Errors
/// Any [`OpenError`].
#[inline(never)]
pub fn open(bytes: &[u8]) -> Result<RayBlob<'_>, OpenError> {
    RayBlob::open(bytes)
}

/// The first bytes behind the log.
///
/// # Errors
/// [`OpenError::Truncated`] if the slot is shorter.
pub fn blob_bytes<R: MappedFlash>(slot: &R, length: u32) -> Result<&[u8], OpenError> {
    let start = R::ERASE_SIZE;
    slot.mapped()
        .get(start..start.saturating_add(length as usize))
        .ok_or(OpenError::Truncated {
            need: length,
            have: max_blob(slot),
        })
}

/// Why there is no blob: of the newest one that was ever finished, or that there is none.
fn open_error(slots: [SlotState; 2]) -> u8 {
    let error_of = |state| match state {
        SlotState::Unusable {
            sequence,
            open_error,
        } => (sequence, open_error),
        _ => (0, OpenError::BadMagic { found: u32::MAX }.code()),
    };
    let [a, b] = slots.map(error_of);
    if b.0 > a.0 { b.1 } else { a.1 }
}

/// Programs `bytes` at `start`, which may end inside a unit: the rest of it stays blank. Then reads
/// back.
///
/// # Errors
/// [`Refusal::FlashFailed`].
#[inline(never)]
pub fn program<R: NorFlash>(slot: &mut R, start: u32, bytes: &[u8]) -> Result<(), Refusal> {
    for (address, unit) in (start..).step_by(UNIT).zip(bytes.chunks(UNIT)) {
        let mut padded = [0xff; UNIT];
        for (place, &byte) in padded.iter_mut().zip(unit) {
            *place = byte;
        }
        let failed = Refusal::FlashFailed {
            operation: FlashOperation::Program,
            address,
        };
        slot.write(address, &padded).map_err(|_| failed)?;
        if read_unit(slot, address)? != padded {
            return Err(failed);
        }
    }
    Ok(())
}

fn read_unit<R: ReadNorFlash>(slot: &mut R, address: u32) -> Result<[u8; UNIT], Refusal> {
    let mut unit = [0; UNIT];
    slot.read(address, &mut unit)
        .map_err(|_| Refusal::FlashFailed {
            operation: FlashOperation::Read,
            address,
        })?;
    Ok(unit)
}
