//! What the application needs from the machine it runs on: a byte stream, flash, and a clock.
//!
//! A board implements these with a UART, memory-mapped flash and a timer; a test with whatever it likes.

use embedded_storage::nor_flash::NorFlash;

/// A byte stream to the other side, reliable or not.
pub trait Link {
    /// Why the stream broke.
    type Error;

    /// Waits until something arrives and returns how many bytes of `buffer` were filled; 0 only
    /// when the other side has closed the stream.
    ///
    /// # Errors
    /// If the stream broke.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error>;

    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// If the stream broke.
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), Self::Error>;
}

/// Bytes of flash that are programmed at once. A flash whose own unit is smaller takes them, too.
pub const UNIT: usize = 8;

/// A part of the flash of its own: NOR flash that is programmed through a driver and read like
/// memory.
///
/// Addresses count from the start of the region. Whoever borrows [`MappedFlash::mapped`] keeps the
/// region from being written: that is how the blob in use stays untouched while another is stored.
pub trait MappedFlash: NorFlash {
    /// All of the region, on an address that is a multiple of 8.
    fn mapped(&self) -> &[u8];
}

/// The flash of a device: the factory record's block and the two slots.
#[derive(Debug)]
pub struct Regions<R> {
    /// One erase block: what the device knows of its own cameras. Never written by the application.
    pub factory: R,
    /// The slots, of the same size.
    pub slots: [R; 2],
}

/// Time since the device started.
pub trait Clock {
    /// Milliseconds since the device started.
    fn uptime_ms(&mut self) -> u64;
}
