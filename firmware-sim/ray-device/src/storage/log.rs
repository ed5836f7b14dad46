//! A slot's log: commit records, one behind the other, each with its seal.
//!
//! ```text
//! entry:  mark, where a line holds a whole record | record | seal
//! ```
//! Each starts a line, and what is left of its last line is as erased.
//! Line by line is programmed and read back. The log stands for its *last valid record*, sealed or not.
//!
//! # Why a decision lasts
//! The line that a cut of power hit may read differently each time, or not at all; all lines before it are
//! sound. A seal is programmed only after its record was complete, so *a seal proves its record*, even when
//! the seal itself is the line that wavers: with it or without it, the last valid record is the same. That
//! is why the seal never shares a line with its record, and is read on its own. And a record never
//! wavers in an entry that is blank but for it, so that it cannot read as nothing at all at one start and as valid at the
//! next: its first lines are sound by then, or the mark in front of it.
//! A log that ends in anything but a sealed record ([`Log::is_settled`]) may have a record that
//! wavers. Before a device acts on what it read there, it appends that record once more, with its
//! seal: this one is sound and is the last from now on, whatever the wavering one reads as. A log
//! in which no record can be read, but which is not blank either, is erased.

use super::access::{clear, erase, program, read};
use super::layout::Shape;
use super::record::{Found, LENGTH, MARK, OLD_LENGTH, Record, SEAL_LENGTH};
use super::slot::SlotFlash;
use crate::port::{Clock, Flash};
use crate::protocol::Refusal;

/// Entries that may fail to program before an append is given up.
const APPEND_TRIES: u32 = 4;

/// Entries kept free for what a boot may have to write, so that a commit can always be settled.
const RESERVE: u32 = 8;

/// Length of an entry of the first layout, bytes: two have room in one of today's.
const OLD_ENTRY_LENGTH: u32 = 32;

/// Entries that are read between two looks at the watchdog: 2048 bytes of the longest, twice.
const ENTRIES_A_STEP: u32 = 2;

/// What a log says now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Log {
    last: Option<Record>,
    is_of_this_part: bool,
    is_settled: bool,
    /// The first entry behind all that is not blank.
    next: u32,
}

impl Log {
    /// Reads the log of a slot. What cannot be read counts as damaged.
    #[inline(never)]
    pub fn read<S: SlotFlash, C: Clock>(slot: &mut S, clock: &mut C) -> Self {
        let shape = slot.shape();
        let flash = slot.log();
        let mut log = Self {
            last: None,
            is_of_this_part: true,
            is_settled: true,
            next: 0,
        };
        for index in 0..shape.entries() {
            if index % ENTRIES_A_STEP == 0 {
                clock.step();
            }
            let at = index.saturating_mul(shape.entry_length());
            if flash.is_blank(at, shape.entry_length()).unwrap_or(false) {
                continue;
            }
            log.next = index + 1;
            if let Some(found) = read_record(flash, at, shape) {
                let seal_at = at.saturating_add(shape.seal_start());
                log.note(flash, &found, seal_at);
            } else if has_old_entries(shape) {
                for at in [at, at.saturating_add(OLD_ENTRY_LENGTH)] {
                    log.note_old(flash, at);
                }
            } else {
                log.is_settled = false;
            }
        }
        log
    }

    fn note<R: Flash>(&mut self, flash: &mut R, found: &Found, seal_at: u32) {
        let mut seal = [0; SEAL_LENGTH];
        let is_read = read(flash, seal_at, &mut seal).is_ok();
        self.last = Some(found.record);
        self.is_of_this_part = found.is_of_this_part;
        self.is_settled = is_read && seal == found.seal;
    }

    fn note_old<R: Flash>(&mut self, flash: &mut R, at: u32) {
        if flash.is_blank(at, OLD_ENTRY_LENGTH).unwrap_or(false) {
            return;
        }
        let mut bytes = [0; OLD_LENGTH];
        let found = read(flash, at, &mut bytes)
            .ok()
            .and_then(|()| Record::read_old(&bytes));
        match found {
            Some(found) => self.note(flash, &found, at.saturating_add(OLD_LENGTH as u32)),
            None => self.is_settled = false,
        }
    }

    /// The last valid record.
    pub fn record(&self) -> Option<Record> {
        self.last
    }

    /// Whether that record was written for a flash of this shape.
    pub fn is_of_this_part(&self) -> bool {
        self.is_of_this_part
    }

    /// Whether it will say the same at every reading.
    pub fn is_settled(&self) -> bool {
        self.is_settled
    }

    /// Whether a commit may be appended, with enough left for what a boot may have to add.
    fn has_room(&self, shape: Shape) -> bool {
        self.next.saturating_add(RESERVE) <= shape.entries()
    }

    /// Appends a record and its seal. An entry that does not take it is left behind for the next.
    ///
    /// # Errors
    /// [`Refusal::LogFull`], or [`Refusal::FlashFailed`] when several entries failed in a row.
    #[inline(never)]
    pub fn append<S: SlotFlash, C: Clock>(
        &self,
        slot: &mut S,
        record: &Record,
        clock: &mut C,
    ) -> Result<(), Refusal> {
        let shape = slot.shape();
        let flash = slot.log();
        let (bytes, seal) = record.to_bytes(shape);
        let mut outcome = Err(Refusal::LogFull);
        for index in (self.next..shape.entries()).take(APPEND_TRIES as usize) {
            let at = index.saturating_mul(shape.entry_length());
            let record_at = at.saturating_add(shape.record_start());
            let seal_at = at.saturating_add(shape.seal_start());
            outcome = if record_at == at {
                Ok(())
            } else {
                program(flash, at, &MARK, clock)
            }
            .and_then(|()| program(flash, record_at, &bytes, clock))
            .and_then(|()| program(flash, seal_at, &seal, clock));
            if outcome.is_ok() {
                break;
            }
        }
        outcome
    }

    /// Makes a commit: a record with its seal, and the same once more, so that no flipped bit can
    /// take it away. What counts is the first; the log is left as it was, or empty, if that fails.
    ///
    /// A log that is full is erased before, if the blob behind it does not share its block.
    ///
    /// # Errors
    /// As [`Log::append`], and [`Refusal::LogFull`] if there is no reserve left.
    #[inline(never)]
    pub fn commit<S: SlotFlash, C: Clock>(
        slot: &mut S,
        record: &Record,
        clock: &mut C,
    ) -> Result<(), Refusal> {
        let mut before = Self::read(slot, clock);
        if !before.has_room(slot.shape()) {
            if slot.shape().is_log_shared() {
                return Err(Refusal::LogFull);
            }
            erase_log(slot, clock)?;
            before = Self::read(slot, clock);
        }
        if let Err(refusal) = before.append(slot, record, clock) {
            before.restore(slot, clock);
            return Err(refusal);
        }
        let _ = Self::read(slot, clock).append(slot, record, clock);
        Ok(())
    }

    /// After a commit that failed, whose record may yet read as valid one day.
    fn restore<S: SlotFlash, C: Clock>(self, slot: &mut S, clock: &mut C) {
        let now = Self::read(slot, clock);
        let is_restored = match self.last {
            _ if now == self => true,
            Some(record) => now.append(slot, &record, clock).is_ok(),
            None => false,
        };
        if !is_restored {
            let _ = erase_log(slot, clock);
        }
    }
}

/// The record at the start of an entry.
fn read_record<R: Flash>(flash: &mut R, at: u32, shape: Shape) -> Option<Found> {
    let mut bytes = [0; LENGTH];
    let at = at.saturating_add(shape.record_start());
    read(flash, at, &mut bytes).ok()?;
    Record::read(&bytes, shape)
}

/// Whether the part is one that the first layout was made for.
fn has_old_entries(shape: Shape) -> bool {
    shape.log.line() == 8 && !shape.is_log_apart && !shape.is_log_shared()
}

/// Erases the log of a slot, and what shares its block.
///
/// # Errors
/// [`Refusal::FlashFailed`].
pub fn erase_log<S: SlotFlash, C: Clock>(slot: &mut S, clock: &mut C) -> Result<(), Refusal> {
    let shape = slot.shape();
    let flash = slot.log();
    if shape.is_log_shared() && shape.log.needs_erase {
        erase(flash, 0, shape.log.block, clock)
    } else {
        clear(flash, 0, shape.log_length(), clock)
    }
}
