//! What the application needs from the machine it runs on: a byte stream, the blob in its flash,
//! and a clock.
//!
//! The host implements these with a TCP stream and a file, the Cortex-M image with a UART,
//! memory-mapped flash and a timer.

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

/// Where the blob lies: flash that can be read like memory.
pub trait BlobStore {
    /// The flash from the first byte of the active blob on. What follows the blob is of no account;
    /// flash without a blob is given as it is, and the runtime says what is wrong with it.
    fn active_blob(&self) -> &[u8];
}

/// Time since the device started.
pub trait Clock {
    /// Milliseconds since the device started.
    fn uptime_ms(&mut self) -> u64;
}
