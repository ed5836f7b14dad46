//! Drivers of a simulated flash: of its regions, and of its slots.

use std::cell::RefCell;
use std::thread;
use std::time::Duration;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use ray_device::port::{Flash, Geometry, MappedFlash};
use ray_device::storage::slot::SlotFlash;

use super::chip::{Change, Chip};
use super::effort::Work;
use super::error::SimFlashError;
use super::rules::Blank;

/// A part of a simulated flash.
#[derive(Debug)]
pub struct SimRegion<'a> {
    bytes: &'a mut [u8],
    start: usize,
    geometry: Geometry,
    chip: &'a RefCell<Chip>,
}

impl<'a> SimRegion<'a> {
    pub(super) fn new(
        bytes: &'a mut [u8],
        start: usize,
        geometry: Geometry,
        chip: &'a RefCell<Chip>,
    ) -> Self {
        Self {
            bytes,
            start,
            geometry,
            chip,
        }
    }

    /// The bytes from `from` to `to`, both multiples of `step`.
    fn check(&self, from: u32, to: u32, step: u32) -> Result<(), SimFlashError> {
        if from > to || to as usize > self.bytes.len() {
            Err(SimFlashError::OutOfBounds)
        } else if !from.is_multiple_of(step) || !to.is_multiple_of(step) {
            Err(SimFlashError::NotAligned)
        } else {
            Ok(())
        }
    }
}

impl Flash for SimRegion<'_> {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn is_blank(&mut self, start: u32, length: u32) -> Result<bool, SimFlashError> {
        self.check(start, start + length, self.geometry.unit)?;
        let mut chip = self.chip.borrow_mut();
        if chip.rules.blank != Blank::Erased {
            return Ok(chip.is_blank(self.start + start as usize, length as usize));
        }
        drop(chip);
        let erased = self.geometry.erased;
        let mut bytes = [0; 64];
        for at in (start..start + length).step_by(64) {
            let piece = &mut bytes[..64.min(start + length - at) as usize];
            self.read(at, piece)?;
            if piece.iter().any(|&byte| byte != erased) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn start(&self) -> u32 {
        self.start as u32
    }
}

impl MappedFlash for SimRegion<'_> {
    fn mapped(&self, start: u32, length: u32) -> Option<&[u8]> {
        let address = self.start + start as usize;
        self.chip.borrow_mut().note_look(address, length as usize);
        self.bytes.get(start as usize..)?.get(..length as usize)
    }
}

impl ErrorType for SimRegion<'_> {
    type Error = SimFlashError;
}

impl ReadNorFlash for SimRegion<'_> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), SimFlashError> {
        let mut chip = self.chip.borrow_mut();
        if !chip.has_power {
            return Err(SimFlashError::PowerOff);
        }
        let start = offset as usize;
        let stored = self
            .bytes
            .get(start..start.saturating_add(bytes.len()))
            .ok_or(SimFlashError::OutOfBounds)?;
        chip.effort.note(Work::Read, bytes.len() as u64);
        if chip.load(stored, self.start + start, bytes) {
            Ok(())
        } else {
            Err(SimFlashError::Unreadable)
        }
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

/// The rules are known when it is made, and stand in its geometry; its constants are the least of them.
impl NorFlash for SimRegion<'_> {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = Geometry::MIN_BLOCK as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), SimFlashError> {
        let Geometry {
            block,
            erased,
            needs_erase,
            ..
        } = self.geometry;
        self.check(from, to, block)?;
        if !needs_erase {
            return Err(SimFlashError::Broken);
        }
        for at in (from as usize..to as usize).step_by(block as usize) {
            let mut chip = self.chip.borrow_mut();
            let address = self.start + at;
            chip.effort.note(Work::Erase, 1);
            chip.note_wear(address, block);
            let place = &mut self.bytes[at..at + block as usize];
            let wanted = vec![erased; block as usize];
            chip.change(Change::Erase, address, place, &wanted)?;
            if chip.rules.stall_ms > 0 {
                thread::sleep(Duration::from_millis(chip.rules.stall_ms.into()));
            }
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), SimFlashError> {
        let unit = self.geometry.unit as usize;
        let end = offset.saturating_add(bytes.len() as u32);
        self.check(offset, end, self.geometry.unit)?;
        for (at, wanted) in (offset as usize..).step_by(unit).zip(bytes.chunks(unit)) {
            let mut chip = self.chip.borrow_mut();
            let address = self.start + at;
            let place = &mut self.bytes[at..at + unit];
            if self.geometry.needs_erase && chip.is_programmed(address / unit) {
                return Err(SimFlashError::NotErased);
            }
            chip.effort.note(Work::Program, unit as u64);
            chip.change(Change::Program, address, place, wanted)?;
        }
        Ok(())
    }
}

/// A slot of a simulated flash, with its log in the same region or in one of its own.
#[derive(Debug)]
pub struct SimSlot<'a> {
    /// The log's region, if it has one of its own.
    pub log: Option<SimRegion<'a>>,
    /// The blob's.
    pub blob: SimRegion<'a>,
}

impl<'a> SlotFlash for SimSlot<'a> {
    type Log = SimRegion<'a>;
    type Blob = SimRegion<'a>;

    fn log_apart(&self) -> Option<&SimRegion<'a>> {
        self.log.as_ref()
    }

    fn log(&mut self) -> &mut SimRegion<'a> {
        self.log.as_mut().unwrap_or(&mut self.blob)
    }

    fn blob(&self) -> &SimRegion<'a> {
        &self.blob
    }

    fn blob_to_write(&mut self) -> &mut SimRegion<'a> {
        &mut self.blob
    }
}
