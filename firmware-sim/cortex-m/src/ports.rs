//! The application's ports on this board.

use core::convert::Infallible;

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_write,
};
use ray_device::port::{Clock, Flash, Geometry, Link, MappedFlash, Regions};
use ray_device::storage::layout::Layout;

use crate::machine;

/// The UART. The line has no notion of closing, so reading never returns 0 bytes.
#[derive(Debug)]
pub struct Uart(());

impl Uart {
    /// Switches it on.
    pub fn start() -> Self {
        machine::uart_start();
        Self(())
    }
}

impl Link for Uart {
    type Error = Infallible;

    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let mut count = 0;
        while count == 0 {
            for place in buffer.iter_mut() {
                let Some(byte) = machine::uart_receive() else {
                    break;
                };
                *place = byte;
                count += 1;
            }
            if count == 0 {
                machine::uart_wait();
            }
        }
        Ok(count)
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), Infallible> {
        for &byte in bytes {
            machine::uart_send(byte);
        }
        Ok(())
    }
}

/// Length of an erase block, bytes.
const BLOCK: usize = 4096;

/// Length of a program unit, bytes.
const UNIT: usize = 8;

/// The regions of the flash; `None` if they were handed out before.
pub fn flash_regions() -> Option<Regions<FlashRegion>> {
    let layout = const { Layout::of(machine::FLASH_LENGTH as u32, Geometry::of::<FlashRegion>()) }?;
    let (factory, rest) =
        machine::flash_to_write()?.split_at_mut_checked(layout.factory as usize)?;
    let (slot_0, rest) = rest.split_at_mut_checked(layout.slot as usize)?;
    let (slot_1, _) = rest.split_at_mut_checked(layout.slot as usize)?;
    Some(Regions {
        factory: FlashRegion(factory),
        slots: [FlashRegion(slot_0), FlashRegion(slot_1)],
    })
}

/// A part of the memory-mapped flash, with the rules of NOR flash: the board's memory would take
/// anything.
#[derive(Debug)]
pub struct FlashRegion(&'static mut [u8]);

impl ErrorType for FlashRegion {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for FlashRegion {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let start = offset as usize;
        let stored = self
            .0
            .get(start..start.saturating_add(bytes.len()))
            .ok_or(NorFlashErrorKind::OutOfBounds)?;
        for (byte, &stored) in bytes.iter_mut().zip(stored) {
            *byte = stored;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for FlashRegion {
    const WRITE_SIZE: usize = UNIT;
    const ERASE_SIZE: usize = BLOCK;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let place = self.0.get_mut(from as usize..to as usize);
        let place = place.ok_or(NorFlashErrorKind::OutOfBounds)?;
        machine::write_flash(place, core::iter::repeat(0xff));
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        let start = offset as usize;
        let place = self.0.get_mut(start..start.saturating_add(bytes.len()));
        let place = place.ok_or(NorFlashErrorKind::OutOfBounds)?;
        if place.iter().any(|&byte| byte != 0xff) {
            return Err(NorFlashErrorKind::Other);
        }
        machine::write_flash(place, bytes.iter().copied());
        Ok(())
    }
}

impl Flash for FlashRegion {
    fn start(&self) -> u32 {
        self.0.as_ptr().addr().saturating_sub(machine::FLASH_START) as u32
    }
}

impl MappedFlash for FlashRegion {
    fn mapped(&self, start: u32, length: u32) -> Option<&[u8]> {
        self.0.get(start as usize..)?.get(..length as usize)
    }
}

/// The board's timer as the device's clock. It counts on across the timer's wrap as long as it is
/// read at least once in 12 hours.
#[derive(Debug)]
pub struct Timer {
    last_ticks: u32,
    total_ticks: u64,
}

impl Timer {
    /// Starts it at zero.
    pub fn start() -> Self {
        machine::timer_start();
        Self {
            last_ticks: machine::timer_ticks(),
            total_ticks: 0,
        }
    }
}

impl Clock for Timer {
    fn uptime_ms(&mut self) -> u64 {
        let ticks = machine::timer_ticks();
        self.total_ticks += u64::from(ticks.wrapping_sub(self.last_ticks));
        self.last_ticks = ticks;
        self.total_ticks * 32 / u64::from(machine::TIMER_TICKS_IN_32_MS)
    }
}
