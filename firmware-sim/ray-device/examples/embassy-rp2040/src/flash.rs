//! The two slots: 64 KiB each at the end of the Pico's QSPI flash, in blocks of 4096 bytes.
//!
//! While this flash is erased or programmed it cannot be read, by nobody: the driver runs from RAM with interrupts off and core 1
//! paused for up to 400 ms a block. Whoever measures waits as long; lines come in on the UART's own FIFO of 32 bytes, and what is lost is sent again.
//!
//! The unsafe code is the view of a slot in memory.
#![allow(unsafe_code)]

use core::cell::RefCell;

use embassy_rp::Peri;
use embassy_rp::flash::{Blocking, ERASE_SIZE, Error, FLASH_BASE, Flash as Driver};
use embassy_rp::peripherals::FLASH;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use ray_device::port::{Flash, MappedFlash};
use static_cell::StaticCell;

const FLASH_LENGTH: usize = 2 << 20;
const SLOT: u32 = 64 << 10;
/// Of each slot, from the start of the flash.
const STARTS: [u32; 2] = [FLASH_LENGTH as u32 - 2 * SLOT, FLASH_LENGTH as u32 - SLOT];

/// The driver, which both slots use in turn.
type Shared = RefCell<Driver<'static, FLASH, Blocking, FLASH_LENGTH>>;

/// A slot.
pub struct Slot {
    driver: &'static Shared,
    start: u32,
}

/// Both slots; the peripheral is handed out once.
pub fn slots(flash: Peri<'static, FLASH>) -> [Slot; 2] {
    static DRIVER: StaticCell<Shared> = StaticCell::new();
    let driver: &Shared = DRIVER.init(RefCell::new(Driver::new_blocking(flash)));
    STARTS.map(|start| Slot { driver, start })
}

impl Slot {
    fn address(&self, offset: u32, length: u32) -> Result<u32, NorFlashErrorKind> {
        match offset.checked_add(length) {
            Some(end) if end <= SLOT => Ok(self.start + offset),
            _ => Err(NorFlashErrorKind::OutOfBounds),
        }
    }
}

fn kind(error: Error) -> NorFlashErrorKind {
    match error {
        Error::Unaligned => NorFlashErrorKind::NotAligned,
        Error::OutOfBounds => NorFlashErrorKind::OutOfBounds,
        _ => NorFlashErrorKind::Other,
    }
}

impl ErrorType for Slot {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Slot {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let start = self.address(offset, bytes.len() as u32)?;
        let mut driver = self.driver.borrow_mut();
        driver.blocking_read(start, bytes).map_err(kind)
    }

    fn capacity(&self) -> usize {
        SLOT as usize
    }
}

impl NorFlash for Slot {
    /// The chip takes single bytes; what the driver passes on it fills up to its pages.
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let start = self.address(from, to.saturating_sub(from))?;
        let mut driver = self.driver.borrow_mut();
        driver
            .blocking_erase(start, start + (to - from))
            .map_err(kind)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let start = self.address(offset, bytes.len() as u32)?;
        let mut driver = self.driver.borrow_mut();
        driver.blocking_write(start, bytes).map_err(kind)
    }
}

impl Flash for Slot {
    fn start(&self) -> u32 {
        self.start
    }
}

impl MappedFlash for Slot {
    fn mapped(&self, start: u32, length: u32) -> Option<&[u8]> {
        let address = FLASH_BASE as u32 + self.address(start, length).ok()?;
        // SAFETY: flash of the chip, which nothing else in this program refers to; it is written through `&mut self` alone, so
        // not while this is borrowed. The boot ROM's functions flush the cache in front of it.
        Some(unsafe { core::slice::from_raw_parts(address as *const u8, length as usize) })
    }
}
