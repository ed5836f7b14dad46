//! Which slot is active when a device starts, by the logs, the blobs behind them, and what the owner signed.

use super::contents::{blob_bytes, manifest_bytes, open_verified, verify};
use super::factory::Factory;
use super::factory_blob::{FACTORY, NO_BLOB, factory_blob, usable_factory};
use super::log::{Log, erase_log};
use super::record::Record;
use super::slot::SlotFlash;
use super::supported::require_supported;
use super::trust::{self, Trust};
use crate::manifest::Manifest;
use crate::port::{Clock, Regions};
use crate::protocol::{Claims, Distrust, OTHER_PART, Refusal, Rig, SlotState, StoredBlob};

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
