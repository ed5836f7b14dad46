//! NOR flash with the rules of real parts, and with their failures: for the simulated device and for
//! tests.
//!
//! - Erasing sets a whole block of 4096 bytes; programming takes whole units of 8 bytes that are
//!   blank, each once; anything else is an error. Every erase of a block is counted.
//! - Power can be lost at any operation and any byte of it. From then on every operation fails until
//!   [`SimFlash::power_up`]. What was not finished is left as it was ([`Cut::Clean`]), with some of
//!   its bits changed ([`Cut::Torn`]), or with bits that read differently each time ([`Cut::Weak`]).
//! - Blocks can fail to be erased, units to be programmed, and bits can flip at rest.
//!
//! The driver's reads of weak bits differ each time: sometimes all of a unit read as if the operation
//! had not begun, sometimes as if it had ended, often each as it happens. The mapping shows one value of it from one
//! power-up to the next: a blob in place cannot change under its reader, and the storage never puts
//! a blob in use on such bits.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_write,
};

use ray_device::port::{Flash, Geometry, MappedFlash, Regions};
use ray_device::storage::layout::Layout;
use split_mix::SplitMix;

/// Length of an erase block, bytes.
pub const BLOCK: usize = 4096;

/// Length of a program unit, bytes.
pub const UNIT: usize = 8;

/// What a cut of power leaves of the operation it hits. All bytes before the cut are done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// The rest as it was.
    Clean,
    /// In the rest, some of the bits changed.
    Torn,
    /// In the rest, the bits that were to change read differently each time.
    Weak,
}

/// When power is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PowerCut {
    /// Number of the operation from now, from 0: each block erased and each unit programmed is one.
    pub operation: u64,
    /// How many of its bytes are done; all of them or more for a cut right behind it.
    pub byte: usize,
    /// What is left of the others.
    pub cut: Cut,
}

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

/// A simulated flash.
#[derive(Debug)]
pub struct SimFlash {
    /// Words, because the runtime asks for a blob on a multiple of 8.
    words: Vec<u64>,
    layout: Layout,
    chip: RefCell<Chip>,
}

/// What is not the contents.
#[derive(Debug)]
struct Chip {
    random: SplitMix,
    cut: Option<PowerCut>,
    has_power: bool,
    operations: u64,
    wear: Vec<u32>,
    /// Bits that read differently each time, by unit.
    weak: BTreeMap<usize, Weak>,
    broken_blocks: BTreeSet<usize>,
    broken_units: BTreeSet<usize>,
    file: Option<File>,
}

/// A unit that reads differently each time.
#[derive(Clone, Copy, Debug, Default)]
struct Weak {
    /// What stood there before.
    before: u64,
    /// The bits that waver.
    mask: u64,
}

impl Weak {
    fn read(self, random: &mut SplitMix) -> u64 {
        let changed = match random.next() % 4 {
            0 => 0,
            1 => u64::MAX,
            _ => random.next(),
        };
        self.before ^ (changed & self.mask)
    }
}

/// What becomes of an operation.
enum Power {
    Stays,
    Lost { done: usize, cut: Cut },
}

impl SimFlash {
    /// A blank one of so many blocks, at least five; `seed` is that of what chance decides.
    pub fn blank(blocks: usize, seed: u64) -> Option<Self> {
        Self::with_contents(&vec![0xff; blocks * BLOCK], seed)
    }

    /// One that holds `contents`, a whole number of blocks.
    pub fn with_contents(contents: &[u8], seed: u64) -> Option<Self> {
        if !contents.len().is_multiple_of(BLOCK) {
            return None;
        }
        let layout = Layout::of(
            u32::try_from(contents.len()).ok()?,
            Geometry::of::<SimRegion<'_>>(),
        )?;
        let mut words = vec![0; contents.len() / UNIT];
        bytemuck::cast_slice_mut(&mut words).copy_from_slice(contents);
        let chip = Chip {
            random: SplitMix(seed),
            cut: None,
            has_power: true,
            operations: 0,
            wear: vec![0; contents.len() / BLOCK],
            weak: BTreeMap::new(),
            broken_blocks: BTreeSet::new(),
            broken_units: BTreeSet::new(),
            file: None,
        };
        Some(Self {
            words,
            layout,
            chip: RefCell::new(chip),
        })
    }

    /// Writes every later change through to `file`, which holds the same contents, before the
    /// operation ends.
    pub fn write_through(&mut self, file: File) {
        self.chip.get_mut().file = Some(file);
    }

    /// Where its regions are.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// All bytes, as the mapping shows them.
    pub fn contents(&self) -> &[u8] {
        bytemuck::cast_slice(&self.words)
    }

    /// How often each block was erased.
    pub fn wear(&mut self) -> &[u32] {
        &self.chip.get_mut().wear
    }

    /// Operations since the last power-up: blocks erased and units programmed.
    pub fn operations(&mut self) -> u64 {
        self.chip.get_mut().operations
    }

    /// Whether there is power.
    pub fn has_power(&mut self) -> bool {
        self.chip.get_mut().has_power
    }

    /// Lets power be lost, counted from the last power-up.
    pub fn plan_cut(&mut self, cut: Option<PowerCut>) {
        self.chip.get_mut().cut = cut;
    }

    /// Power is back. A cut that was planned and did not come is forgotten.
    pub fn power_up(&mut self) {
        let chip = self.chip.get_mut();
        chip.has_power = true;
        chip.cut = None;
        chip.operations = 0;
        for (&unit, weak) in &chip.weak {
            if let Some(word) = self.words.get_mut(unit) {
                *word = weak.read(&mut chip.random);
            }
        }
    }

    /// Flips a bit at rest.
    pub fn flip(&mut self, address: usize, bit: u32) {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut self.words);
        if let Some(byte) = bytes.get_mut(address) {
            *byte ^= 1 << (bit % 8);
        }
    }

    /// From now on the block at this address cannot be erased.
    pub fn break_block(&mut self, address: usize) {
        self.chip.get_mut().broken_blocks.insert(address / BLOCK);
    }

    /// From now on the unit at this address cannot be programmed.
    pub fn break_unit(&mut self, address: usize) {
        self.chip.get_mut().broken_units.insert(address / UNIT);
    }

    /// Everything works again.
    pub fn repair(&mut self) {
        let chip = self.chip.get_mut();
        chip.broken_blocks.clear();
        chip.broken_units.clear();
    }

    /// Its regions, each with a driver of its own.
    pub fn regions(&mut self) -> Regions<SimRegion<'_>> {
        let Layout { factory, slot } = self.layout;
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut self.words);
        // The layout was made for this length.
        let (factory, rest) = bytes.split_at_mut(factory as usize);
        let (slot_0, rest) = rest.split_at_mut(slot as usize);
        let (slot_1, _) = rest.split_at_mut(slot as usize);
        let chip = &self.chip;
        let region = |bytes, start| SimRegion { bytes, start, chip };
        Regions {
            factory: region(factory, 0),
            slots: [
                region(slot_0, self.layout.slot_start(0) as usize),
                region(slot_1, self.layout.slot_start(1) as usize),
            ],
        }
    }
}

/// A part of a simulated flash.
#[derive(Debug)]
pub struct SimRegion<'a> {
    bytes: &'a mut [u8],
    start: usize,
    chip: &'a RefCell<Chip>,
}

impl Flash for SimRegion<'_> {
    fn start(&self) -> u32 {
        self.start as u32
    }
}

impl MappedFlash for SimRegion<'_> {
    fn mapped(&self, start: u32, length: u32) -> Option<&[u8]> {
        self.bytes.get(start as usize..)?.get(..length as usize)
    }
}

impl ErrorType for SimRegion<'_> {
    type Error = SimFlashError;
}

impl From<NorFlashErrorKind> for SimFlashError {
    fn from(kind: NorFlashErrorKind) -> Self {
        match kind {
            NorFlashErrorKind::NotAligned => Self::NotAligned,
            _ => Self::OutOfBounds,
        }
    }
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
        bytes.copy_from_slice(stored);
        if chip.weak.is_empty() {
            return Ok(());
        }
        let from = self.start + start;
        let units = from / UNIT..=(from + bytes.len()) / UNIT;
        let weak: Vec<(usize, Weak)> = chip.weak.range(units).map(|(&u, &w)| (u, w)).collect();
        for (unit, weak) in weak {
            let read = weak.read(&mut chip.random).to_le_bytes();
            for (address, byte) in (unit * UNIT..).zip(read) {
                if let Some(place) = address.checked_sub(from).and_then(|at| bytes.get_mut(at)) {
                    *place = byte;
                }
            }
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for SimRegion<'_> {
    const WRITE_SIZE: usize = UNIT;
    const ERASE_SIZE: usize = BLOCK;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), SimFlashError> {
        check_erase(self, from, to)?;
        for at in (from as usize..to as usize).step_by(BLOCK) {
            let block = (self.start + at) / BLOCK;
            self.change(at, &[0xff; BLOCK], |chip| {
                if let Some(count) = chip.wear.get_mut(block) {
                    *count += 1;
                }
                !chip.broken_blocks.contains(&block)
            })?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), SimFlashError> {
        check_write(self, offset, bytes.len())?;
        for (at, unit_bytes) in (offset as usize..).step_by(UNIT).zip(bytes.chunks(UNIT)) {
            let unit = (self.start + at) / UNIT;
            let is_blank = self.bytes[at..at + UNIT] == [0xff; UNIT]
                && !self.chip.borrow().weak.contains_key(&unit);
            if !is_blank {
                return Err(SimFlashError::NotErased);
            }
            self.change(at, unit_bytes, |chip| !chip.broken_units.contains(&unit))?;
        }
        Ok(())
    }
}

impl SimRegion<'_> {
    /// One operation: `bytes` come to stand at `at`, unless power is lost or the place is broken.
    fn change(
        &mut self,
        at: usize,
        bytes: &[u8],
        works: impl FnOnce(&mut Chip) -> bool,
    ) -> Result<(), SimFlashError> {
        let mut chip = self.chip.borrow_mut();
        if !chip.has_power {
            return Err(SimFlashError::PowerOff);
        }
        let power = chip.next_operation();
        if !works(&mut chip) {
            return Err(SimFlashError::Broken);
        }
        let address = self.start + at;
        let place = &mut self.bytes[at..at + bytes.len()];
        let done = match power {
            Power::Stays => bytes.len(),
            Power::Lost { done, .. } => done.min(bytes.len()),
        };
        place[..done].copy_from_slice(&bytes[..done]);
        chip.forget_weak(address, done);
        if let Power::Lost { cut, .. } = power {
            chip.spoil(address + done, &mut place[done..], &bytes[done..], cut);
            chip.note_before(address, place);
        }
        chip.write_through(address, place)?;
        match power {
            Power::Stays => Ok(()),
            Power::Lost { .. } => Err(SimFlashError::PowerOff),
        }
    }
}

impl Chip {
    fn next_operation(&mut self) -> Power {
        let number = self.operations;
        self.operations += 1;
        match self.cut {
            Some(PowerCut {
                operation,
                byte,
                cut,
            }) if operation == number => {
                self.has_power = false;
                Power::Lost { done: byte, cut }
            }
            _ => Power::Stays,
        }
    }

    /// What was written over is sound again.
    fn forget_weak(&mut self, address: usize, length: usize) {
        let units = address / UNIT..(address + length) / UNIT;
        let weak: Vec<usize> = self.weak.range(units).map(|(&unit, _)| unit).collect();
        for unit in weak {
            self.weak.remove(&unit);
        }
    }

    /// What is left of the bytes that an operation did not reach: `place`, which starts at `address`.
    fn spoil(&mut self, address: usize, place: &mut [u8], wanted: &[u8], cut: Cut) {
        for (address, (byte, &wanted)) in (address..).zip(place.iter_mut().zip(wanted)) {
            let changing = *byte ^ wanted;
            match cut {
                Cut::Torn => *byte ^= self.random.next() as u8 & changing,
                Cut::Weak if changing != 0 => {
                    let shift = 8 * (address % UNIT);
                    self.weak.entry(address / UNIT).or_default().mask |=
                        u64::from(changing) << shift;
                }
                Cut::Clean | Cut::Weak => {}
            }
        }
    }

    /// Notes what the weak units of a region read as before their bits began to waver.
    fn note_before(&mut self, start: usize, region: &[u8]) {
        let units = start / UNIT..(start + region.len()) / UNIT;
        for (&unit, weak) in self.weak.range_mut(units) {
            let at = unit * UNIT - start;
            if let Some(bytes) = region.get(at..).and_then(|rest| rest.first_chunk()) {
                weak.before = u64::from_le_bytes(*bytes);
            }
        }
    }

    /// In pieces, so that a process that is killed leaves a block half erased.
    fn write_through(&mut self, address: usize, bytes: &[u8]) -> Result<(), SimFlashError> {
        let Some(file) = &mut self.file else {
            return Ok(());
        };
        for (at, piece) in (address..).step_by(512).zip(bytes.chunks(512)) {
            file.seek(SeekFrom::Start(at as u64))
                .and_then(|_| file.write_all(piece))
                .map_err(|_| SimFlashError::File)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
