//! The blob that a device was made with, beside its slots.

use ray_runtime::{OpenError, RayBlob};

use super::factory::FACTORY_SLOT;
use super::trust::Trust;
use crate::frame::checksum;
use crate::protocol::{Claims, StoredBlob};

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
    RayBlob::open_with_crc_of_all(bytes, checksum(bytes))
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
        checksum: checksum(bytes),
        identity: *blob.identity(),
        version: 0,
    })
}

/// The factory's blob, if the owner has not ruled it out: it came with the device, as its firmware did, and counts
/// as version 0.
pub fn usable_factory(factory: Option<&[u8]>, trust: Trust, claims: Claims) -> Option<&[u8]> {
    factory.filter(|_| !trust.needs_signature() || claims.check_factory().is_ok())
}
