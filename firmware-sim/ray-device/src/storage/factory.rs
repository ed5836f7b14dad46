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
