//! What stands behind a slot's log: its blob and its manifest, read, verified, opened in place, and programmed.

use ray_runtime::{OpenError, RayBlob};

use super::access::{self, checksum, erase, program};
use super::factory_blob::open_factory;
use super::layout::aligned;
use super::record::Record;
use super::slot::SlotFlash;
use crate::port::{Clock, Flash, MappedFlash};
use crate::protocol::Refusal;

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
