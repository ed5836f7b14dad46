//! Which flash the storage works with, decided when a device is compiled.

use crate::port::{Flash, Geometry};

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
