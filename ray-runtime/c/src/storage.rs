//! Two slots in flash: the second half of `rays_device.h`, which is its documentation.
//!
//! What an update is made of is that of a device that takes blobs over a wire: `ray_device::storage`.

use core::ffi::{c_int, c_void};
use core::mem::MaybeUninit;
use ray_device::port::Regions;
use ray_device::protocol::{Refusal, Rig};
use ray_device::storage::factory::Factory;
use ray_device::storage::log::{Log, erase_log};
use ray_device::storage::record::{Claims, Record};
use ray_device::storage::slot::SlotFlash;
use ray_device::storage::trust::Trust;
use ray_device::storage::{
    self as slots, blob_bytes, open_verified, program_blob, stored_checksum, verify,
};
use ray_runtime::OpenError;
use ray_runtime::format::HEADER_LEN;

use crate::driver::{Driver, Steps};
use crate::{BAD_ARGUMENT, NOT_OPEN, OK, slice};

const BAD_FLASH: c_int = 160;
const FLASH_FAILED: c_int = 161;
const NO_BLOB: c_int = 162;
const OTHER_PART: c_int = 163;
const NO_UPDATE: c_int = 164;
const BAD_CHUNK: c_int = 165;
const TOO_LONG: c_int = 166;
const INCOMPLETE: c_int = 167;
const LOG_FULL: c_int = 168;
const NOTHING_TO_ROLL_BACK_TO: c_int = 169;

/// Memory for two slots, owned by the caller.
#[repr(C)]
pub struct Storage {
    opaque: [MaybeUninit<*const ()>; 96],
}

/// What lies in a [`Storage`].
struct Started {
    /// [`STARTED`], or something else.
    state: u32,
    regions: Regions<Driver, NoFactory>,
    /// The slot in use, if there is one.
    active: Option<u8>,
    /// Why there is none.
    open_error: u8,
    records: [Option<Record>; 2],
    claims: Claims,
    next_sequence: Option<u32>,
    update: Option<Update>,
}

/// What it was made with is the application's business.
struct NoFactory;

impl Factory for NoFactory {
    fn rig(&mut self) -> Option<Rig> {
        None
    }
}

/// A blob under way.
#[derive(Clone, Copy)]
struct Update {
    length: u32,
    received: u32,
}

/// "SLOT".
const STARTED: u32 = 0x544f_4c53;

const _: () = assert!(
    size_of::<Started>() <= size_of::<Storage>() && align_of::<Started>() <= align_of::<Storage>(),
    "two slots do not fit into a rays_storage: enlarge it here and in rays_device.h"
);

/// Decides which slot's blob is active.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_storage_start(
    storage: *mut Storage,
    drivers: *const [Driver; 2],
) -> c_int {
    // SAFETY: null or two drivers, says the caller.
    let (Some(drivers), false) = (unsafe { drivers.as_ref() }, storage.is_null()) else {
        return BAD_ARGUMENT;
    };
    // SAFETY: not null, hence memory for a storage, which a `Started` fits into (asserted above). Nobody else uses it meanwhile.
    let started = unsafe { &mut *storage.cast::<MaybeUninit<Started>>() };
    let started = started.write(Started {
        state: 0,
        regions: Regions {
            factory: NoFactory,
            slots: *drivers,
        },
        active: None,
        open_error: 0,
        records: [None; 2],
        claims: Claims::default(),
        next_sequence: None,
        update: None,
    });
    let is_supported = |driver: &Driver| driver.is_supported() && driver.max_blob(0) > 0;
    if !drivers.iter().all(is_supported) {
        return BAD_FLASH;
    }
    let [first, _] = drivers;
    let booted = slots::boot(
        &mut started.regions,
        Trust::Anybody,
        None,
        &mut first.steps(),
    );
    started.active = booted.active.map(|slot| u8::from(slot != 0));
    started.open_error = booted.open_error;
    started.records = booted.records;
    started.claims = booted.claims;
    started.next_sequence = booted.next_sequence;
    started.state = STARTED;
    OK
}

/// The active blob.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_storage_blob(
    storage: *const Storage,
    blob: *mut *const c_void,
    length: *mut usize,
) -> c_int {
    if blob.is_null() || length.is_null() {
        return BAD_ARGUMENT;
    }
    // SAFETY: null or a storage that went through `rays_storage_start`, says the caller.
    match unsafe { started(storage) }.and_then(Started::blob) {
        Ok(bytes) => {
            // SAFETY: neither is null, hence they are what they should be.
            unsafe {
                blob.write(bytes.as_ptr().cast());
                length.write(bytes.len());
            }
            OK
        }
        Err(code) => code,
    }
}

/// Longest blob.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_storage_max_blob(
    storage: *const Storage,
    length: *mut usize,
) -> c_int {
    if length.is_null() {
        return BAD_ARGUMENT;
    }
    // SAFETY: null or a storage that went through `rays_storage_start`, says the caller.
    match unsafe { started(storage) } {
        Ok(started) => {
            // SAFETY: not null, hence a size_t.
            unsafe { length.write(started.max_blob() as usize) };
            OK
        }
        Err(code) => code,
    }
}

/// A new blob is coming.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_storage_begin(storage: *mut Storage, length: usize) -> c_int {
    // SAFETY: the caller's word.
    unsafe { change(storage, |started| started.begin(length)) }
}

/// Its next bytes.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_storage_write(
    storage: *mut Storage,
    bytes: *const u8,
    length: usize,
) -> c_int {
    // SAFETY: null or as many bytes as stated, says the caller.
    let Some(bytes) = (unsafe { slice(bytes, length) }) else {
        return BAD_ARGUMENT;
    };
    // SAFETY: the caller's word.
    unsafe { change(storage, |started| started.write(bytes)) }
}

/// All bytes are there.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_storage_finish(storage: *mut Storage) -> c_int {
    // SAFETY: the caller's word.
    unsafe { change(storage, Started::finish) }
}

/// Back to the other slot's blob.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_storage_rollback(storage: *mut Storage) -> c_int {
    // SAFETY: the caller's word.
    unsafe { change(storage, Started::rollback) }
}

impl Started {
    /// The slot that may be written: the one not in use, or the one with less in it.
    fn inactive(&self) -> usize {
        let sequence = |record: Option<Record>| record.map_or(0, |record| record.sequence);
        let [first, second] = self.records.map(sequence);
        match self.active {
            Some(0) => 1,
            Some(_) => 0,
            None => usize::from(first > second),
        }
    }

    fn max_blob(&self) -> u32 {
        let [first, second] = &self.regions.slots;
        first.max_blob(0).min(second.max_blob(0))
    }

    /// The slot that may be written, its watchdog, and its record.
    fn inactive_slot(&mut self) -> Result<(&mut Driver, Steps, &mut Option<Record>), c_int> {
        let inactive = self.inactive();
        // Neither can fail: there are two of each.
        let slot = self.regions.slots.get_mut(inactive).ok_or(BAD_FLASH)?;
        let record = self.records.get_mut(inactive).ok_or(BAD_FLASH)?;
        let steps = slot.steps();
        Ok((slot, steps, record))
    }

    fn blob(&self) -> Result<&[u8], c_int> {
        let Some(active) = self.active.map(usize::from) else {
            return Err(match self.open_error {
                slots::OTHER_PART => OTHER_PART,
                code if code == (OpenError::BadMagic { found: 0 }).code() => NO_BLOB,
                code => code.into(),
            });
        };
        match (self.regions.slots.get(active), self.records.get(active)) {
            (Some(slot), Some(Some(record))) => blob_bytes(slot, record).map_err(code_of_open),
            _ => Err(NO_BLOB),
        }
    }

    fn begin(&mut self, length: usize) -> Result<(), c_int> {
        let length = u32::try_from(length).map_err(|_| TOO_LONG)?;
        if length > self.max_blob() || (length as usize) < HEADER_LEN {
            return Err(TOO_LONG);
        }
        self.update = None;
        let (slot, mut steps, record) = self.inactive_slot()?;
        *record = None;
        erase_log(slot, &mut steps).map_err(code_of)?;
        self.update = Some(Update {
            length,
            received: 0,
        });
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), c_int> {
        let update = self.update.ok_or(NO_UPDATE)?;
        let (slot, mut steps, _) = self.inactive_slot()?;
        let length = u32::try_from(bytes.len()).map_err(|_| BAD_CHUNK)?;
        let missing = update.length.saturating_sub(update.received);
        let line = slot.shape().blob.line();
        if length == 0
            || length > missing
            || (length < missing && length & line.saturating_sub(1) != 0)
        {
            return Err(BAD_CHUNK);
        }
        let outcome = program_blob(slot, update.received, bytes, &mut steps);
        // Part of it may be programmed, and cannot be once more.
        self.update = outcome.is_ok().then_some(Update {
            received: update.received.saturating_add(length),
            ..update
        });
        outcome.map_err(code_of)
    }

    fn finish(&mut self) -> Result<(), c_int> {
        let update = self.update.ok_or(NO_UPDATE)?;
        if update.received < update.length {
            return Err(INCOMPLETE);
        }
        self.update = None;
        let sequence = self.next_sequence.ok_or(LOG_FULL)?;
        let claims = self.claims;
        let (slot, mut steps, _) = self.inactive_slot()?;
        let record = Record {
            sequence,
            length: update.length,
            checksum: stored_checksum(slot, update.length, &mut steps).map_err(code_of)?,
            manifest_length: 0,
            claims,
        };
        open_verified(slot, &record).map_err(code_of_open)?;
        self.commit(record)
    }

    fn rollback(&mut self) -> Result<(), c_int> {
        if self.update.is_some() || self.active.is_none() {
            return Err(NOTHING_TO_ROLL_BACK_TO);
        }
        let sequence = self.next_sequence.ok_or(LOG_FULL)?;
        let claims = self.claims;
        let (slot, mut steps, record) = self.inactive_slot()?;
        let record = record.ok_or(NOTHING_TO_ROLL_BACK_TO)?;
        let record = Record {
            sequence,
            claims,
            ..record
        };
        verify(slot, &record, &mut steps)
            .and_then(|()| open_verified(slot, &record).map(|_| ()))
            .map_err(code_of_open)?;
        self.commit(record)
    }

    /// Makes the inactive slot's blob count, and the slot the active one.
    fn commit(&mut self, record: Record) -> Result<(), c_int> {
        let inactive = self.inactive();
        let (slot, mut steps, place) = self.inactive_slot()?;
        Log::commit(slot, &record, &mut steps).map_err(code_of)?;
        *place = Some(record);
        self.active = Some(u8::from(inactive != 0));
        self.next_sequence = record.sequence.checked_add(1);
        Ok(())
    }
}

fn code_of(refusal: Refusal) -> c_int {
    match refusal {
        Refusal::LogFull => LOG_FULL,
        _ => FLASH_FAILED,
    }
}

fn code_of_open(error: OpenError) -> c_int {
    error.code().into()
}

/// A storage that was started.
///
/// # Safety
/// `storage` is null or went through [`rays_storage_start`].
unsafe fn started<'a>(storage: *const Storage) -> Result<&'a Started, c_int> {
    // SAFETY: null or a `Started`, which is what `rays_storage_start` leaves in every storage.
    match unsafe { storage.cast::<Started>().as_ref() } {
        None => Err(BAD_ARGUMENT),
        Some(started) if started.state == STARTED => Ok(started),
        Some(_) => Err(NOT_OPEN),
    }
}

/// Does something to a storage; the code.
///
/// # Safety
/// As for [`started`], and nobody else uses it meanwhile.
unsafe fn change(
    storage: *mut Storage,
    act: impl FnOnce(&mut Started) -> Result<(), c_int>,
) -> c_int {
    // SAFETY: the caller's word.
    if let Err(code) = unsafe { started(storage) } {
        return code;
    }
    // SAFETY: not null, and a `Started`; nobody else uses it, says the caller.
    let started = unsafe { &mut *storage.cast::<Started>() };
    match act(started) {
        Ok(()) => OK,
        Err(code) => code,
    }
}
