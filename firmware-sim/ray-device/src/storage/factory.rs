//! What a device was made with and no update changes: its own cameras, from wherever it keeps them.

use super::rig;
use crate::port::Flash;
use crate::protocol::Rig;

/// What a device was made with.
///
/// A region of [`Flash`] is one, with the record of [`rig::write`] at its start, or blank; so is an
/// `Option<Rig>` that the application made up of what it has: a serial number from OTP or the chip's unique
/// id, names from an EEPROM. A device that is `None` takes blobs for any cameras.
pub trait Factory {
    /// The device's own cameras, if it knows them.
    fn rig(&mut self) -> Option<Rig>;

    /// The blob that the device was made with, on a multiple of 8, if it keeps one where no update reaches: what
    /// is in use while neither slot holds one that can be, and what a rollback goes to when the other slot
    /// holds none. See [`WithBlob`].
    fn blob(&self) -> Option<&[u8]> {
        None
    }
}

/// The number in place of a slot's, in answers, for the factory's blob in use without a record that says so.
pub const FACTORY_SLOT: u8 = 2;

/// Any factory with a blob beside it: linked into the image, in a section of its own, or in flash that is
/// mapped and that nothing but the production line writes.
#[derive(Clone, Copy, Debug)]
pub struct WithBlob<'b, F> {
    /// What else the device was made with.
    pub factory: F,
    /// The blob and nothing behind it, on a multiple of 8 ([`ray_runtime::Aligned`]).
    pub blob: &'b [u8],
}

impl<F: Factory> Factory for WithBlob<'_, F> {
    fn rig(&mut self) -> Option<Rig> {
        self.factory.rig()
    }

    fn blob(&self) -> Option<&[u8]> {
        Some(self.blob)
    }
}

impl<R: Flash> Factory for R {
    fn rig(&mut self) -> Option<Rig> {
        rig::read(self)
    }
}

impl Factory for Option<Rig> {
    fn rig(&mut self) -> Option<Rig> {
        self.clone()
    }
}
