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

/// What a flash is programmed and erased in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// Bytes that are programmed at once, each unit once between two erases: a power of two, at most
    /// [`Geometry::MAX_UNIT`].
    pub unit: u32,
    /// Bytes that are erased at once: a power of two, no less than a unit and than [`Geometry::MIN_BLOCK`].
    pub block: u32,
    /// What every byte of an erased block reads as, where it can be read.
    pub erased: u8,
    /// Whether a unit must be erased before it is programmed once more.
    pub needs_erase: bool,
}

impl Geometry {
    /// Longest program unit, bytes.
    pub const MAX_UNIT: u32 = 512;
    /// Shortest erase block, bytes.
    pub const MIN_BLOCK: u32 = 64;

    /// What the driver's constants say.
    pub const fn of<R: Flash + ?Sized>() -> Self {
        Self {
            unit: R::WRITE_SIZE as u32,
            block: R::ERASE_SIZE as u32,
            erased: R::ERASED,
            needs_erase: R::NEEDS_ERASE,
        }
    }

    /// What is programmed in one go here, bytes: a unit, and no less than 8.
    pub const fn line(self) -> u32 {
        if self.unit < 8 { 8 } else { self.unit }
    }

    /// Whether the storage can work with it.
    pub const fn is_supported(self) -> bool {
        self.unit.is_power_of_two()
            && self.unit <= Self::MAX_UNIT
            && self.block.is_power_of_two()
            && self.block >= self.unit
            && self.block >= Self::MIN_BLOCK
    }
}

/// A part of the flash of its own, programmed and read through a driver.
///
/// Addresses count from the start of the region.
pub trait Flash: NorFlash {
    /// What every byte of an erased block reads as: 0x00 on some parts.
    const ERASED: u8 = 0xff;

    /// Whether a unit must be erased before it is programmed once more. Without the need (RRAM, MRAM,
    /// FRAM) nothing is ever erased.
    const NEEDS_ERASE: bool = true;

    /// What it is programmed and erased in. A driver that finds it out when it starts, such as one that asks
    /// a chip on a bus, says so here; its constants then are the least of what it may find.
    #[inline(always)]
    fn geometry(&self) -> Geometry {
        Geometry::of::<Self>()
    }

    /// Whether none of these bytes has been programmed since they were erased; both numbers are multiples of
    /// 8 and of the unit. A part on which blank words cannot be read, or read as anything, has a command for
    /// this; the others compare.
    ///
    /// # Errors
    /// If that cannot be told: the bytes then count as programmed.
    #[inline(never)]
    fn is_blank(&mut self, start: u32, length: u32) -> Result<bool, Self::Error> {
        let erased = self.geometry().erased;
        let end = start.saturating_add(length);
        let mut at = start;
        let mut piece = [0; 64];
        while at < end {
            let wanted = (end - at).min(piece.len() as u32);
            let Some(piece) = piece.get_mut(..wanted as usize) else {
                break;
            };
            self.read(at, piece)?;
            if piece.iter().any(|&byte| byte != erased) {
                return Ok(false);
            }
            at = at.saturating_add(wanted);
        }
        Ok(true)
    }

    /// Where the region starts in the device's flash, for messages.
    #[inline(always)]
    fn start(&self) -> u32 {
        0
    }
}

/// Flash that can also be read like memory.
///
/// Whoever borrows [`MappedFlash::mapped`] keeps the region from being written: that is how the blob in use
/// stays untouched while another is stored.
pub trait MappedFlash: Flash {
    /// `length` bytes from `start` on, a multiple of 8; the address that they come to stand at is a
    /// multiple of 8, too. `None` beyond the end.
    ///
    /// The storage asks only for bytes that it programmed and has read through the driver, without an error,
    /// since the device started.
    fn mapped(&self, start: u32, length: u32) -> Option<&[u8]>;
}

/// The flash of a device: what it was made with, and two slots.
#[derive(Debug)]
pub struct Regions<S, F = S> {
    /// What the device was made with, never written by the application: a region with a factory record,
    /// or any other [`Factory`](crate::storage::factory::Factory).
    pub factory: F,
    /// The slots: a [`MappedFlash`] each, or a [`SplitSlot`](crate::storage::slot::SplitSlot).
    pub slots: [S; 2],
}

/// Time since the device started.
pub trait Clock {
    /// Milliseconds since the device started.
    fn uptime_ms(&mut self) -> u64;

    /// Called during long steps, for a watchdog: before each block that is erased, at least once every
    /// 256 bytes that are programmed and every 4096 that are read.
    fn step(&mut self) {}
}

/// For whoever writes a flash outside of a device: no time and no watchdog.
#[derive(Clone, Copy, Debug)]
pub struct NoClock;

impl Clock for NoClock {
    fn uptime_ms(&mut self) -> u64 {
        0
    }
}
