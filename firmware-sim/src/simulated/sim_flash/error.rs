//! Why a simulated flash did not do as it was told.

use embedded_storage::nor_flash::{NorFlashError, NorFlashErrorKind};

/// Why the flash did not do as it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SimFlashError {
    /// Outside of the region.
    OutOfBounds,
    /// Not on a boundary of a block or unit.
    NotAligned,
    /// The unit is not blank.
    NotErased,
    /// The block or unit is broken.
    Broken,
    /// There is no power.
    PowerOff,
    /// A word cannot be read: it was spoiled, or it is blank.
    Unreadable,
    /// The file behind it could not be written.
    File,
}

impl NorFlashError for SimFlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            _ => NorFlashErrorKind::Other,
        }
    }
}
