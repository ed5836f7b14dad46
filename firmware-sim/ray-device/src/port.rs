//! What the application needs from the machine it runs on: a byte stream, flash, and a clock.
//!
//! A board implements these with a UART, memory-mapped flash and a timer; a test with whatever it likes.
//!
//! # What a flash driver owes
//! The storage keeps a blob through any cut of power if the driver keeps these. None of it can be checked by the compiler.
//!
//! - **A read that fails is an `Err`, never a fault and never garbage that reads as good.** On parts with ECC, a
//!   word that was being programmed or erased when power went raises an interrupt or a fault when it is read; on some, a
//!   blank word does. Every start reads both logs, so a driver that merely copies faults at *every* start from
//!   then on. How to catch it stands below.
//! - **`mapped` is looked at only after `read` took the same bytes without an error** in the same life of the
//!   device. Whoever implements [`MappedFlash`] touches the memory in no other way either: no prefetching copy, no
//!   checksum unit or DMA over a whole slot.
//! - **Caches.** `write` and `erase` return when the flash is done, and when no data cache, prefetch buffer or flash
//!   accelerator holds what stood there before: invalidate the range (i.MX RT, STM32H7 and F7: D-cache by address;
//!   STM32F4, L4, G4: reset the flash's data cache; ESP32, RP2040 and RP2350: the XIP cache; MCX: the LPCAC).
//! - **Nobody reads a chip that cannot be read while it is written**: not this region, not another region of the
//!   same chip or bank, not the second core, no interrupt handler, no DMA. The borrow checker guards one region, not
//!   the chip. On RP2040, RP2350 and ESP32 park the other core, mask interrupts, and run from RAM; on one-bank parts
//!   of STM32 the core stalls by itself; on dual-bank parts put both slots into the bank that the code is not in.
//! - **Memory-mapped mode** (QSPI, OSPI, XSPI, FlexSPI): the driver leaves it for `write` and `erase`, and has entered
//!   it again when they return, with the same mapping. A reset while it was left must find the chip in a mode that the boot
//!   ROM can read.
//! - **Long erases.** A sector of 128 KiB takes up to seconds. [`Clock::step`] is called before each block, never
//!   inside one: the watchdog's time must be longer than one `erase` of one block, or the driver feeds it while it waits.
//! - **Units are programmed once between two erases.** A driver that pads a shorter write to its page by reading
//!   and programming again breaks that: give its page as `WRITE_SIZE`, or write part of it where the chip allows.
//! - **In order.** `write` and `erase` have been carried out when they return; no queue, no write-back.
//!
//! ## ECC faults on a Cortex-M
//! Sketches after the vendors' reference manuals, not run on silicon; registers differ from part to part.
//!
//! STM32L4, L5, G4, WB, U5 (`FLASH_ECCR`) and H5 (`FLASH_ECCDETR`): a double error raises the NMI. The handler notes
//! it and clears the flag, the load goes on with whatever it got, and the driver looks afterwards:
//! ```text
//! static IS_UNREADABLE: AtomicBool = AtomicBool::new(false);
//!
//! #[exception]
//! unsafe fn NonMaskableInt() {
//!     if FLASH.eccr().read().eccd() {                  // bit 31: two wrong bits; written 1, it is cleared
//!         FLASH.eccr().modify(|bits| bits.set_eccd(true));
//!         IS_UNREADABLE.store(true, Relaxed);
//!     } else {
//!         reset();                                     // the clock security system, or a pin: not ours
//!     }
//! }
//!
//! fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
//!     IS_UNREADABLE.store(false, Relaxed);
//!     copy_volatile(self.start + offset, bytes);
//!     dsb();                                           // the NMI has been taken by now
//!     if IS_UNREADABLE.load(Relaxed) { Err(Error::Ecc) } else { Ok(()) }
//! }
//! ```
//! STM32H7: the load itself gives a bus fault. Copy at the priority of a hard fault, with bus faults ignored, and ask
//! the flash afterwards (or copy by DMA, which gets a transfer error in place of a fault):
//! ```text
//! fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
//!     critical_section(|| {
//!         FLASH.ccr().write(|bits| bits.set_clr_dbeccerr(true));
//!         faultmask::set();                            // priority -1
//!         SCB.ccr.modify(|ccr| ccr | BFHFNMIGN);       // data bus faults are ignored there
//!         dsb(); isb();
//!         copy_volatile(self.start + offset, bytes);
//!         dsb();
//!         SCB.ccr.modify(|ccr| ccr & !BFHFNMIGN);
//!         faultmask::clear();
//!         SCB.cfsr.write(BUS_FAULTS);                  // written 1, they are cleared
//!         if FLASH.sr().read().dbeccerr() { Err(Error::Ecc) } else { Ok(()) }
//!     })
//! }
//! ```
//! With the D-cache on, invalidate the range first, else the cache answers for the flash. LPC55: ask the flash
//! controller (margin check) for blank and unreadable words before the load, in `read` and in [`Flash::is_blank`].

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
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
    #[inline]
    fn geometry(&self) -> Geometry {
        Geometry::of::<Self>()
    }

    /// Whether none of these bytes has been programmed since they were erased; both numbers are multiples of
    /// 8 and of the unit. A part on which blank words cannot be read, or read as anything, has a command for
    /// this; the others compare.
    ///
    /// # Errors
    /// If that cannot be told: the bytes then count as programmed.
    #[inline(always)]
    fn is_blank(&mut self, start: u32, length: u32) -> Result<bool, Self::Error> {
        reads_as_erased(self, start, length)
    }

    /// Where the region starts in the device's flash, for messages.
    #[inline]
    fn start(&self) -> u32 {
        0
    }
}

/// Whether these bytes read as erased: [`Flash::is_blank`] of a part whose blank words can be read.
///
/// # Errors
/// If the driver cannot read them.
#[inline(never)]
pub fn reads_as_erased<R: Flash + ?Sized>(
    flash: &mut R,
    start: u32,
    length: u32,
) -> Result<bool, R::Error> {
    let erased = flash.geometry().erased;
    let end = start.saturating_add(length);
    let mut at = start;
    let mut piece = [0; 64];
    while at < end {
        let wanted = (end - at).min(piece.len() as u32);
        let Some(piece) = piece.get_mut(..wanted as usize) else {
            break;
        };
        flash.read(at, piece)?;
        if piece.iter().any(|&byte| byte != erased) {
            return Ok(false);
        }
        at = at.saturating_add(wanted);
    }
    Ok(true)
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

    /// Called during long steps, for a watchdog: before each block that is erased, before each
    /// line that is programmed, and at least once every 4096 bytes that are read.
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
