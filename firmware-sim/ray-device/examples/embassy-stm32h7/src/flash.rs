//! The two slots: the last sectors of bank 2 of an STM32H743, 128 KiB each, programmed in units of 32 bytes.
//!
//! Log and blob share a sector, so two sectors are enough. The program runs from bank 1, which can be read while bank 2 is
//! erased for up to two seconds; interrupts go on meanwhile.
//!
//! The unsafe code is three things: the view of a slot in memory, the volatile reads behind [`checked_read`], and the fault mask.
#![allow(unsafe_code)]

use core::cell::RefCell;

use cortex_m::peripheral::SCB;
use embassy_stm32::Peri;
use embassy_stm32::flash::{Blocking, Error, FLASH_BASE, Flash as Driver, WRITE_SIZE};
use embassy_stm32::pac;
use embassy_stm32::peripherals::FLASH;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use ray_device::port::{Flash, MappedFlash};
use static_cell::StaticCell;

const SECTOR: u32 = 128 << 10;
/// Of each slot, from the start of the flash.
const STARTS: [u32; 2] = [14 * SECTOR, 15 * SECTOR];

/// The driver, which both slots use in turn.
type Shared = RefCell<Driver<'static, Blocking>>;

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
            Some(end) if end <= SECTOR => Ok(self.start + offset),
            _ => Err(NorFlashErrorKind::OutOfBounds),
        }
    }
}

/// Copies flash. Some bytes may belong to a word that a cut of power left half-programmed, which the chip cannot correct: reading
/// it is a bus fault, which is masked here and told as an error.
fn checked_read(start: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
    const IGNORE_BUS_FAULTS: u32 = 1 << 8;
    let bank = pac::FLASH.bank(1);
    critical_section_of_faults(|| {
        bank.ccr().write(|w| w.set_clr_dbeccerr(true));
        // SAFETY: CCR of the system control block, word-aligned; BFHFNMIGN alone changes, and only while faults are masked.
        let ccr = unsafe { &(*SCB::PTR).ccr };
        unsafe { ccr.modify(|value| value | IGNORE_BUS_FAULTS) };
        cortex_m::asm::dsb();
        for (place, address) in bytes.iter_mut().zip(start..) {
            // SAFETY: within the flash of the chip, says the caller's check; any bytes are valid.
            *place = unsafe { (address as *const u8).read_volatile() };
        }
        cortex_m::asm::dsb();
        unsafe { ccr.modify(|value| value & !IGNORE_BUS_FAULTS) };
        if bank.sr().read().dbeccerr() {
            bank.ccr().write(|w| w.set_clr_dbeccerr(true));
            return Err(NorFlashErrorKind::Other);
        }
        Ok(())
    })
}

/// Runs with all faults masked: FAULTMASK, which raises the priority to that of a hard fault.
fn critical_section_of_faults<T>(work: impl FnOnce() -> T) -> T {
    // SAFETY: sets FAULTMASK, and clears it again below; `work` neither returns early nor unwinds, as panics halt.
    unsafe { core::arch::asm!("cpsid f", options(nomem, nostack, preserves_flags)) };
    let result = work();
    unsafe { core::arch::asm!("cpsie f", options(nomem, nostack, preserves_flags)) };
    result
}

fn kind(error: Error) -> NorFlashErrorKind {
    match error {
        Error::Unaligned => NorFlashErrorKind::NotAligned,
        Error::Size => NorFlashErrorKind::OutOfBounds,
        _ => NorFlashErrorKind::Other,
    }
}

impl ErrorType for Slot {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Slot {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let address = self.address(offset, bytes.len() as u32)?;
        checked_read(FLASH_BASE as u32 + address, bytes)
    }

    fn capacity(&self) -> usize {
        SECTOR as usize
    }
}

impl NorFlash for Slot {
    const WRITE_SIZE: usize = WRITE_SIZE;
    const ERASE_SIZE: usize = SECTOR as usize;

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
        // not while this is borrowed. The data cache is off after a reset and this program leaves it off; with it on, `erase` and
        // `write` must invalidate what they changed.
        Some(unsafe { core::slice::from_raw_parts(address as *const u8, length as usize) })
    }
}
