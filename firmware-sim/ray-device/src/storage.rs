//! Two slots for a blob in NOR flash, of which one is active, whatever happens.
//!
//! ```text
//! factory | slot 0: log, blob, manifest | slot 1: log, blob, manifest
//! ```
//! A slot starts with its [log] of commit records; [`layout`] says how long that is and where the blob
//! starts. An update erases the log of the inactive slot first, so that nothing there counts any more,
//! then each block of the blob as bytes come for it, programs, reads back, and at the very end
//! appends one commit record. The valid record with the highest sequence number wins, if the blob
//! behind it has its checksum and can be opened. A rollback appends a record to the other slot's log.
//! Of the active slot, nothing is erased or programmed while it is in use.
//!
//! # What a cut of power leaves
//! The unit that was being programmed may have lost some of its bits, read differently each time, or not
//! be readable at all, and the same goes for a block that was being erased.
//! What [`boot`] decides is therefore written down before the device serves: see [`log`]. Flash is read through
//! the driver before it is looked at in place, and a read that fails is damage, not a failure of the device.
//!
//! Assumed is that a cut hits one program unit, or one erase block, and nothing that was complete before.
//!
//! # Which flash
//! Units of 1 to 512 bytes, blocks that are a power of two of at least 64. Anything else does not compile:
//! ```
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/src/storage/any_part.rs"));
//! # fn main() {
//! ray_device::storage::require_supported::<Part<512, 512>>();
//! # }
//! ```
//! A unit of 1024 bytes:
//! ```compile_fail
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/src/storage/any_part.rs"));
//! # fn main() {
//! ray_device::storage::require_supported::<Part<1024, 4096>>();
//! # }
//! ```
//! A unit of 24 bytes:
//! ```compile_fail
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/src/storage/any_part.rs"));
//! # fn main() {
//! ray_device::storage::require_supported::<Part<24, 4096>>();
//! # }
//! ```
//! A block smaller than the unit:
//! ```compile_fail
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/src/storage/any_part.rs"));
//! # fn main() {
//! ray_device::storage::require_supported::<Part<512, 256>>();
//! # }
//! ```
//! A block of 1000 bytes:
//! ```compile_fail
//! # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/src/storage/any_part.rs"));
//! # fn main() {
//! ray_device::storage::require_supported::<Part<8, 1000>>();
//! # }
//! ```

pub mod access;
pub mod budget;
pub mod factory;
pub mod layout;
pub mod log;
pub mod record;
pub mod rig;
pub mod slot;
pub mod transfer;
pub mod trust;

use ray_runtime::{OpenError, RayBlob};

use crate::manifest::Manifest;
use crate::port::{Clock, Flash, Geometry, MappedFlash, Regions};
use crate::protocol::{Refusal, Rig, SlotState, StoredBlob};
use access::{checksum, erase, program};
use factory::{FACTORY_SLOT, Factory};
use layout::aligned;
use log::{Log, erase_log};
use record::{Claims, Record};
use slot::SlotFlash;
use trust::{Distrust, Trust};

/// Refuses, at compile time, flash that the storage cannot work with.
#[inline]
pub const fn require_supported<R: Flash>() {
    const {
        assert!(
            R::WRITE_SIZE.is_power_of_two() && R::WRITE_SIZE <= Geometry::MAX_UNIT as usize,
            "this flash cannot hold blobs: its program unit (NorFlash::WRITE_SIZE) must be a power of two of at most 512 \
             bytes; if the chip takes smaller units than its driver, wrap the driver"
        );
        assert!(
            Geometry::of::<R>().is_supported(),
            "this flash cannot hold blobs: its erase block (NorFlash::ERASE_SIZE) must be a power of two of at least 64 \
             bytes and no smaller than its program unit"
        );
        assert!(
            R::READ_SIZE.is_power_of_two() && R::READ_SIZE <= 8,
            "this flash cannot hold blobs: what its driver reads at once (ReadNorFlash::READ_SIZE) must be 1, 2, 4 or 8 \
             bytes; wrap a driver that reads more"
        );
    }
}

/// What a device starts with.
#[derive(Clone, Copy, Debug)]
pub struct Booted {
    /// The slot whose blob is in use.
    pub active: Option<usize>,
    /// What the slots hold.
    pub slots: [SlotState; 2],
    /// The records that say so.
    pub records: [Option<Record>; 2],
    /// What both records claim together, whatever became of their blobs, and the manifests in use.
    pub claims: Claims,
    /// The stable code of the runtime's `OpenError` for why no slot can be used, or [`OTHER_PART`].
    pub open_error: u8,
    /// The next commit record's sequence number; `None` when they have run out.
    pub next_sequence: Option<u32>,
}

/// In place of an `OpenError`'s code: the slot was written for a flash of another unit or block.
pub const OTHER_PART: u8 = 128;

/// Decides which slot is active, and writes the decision down wherever the flash might say something
/// else the next time. A device with an owner uses only what its owner signed, for this rig.
///
/// It never fails: flash that cannot be written leaves the decision as it is.
#[inline(never)]
pub fn boot<S: SlotFlash, F: Factory, C: Clock>(
    regions: &mut Regions<S, F>,
    trust: Trust,
    rig: Option<&Rig>,
    clock: &mut C,
) -> Booted {
    require_supported::<S::Log>();
    require_supported::<S::Blob>();
    let Regions {
        factory,
        slots: [slot_0, slot_1],
    } = regions;
    let logs = [settle(slot_0, clock), settle(slot_1, clock)];
    let mut records = logs.map(|log| log.record());
    let known = logs.map(|log| {
        log.record()
            .map_or(Claims::default(), |record| record.claims)
    });
    let known = known[0].joined(known[1]);
    let judge = Judge { trust, rig };
    let [(state_0, claims_0), (state_1, claims_1)] = [
        inspect(0, slot_0, &logs[0], judge, known, factory.blob(), clock),
        inspect(1, slot_1, &logs[1], judge, known, factory.blob(), clock),
    ];
    let claims = claims_0.joined(claims_1);
    let factory = usable_factory(factory.blob(), trust, claims);
    let mut slots = [
        judge.once_more(state_0, slot_0, records[0], claims),
        judge.once_more(state_1, slot_1, records[1], claims),
    ];
    let newest = match records {
        [Some(a), Some(b)] if b.sequence > a.sequence => Some(b),
        [Some(a), _] => Some(a),
        [None, b] => b,
    }
    .unwrap_or_default();
    let mut active = match held(&slots) {
        [Some(a), Some(b)] if b.sequence > a.sequence => Some((1, b)),
        [Some(a), _] => Some((0, a)),
        [None, Some(b)] => Some((1, b)),
        [None, None] => factory_blob(factory).map(|stored| (FACTORY, stored)),
    };
    let mut next_sequence = newest.sequence.checked_add(1);
    if let (Some((used, stored)), Some(next)) = (active, next_sequence)
        && newest.sequence > stored.sequence
    {
        // The newest blob was damaged. Should it read well again one day, it must not come back. The factory's is
        // noted in the log of that one.
        let slot = match (used, &records) {
            (FACTORY, [Some(record), _]) if *record == newest => 0,
            (FACTORY, _) => 1,
            (slot, _) => slot,
        };
        let (region, record, state) = match (slot, &mut records, &mut slots) {
            (0, [record, _], [state, _]) => (slot_0, record, state),
            (_, [_, record], [_, state]) => (slot_1, record, state),
        };
        let again = match *record {
            Some(record) if used != FACTORY => record,
            _ => Record::default(),
        };
        let again = Record {
            sequence: next,
            claims,
            ..again
        };
        if Log::read(region, clock)
            .append(region, &again, clock)
            .is_ok()
        {
            *record = Some(again);
            let stored = StoredBlob {
                slot: slot as u8,
                sequence: next,
                ..stored
            };
            *state = SlotState::Holds(stored);
            active = Some((slot, stored));
            next_sequence = next.checked_add(1);
        }
    }
    Booted {
        active: active.map(|(slot, _)| slot),
        slots,
        records,
        claims,
        open_error: open_error(slots),
        next_sequence,
    }
}

/// In place of a slot: the factory's blob, without a record that says so.
pub const FACTORY: usize = FACTORY_SLOT as usize;

/// Why there is nothing to open: nothing was ever stored.
pub const NO_BLOB: OpenError = OpenError::BadMagic { found: u32::MAX };

/// The factory's blob, with a look at all of it.
///
/// # Errors
/// Any [`OpenError`]; [`NO_BLOB`] if there is none.
#[inline(never)]
pub fn open_factory(factory: Option<&[u8]>) -> Result<RayBlob<'_>, OpenError> {
    let bytes = factory.ok_or(NO_BLOB)?;
    RayBlob::open_with_crc_of_all(bytes, crate::frame::checksum(bytes))
}

/// What is to be said of the factory's blob, if there is one and it can be used.
#[inline(never)]
pub fn factory_blob(factory: Option<&[u8]>) -> Option<StoredBlob> {
    let bytes = factory?;
    let blob = open_factory(factory).ok()?;
    Some(StoredBlob {
        slot: FACTORY_SLOT,
        sequence: 0,
        length: bytes.len() as u32,
        checksum: crate::frame::checksum(bytes),
        identity: *blob.identity(),
        version: 0,
    })
}

/// The factory's blob, if the owner has not ruled it out: it came with the device, as its firmware did, and counts
/// as version 0.
pub fn usable_factory(factory: Option<&[u8]>, trust: Trust, claims: Claims) -> Option<&[u8]> {
    factory.filter(|_| !trust.needs_signature() || claims.check_factory().is_ok())
}

/// The blobs that can be used.
fn held(slots: &[SlotState; 2]) -> [Option<StoredBlob>; 2] {
    slots.map(|state| match state {
        SlotState::Holds(stored) => Some(stored),
        _ => None,
    })
}

/// What a slot's log stands for, made to last.
#[inline(never)]
fn settle<S: SlotFlash, C: Clock>(slot: &mut S, clock: &mut C) -> Log {
    let log = Log::read(slot, clock);
    if log.is_settled() || !log.is_of_this_part() {
        return log;
    }
    let is_written = match log.record() {
        Some(record) => log.append(slot, &record, clock).is_ok(),
        None => false,
    };
    // Nothing of it reads as a record, or there is no room to write it again.
    if !is_written && log.record().is_none() {
        let _ = erase_log(slot, clock);
    }
    log
}

/// Who says what may be used.
#[derive(Clone, Copy)]
struct Judge<'a> {
    trust: Trust,
    rig: Option<&'a Rig>,
}

impl Judge<'_> {
    /// The same state, or that it may not be used after all, now that the other slot's manifest is known, too.
    fn once_more<S: SlotFlash>(
        self,
        state: SlotState,
        slot: &S,
        record: Option<Record>,
        claims: Claims,
    ) -> SlotState {
        let (Some(_), SlotState::Holds(stored), Some(record)) = (self.trust.keys(), state, record)
        else {
            return state;
        };
        let checked = if record.length == 0 {
            claims.check_factory()
        } else {
            trust::read(manifest_bytes(slot, &record))
                .and_then(|(manifest, _)| claims.check_use(&manifest))
        };
        match checked {
            Ok(()) => state,
            Err(refusal) => SlotState::Unusable {
                sequence: stored.sequence,
                open_error: Distrust::of(refusal).code(),
            },
        }
    }
}

/// What a slot holds, by its log, and what the device claims with it.
#[inline(never)]
fn inspect<S: SlotFlash, C: Clock>(
    index: u8,
    slot: &mut S,
    log: &Log,
    judge: Judge<'_>,
    claims: Claims,
    factory: Option<&[u8]>,
    clock: &mut C,
) -> (SlotState, Claims) {
    let Some(record) = log.record() else {
        return (SlotState::Empty, claims);
    };
    let unusable = |open_error| {
        let sequence = record.sequence;
        (
            SlotState::Unusable {
                sequence,
                open_error,
            },
            claims,
        )
    };
    if !log.is_of_this_part() {
        return unusable(OTHER_PART);
    }
    if record.length == 0 {
        return match factory_blob(factory) {
            Some(stored) => {
                let stored = StoredBlob {
                    slot: index,
                    sequence: record.sequence,
                    ..stored
                };
                (SlotState::Holds(stored), claims)
            }
            None => unusable(NO_BLOB.code()),
        };
    }
    if let Err(error) = verify(slot, &record, clock) {
        return unusable(error.code());
    }
    let identity = match open_verified(slot, &record) {
        Ok(blob) => *blob.identity(),
        Err(error) => return unusable(error.code()),
    };
    let (version, claims) = match trusted(slot, &record, judge.trust, judge.rig, claims, clock) {
        Ok(Some(manifest)) => (manifest.version, claims.after(&manifest)),
        Ok(None) => (0, claims),
        Err(refusal) => return unusable(Distrust::of(refusal).code()),
    };
    let stored = StoredBlob {
        slot: index,
        sequence: record.sequence,
        length: record.length,
        checksum: record.checksum,
        identity,
        version,
    };
    (SlotState::Holds(stored), claims)
}

/// The manifest of a record that [`verify`] found good, if the device has an owner, who then must have signed it.
///
/// # Errors
/// Those of [`Keys::check_stored`](trust::Keys::check_stored).
#[inline(never)]
pub fn trusted<S: SlotFlash, C: Clock>(
    slot: &S,
    record: &Record,
    trust: Trust,
    rig: Option<&Rig>,
    claims: Claims,
    clock: &mut C,
) -> Result<Option<Manifest>, Refusal> {
    let Some(keys) = trust.keys() else {
        return Ok(None);
    };
    if record.length == 0 {
        return claims.check_factory().map(|()| None);
    }
    let blob = blob_bytes(slot, record).unwrap_or_default();
    let manifest = manifest_bytes(slot, record);
    keys.check_stored(manifest, blob, rig, claims, &mut || clock.step())
        .map(Some)
}

/// Reads all of a record's blob through the driver and compares its checksum, and all of its manifest, so
/// that they can be looked at in place.
///
/// # Errors
/// [`OpenError::Truncated`] if the slot is shorter, [`OpenError::BadCrc`] if the bytes are others or cannot be read.
#[inline(never)]
pub fn verify<S: SlotFlash, C: Clock>(
    slot: &mut S,
    record: &Record,
    clock: &mut C,
) -> Result<(), OpenError> {
    let limit = slot.max_blob(record.manifest_length);
    if record.length > limit {
        return Err(OpenError::Truncated {
            need: record.length,
            have: limit,
        });
    }
    let stated = record.checksum;
    let computed = stored_checksum(slot, record.length, clock).unwrap_or(!stated);
    let shape = slot.shape();
    let manifest = checksum(
        slot.blob_to_write(),
        shape.manifest_start(record.length),
        record.manifest_length,
        clock,
    );
    if computed == stated && manifest.is_ok() {
        Ok(())
    } else {
        Err(OpenError::BadCrc {
            stated,
            computed: if computed == stated {
                !stated
            } else {
                computed
            },
        })
    }
}

/// The checksum of the first `length` bytes of a slot's blob, as the driver reads them.
///
/// # Errors
/// [`Refusal::FlashFailed`].
pub fn stored_checksum<S: SlotFlash, C: Clock>(
    slot: &mut S,
    length: u32,
    clock: &mut C,
) -> Result<u32, Refusal> {
    let start = slot.shape().blob_start();
    checksum(slot.blob_to_write(), start, length, clock)
}

/// The blob of a record that [`verify`] found good, opened in place. Its checksum is not computed again.
///
/// # Errors
/// Any [`OpenError`].
#[inline(never)]
pub fn open_verified<'a, S: SlotFlash>(
    slot: &'a S,
    record: &Record,
) -> Result<RayBlob<'a>, OpenError> {
    RayBlob::open_with_crc_of_all(blob_bytes(slot, record)?, record.checksum)
}

/// The same, or the factory's blob if the record says that.
///
/// # Errors
/// Any [`OpenError`].
pub fn open_of<'a, S: SlotFlash>(
    slot: &'a S,
    factory: Option<&'a [u8]>,
    record: &Record,
) -> Result<RayBlob<'a>, OpenError> {
    if record.length == 0 {
        open_factory(factory)
    } else {
        open_verified(slot, record)
    }
}

/// The bytes of a record's blob, for whoever has [verified](verify) them.
///
/// # Errors
/// [`OpenError::Truncated`] if the slot is shorter.
pub fn blob_bytes<'a, S: SlotFlash>(slot: &'a S, record: &Record) -> Result<&'a [u8], OpenError> {
    slot.blob()
        .mapped(slot.shape().blob_start(), record.length)
        .ok_or(OpenError::Truncated {
            need: record.length,
            have: slot.max_blob(0),
        })
}

/// The bytes of a record's manifest, for whoever has [verified](verify) the record; none if it has none, or
/// one that does not fit the slot.
pub fn manifest_bytes<'a, S: SlotFlash>(slot: &'a S, record: &Record) -> &'a [u8] {
    if record.manifest_length == 0 {
        return &[];
    }
    let start = slot.shape().manifest_start(record.length);
    let bytes = slot.blob().mapped(start, record.manifest_length);
    bytes.unwrap_or_default()
}

/// Programs the next bytes of a blob, from `offset` on, a multiple of the line; they may end inside a line if no
/// more follow. Each block is erased when the first byte for it comes.
///
/// # Errors
/// [`Refusal::FlashFailed`].
#[inline(never)]
pub fn program_blob<S: SlotFlash, C: Clock>(
    slot: &mut S,
    offset: u32,
    bytes: &[u8],
    clock: &mut C,
) -> Result<(), Refusal> {
    let start = slot.shape().blob_start().saturating_add(offset);
    let region = slot.blob_to_write();
    let block = region.geometry().block;
    let end = start.saturating_add(bytes.len() as u32);
    erase(region, aligned(start, block), aligned(end, block), clock)?;
    program(region, start, bytes, clock)
}

/// Programs the manifest behind a blob of this length, all of which has been programmed.
///
/// # Errors
/// [`Refusal::FlashFailed`].
pub fn program_manifest<S: SlotFlash, C: Clock>(
    slot: &mut S,
    blob_length: u32,
    bytes: &[u8],
    clock: &mut C,
) -> Result<(), Refusal> {
    let shape = slot.shape();
    let offset = shape.manifest_start(blob_length) - shape.blob_start();
    program_blob(slot, offset, bytes, clock)
}

/// Reads bytes of a slot's blob through the driver, from `offset` on; both are multiples of 8.
///
/// # Errors
/// [`Refusal::FlashFailed`].
pub fn read_blob<S: SlotFlash>(slot: &mut S, offset: u32, bytes: &mut [u8]) -> Result<(), Refusal> {
    let start = slot.shape().blob_start().saturating_add(offset);
    access::read(slot.blob_to_write(), start, bytes)
}

/// Why there is no blob: of the newest one that was ever finished, or that there is none.
fn open_error(slots: [SlotState; 2]) -> u8 {
    let error_of = |state| match state {
        SlotState::Unusable {
            sequence,
            open_error,
        } => (sequence, open_error),
        _ => (0, NO_BLOB.code()),
    };
    let [a, b] = slots.map(error_of);
    if b.0 > a.0 { b.1 } else { a.1 }
}
