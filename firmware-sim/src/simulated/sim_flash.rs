//! NOR flash with the rules of real parts, and with their failures: for the simulated device and for
//! tests.
//!
//! - Erasing sets a whole block; programming takes whole units that are blank, each once; anything else is an
//!   error. Every erase of a block is counted. [`Rules`] says how long units and blocks are, what erased bytes
//!   read as, and what else differs from part to part.
//! - Power can be lost at any operation and any byte of it. From then on every operation fails until
//!   [`SimFlash::power_up`]. What was not finished is left as it was ([`Cut::Clean`]), with some of
//!   its bits changed ([`Cut::Torn`]), or with bits that read differently each time ([`Cut::Weak`]).
//! - With ECC, a unit that is neither what it was nor what it was to be cannot be read: the driver returns
//!   an error, and a look at it in place is counted as a fault that nobody handles
//!   ([`SimFlash::unhandled_faults`]). One in eight passes its ECC by bad luck and reads as it is.
//! - Blocks can fail to be erased, units to be programmed, and bits can flip at rest.
//!
//! The driver's reads of weak bits differ each time: sometimes all of a unit read as if the operation
//! had not begun, sometimes as if it had ended, often each as it happens. The mapping shows one value of it from one
//! power-up to the next: a blob in place cannot change under its reader, and the storage never puts
//! a blob in use on such bits.

mod chip;
mod effort;
mod error;
mod power;
mod region;
mod rules;

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs::File;
use std::sync::Arc;

use ray_device::port::Regions;

use chip::Chip;
pub use effort::Effort;
pub use error::SimFlashError;
pub use power::{Cut, PowerCut};
pub use region::{SimRegion, SimSlot};
pub use rules::{Areas, BadRules, Blank, Ecc, Rules};

/// Length of an erase block by the default rules, bytes.
pub const BLOCK: usize = 4096;

/// Length of a program unit by the default rules, bytes.
pub const UNIT: usize = 8;

/// A simulated flash.
#[derive(Debug)]
pub struct SimFlash {
    /// Words, because the runtime asks for a blob on a multiple of 8.
    words: Vec<u64>,
    areas: Areas,
    chip: RefCell<Chip>,
}

impl SimFlash {
    /// A blank one of so many blocks by the default rules, at least five; `seed` is that of what chance decides.
    pub fn blank(blocks: usize, seed: u64) -> Option<Self> {
        Self::blank_with(Rules::default(), blocks * BLOCK, seed)
    }

    /// A blank one of so many bytes by these rules.
    pub fn blank_with(rules: Rules, length: usize, seed: u64) -> Option<Self> {
        Self::with(rules, &vec![rules.erased; length], None, seed)
    }

    /// One by the default rules that holds `contents`, a whole number of blocks.
    pub fn with_contents(contents: &[u8], seed: u64) -> Option<Self> {
        Self::with(Rules::default(), contents, None, seed)
    }

    /// One by these rules that holds `contents`, a whole number of blocks. Which units were programmed is told
    /// by `programmed`, one bit each; without it, those that do not read as erased.
    pub fn with(
        rules: Rules,
        contents: &[u8],
        programmed: Option<&[u8]>,
        seed: u64,
    ) -> Option<Self> {
        let areas = rules.areas(contents.len())?;
        let mut words = vec![0; contents.len().div_ceil(8)];
        bytemuck::cast_slice_mut(&mut words)
            .get_mut(..contents.len())?
            .copy_from_slice(contents);
        let chip = Chip::new(rules, contents, programmed, seed);
        Some(Self {
            words,
            areas,
            chip: RefCell::new(chip),
        })
    }

    /// The same flash once more, without the file, the faults and the wear of this one, in power.
    #[must_use]
    pub fn copy(&self, seed: u64) -> Self {
        Self {
            words: self.words.clone(),
            areas: self.areas,
            chip: RefCell::new(self.chip.borrow().copy(seed)),
        }
    }

    /// Writes every later change through to `file`, which holds the same contents from its start on, before the
    /// operation ends; which units are programmed goes to the bits from `programmed_at` on.
    pub fn write_through(&mut self, file: File, programmed_at: Option<u64>) {
        self.chip.get_mut().write_through_to(file, programmed_at);
    }

    /// Its rules.
    pub fn rules(&self) -> Rules {
        self.chip.borrow().rules
    }

    /// Where its regions are.
    pub fn areas(&self) -> Areas {
        self.areas
    }

    /// Where a slot's log starts.
    pub fn log_start(&self, slot: usize) -> usize {
        let Areas { factory, log, .. } = self.areas;
        if log == 0 {
            self.slot_start(slot)
        } else {
            factory + slot * log
        }
    }

    /// Where a slot's region starts.
    pub fn slot_start(&self, slot: usize) -> usize {
        self.areas.slots + slot * self.areas.slot
    }

    /// Where a slot's blob starts.
    pub fn blob_start(&self, slot: usize) -> usize {
        self.slot_start(slot) + self.rules().shape().blob_start() as usize
    }

    /// All bytes, as the mapping shows them.
    pub fn contents(&self) -> &[u8] {
        bytemuck::cast_slice(&self.words)
    }

    /// Which units were programmed, one bit each.
    pub fn programmed(&self) -> Vec<u8> {
        self.chip.borrow().programmed.clone()
    }

    /// How often each block was erased: of the shortest blocks there are.
    pub fn wear(&mut self) -> &[u32] {
        &self.chip.get_mut().wear
    }

    /// Operations since the last power-up: blocks erased and units programmed.
    pub fn operations(&mut self) -> u64 {
        self.chip.get_mut().operations
    }

    /// How many bytes each of them was of.
    pub fn operation_lengths(&mut self) -> &[usize] {
        &self.chip.get_mut().lengths
    }

    /// Looks in place at what could not be read, which would have stopped the device.
    pub fn unhandled_faults(&mut self) -> u64 {
        self.chip.get_mut().unhandled_faults
    }

    /// What was done to it, for the device's clock and for tests.
    pub fn effort(&self) -> Arc<Effort> {
        Arc::clone(&self.chip.borrow().effort)
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
        let bytes = bytemuck::cast_slice_mut(&mut self.words);
        self.chip.get_mut().power_up(bytes);
    }

    /// Flips a bit at rest. ECC, where there is any, would mend it; here it does not.
    pub fn flip(&mut self, address: usize, bit: u32) {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut self.words);
        if let Some(byte) = bytes.get_mut(address) {
            *byte ^= 1 << (bit % 8);
            self.chip.get_mut().note_flipped(address);
        }
    }

    /// From now on the block at this address cannot be erased.
    pub fn break_block(&mut self, address: usize) {
        self.chip.get_mut().broken_blocks.insert(address);
    }

    /// From now on the unit at this address cannot be programmed.
    pub fn break_unit(&mut self, address: usize) {
        let chip = self.chip.get_mut();
        let unit = address / chip.rules.unit as usize;
        chip.broken_units.insert(unit);
    }

    /// Everything works again.
    pub fn repair(&mut self) {
        let chip = self.chip.get_mut();
        chip.broken_blocks = BTreeSet::new();
        chip.broken_units = BTreeSet::new();
    }

    /// Its regions, each with a driver of its own.
    pub fn regions(&mut self) -> Regions<SimSlot<'_>, SimRegion<'_>> {
        let Areas {
            factory,
            log,
            slots,
            slot,
        } = self.areas;
        let rules = self.chip.get_mut().rules;
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut self.words);
        let chip = &self.chip;
        let region = |bytes, start, geometry| SimRegion::new(bytes, start, geometry, chip);
        // The areas were made for this length.
        let (front, rest) = bytes.split_at_mut(slots);
        let (factory_bytes, logs) = front.split_at_mut(factory);
        let (log_0, log_1) = logs.split_at_mut(log);
        let (slot_0, rest) = rest.split_at_mut(slot);
        let (slot_1, _) = rest.split_at_mut(slot);
        let log_region =
            |bytes, start| (log > 0).then(|| region(bytes, start, rules.log_geometry()));
        let (log_1, _) = log_1.split_at_mut(log);
        Regions {
            slots: [
                SimSlot {
                    log: log_region(log_0, factory),
                    blob: region(slot_0, slots, rules.geometry()),
                },
                SimSlot {
                    log: log_region(log_1, factory + log),
                    blob: region(slot_1, slots + slot, rules.geometry()),
                },
            ],
            factory: region(factory_bytes, 0, rules.log_geometry()),
        }
    }
}

#[cfg(test)]
mod tests;
