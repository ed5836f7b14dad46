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
mod contents;
mod decide;
pub mod factory;
mod factory_blob;
pub mod layout;
pub mod log;
pub mod record;
pub mod rig;
pub mod slot;
mod supported;
pub mod transfer;
pub mod trust;

pub use crate::protocol::OTHER_PART;
pub use contents::{
    blob_bytes, manifest_bytes, open_of, open_verified, program_blob, program_manifest, read_blob,
    stored_checksum, verify,
};
pub use decide::{Booted, boot, trusted};
pub use factory_blob::{FACTORY, NO_BLOB, factory_blob, open_factory, usable_factory};
pub use supported::require_supported;
