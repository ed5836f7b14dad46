//! What of a simulated flash is not its contents: power, units that waver or cannot be read, wear.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::sync::Arc;

use split_mix::SplitMix;

use super::effort::Effort;
use super::error::SimFlashError;
use super::power::{Cut, PowerCut};
use super::rules::{Blank, Ecc, Rules};

/// What is not the contents.
#[derive(Debug)]
pub struct Chip {
    pub rules: Rules,
    random: SplitMix,
    pub cut: Option<PowerCut>,
    pub has_power: bool,
    pub operations: u64,
    /// How many bytes each operation since the last power-up was of.
    pub lengths: Vec<usize>,
    /// By the shortest block.
    pub wear: Vec<u32>,
    /// Units that were programmed since they were erased, one bit each.
    pub programmed: Vec<u8>,
    /// Units that read differently each time.
    weak: BTreeMap<usize, Weak>,
    /// Units that their ECC cannot correct.
    bad: BTreeSet<usize>,
    /// By the address of their first byte.
    pub broken_blocks: BTreeSet<usize>,
    pub broken_units: BTreeSet<usize>,
    pub unhandled_faults: u64,
    pub effort: Arc<Effort>,
    file: Option<(File, Option<u64>)>,
}

/// A unit that reads differently each time.
#[derive(Clone, Debug)]
struct Weak {
    /// What stood there before.
    before: Vec<u8>,
    /// The bits that waver.
    mask: Vec<u8>,
}

impl Weak {
    /// What it reads as now, and whether that is all of the old or all of the new.
    fn read(&self, random: &mut SplitMix) -> (Vec<u8>, bool) {
        let kind = random.next() % 4;
        let mut bits = || match kind {
            0 => 0,
            1 => 0xff,
            _ => random.next() as u8,
        };
        let pairs = self.before.iter().zip(&self.mask);
        let bytes = pairs.map(|(before, mask)| before ^ bits() & mask).collect();
        (bytes, kind < 2)
    }
}

/// What becomes of an operation.
enum Power {
    Stays,
    Lost { done: usize, cut: Cut },
}

/// An operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    Erase,
    Program,
}

impl Chip {
    pub fn new(rules: Rules, contents: &[u8], programmed: Option<&[u8]>, seed: u64) -> Self {
        let units = contents.len() / rules.unit as usize;
        let mut bits = vec![0; units.div_ceil(8)];
        match programmed {
            Some(known) => bits.copy_from_slice(&known[..units.div_ceil(8)]),
            None => {
                for (unit, bytes) in contents.chunks(rules.unit as usize).enumerate() {
                    let is_programmed = bytes.iter().any(|&byte| byte != rules.erased);
                    bits[unit / 8] |= u8::from(is_programmed) << (unit % 8);
                }
            }
        }
        let shortest = rules.log_block.unwrap_or(rules.block).min(rules.block);
        Self {
            rules,
            random: SplitMix(seed),
            cut: None,
            has_power: true,
            operations: 0,
            lengths: Vec::new(),
            wear: vec![0; contents.len() / shortest as usize],
            programmed: bits,
            weak: BTreeMap::new(),
            bad: BTreeSet::new(),
            broken_blocks: BTreeSet::new(),
            broken_units: BTreeSet::new(),
            unhandled_faults: 0,
            effort: Arc::default(),
            file: None,
        }
    }

    pub fn copy(&self, seed: u64) -> Self {
        Self {
            rules: self.rules,
            random: SplitMix(seed),
            cut: None,
            has_power: true,
            operations: 0,
            lengths: Vec::new(),
            wear: vec![0; self.wear.len()],
            programmed: self.programmed.clone(),
            weak: self.weak.clone(),
            bad: self.bad.clone(),
            broken_blocks: BTreeSet::new(),
            broken_units: BTreeSet::new(),
            unhandled_faults: 0,
            effort: Arc::default(),
            file: None,
        }
    }

    pub fn write_through_to(&mut self, file: File, programmed_at: Option<u64>) {
        self.file = Some((file, programmed_at));
    }

    pub fn power_up(&mut self, bytes: &mut [u8]) {
        self.has_power = true;
        self.cut = None;
        self.operations = 0;
        self.lengths.clear();
        let length = self.rules.unit as usize;
        for (unit, weak) in &self.weak {
            let (read, _) = weak.read(&mut self.random);
            if let Some(place) = bytes
                .get_mut(unit * length..)
                .and_then(|b| b.get_mut(..length))
            {
                place.copy_from_slice(&read);
            }
        }
    }

    /// Counts an erase of the block of this length.
    pub fn note_wear(&mut self, address: usize, block: u32) {
        if !self.has_power {
            return;
        }
        let shortest = self.rules.log_block.unwrap_or(block).min(self.rules.block) as usize;
        let blocks = address / shortest..(address + block as usize) / shortest;
        for count in self.wear.get_mut(blocks).into_iter().flatten() {
            *count += 1;
        }
    }

    /// A unit whose bits were flipped is no blank one any more.
    pub fn note_flipped(&mut self, address: usize) {
        self.set_programmed(address / self.rules.unit as usize, true);
    }

    pub fn is_programmed(&self, unit: usize) -> bool {
        self.programmed
            .get(unit / 8)
            .is_some_and(|bits| bits >> (unit % 8) & 1 == 1)
    }

    fn set_programmed(&mut self, unit: usize, is_programmed: bool) {
        if let Some(bits) = self.programmed.get_mut(unit / 8) {
            *bits = *bits & !(1 << (unit % 8)) | u8::from(is_programmed) << (unit % 8);
        }
    }

    fn units(&self, address: usize, length: usize) -> std::ops::Range<usize> {
        let unit = self.rules.unit as usize;
        address / unit..(address + length).div_ceil(unit)
    }

    /// What the blank check of the part says of these bytes. Of a unit that wavers, anything.
    pub fn is_blank(&mut self, address: usize, length: usize) -> bool {
        let units = self.units(address, length);
        for unit in units {
            let is_unsound = self.weak.contains_key(&unit) || self.bad.contains(&unit);
            if is_unsound && self.random.next().is_multiple_of(2)
                || !is_unsound && self.is_programmed(unit)
            {
                return false;
            }
        }
        true
    }

    /// Loads bytes that are stored at `address` into `out`; `false` if the load fails, and `out` holds anything.
    pub fn load(&mut self, stored: &[u8], address: usize, out: &mut [u8]) -> bool {
        out.copy_from_slice(stored);
        if self.weak.is_empty() && self.bad.is_empty() && self.rules.blank == Blank::Erased {
            return true;
        }
        let unit_length = self.rules.unit as usize;
        let mut is_read = true;
        for unit in self.units(address, out.len()) {
            let weak = self.weak.get(&unit).cloned();
            let read = if let Some(weak) = weak {
                let (bytes, is_whole) = weak.read(&mut self.random);
                is_read &=
                    self.rules.ecc == Ecc::None || is_whole || self.random.next().is_multiple_of(8);
                bytes
            } else if !self.is_programmed(unit) && self.rules.blank != Blank::Erased {
                is_read &= self.rules.blank == Blank::Undefined;
                (0..unit_length).map(|_| self.random.next() as u8).collect()
            } else {
                is_read &= !self.bad.contains(&unit);
                continue;
            };
            for (at, byte) in (unit * unit_length..).zip(read) {
                if let Some(place) = at.checked_sub(address).and_then(|at| out.get_mut(at)) {
                    *place = byte;
                }
            }
        }
        if !is_read && self.rules.ecc == Ecc::Fault {
            // What a plain copy leaves behind.
            out.fill(0xa5);
        }
        is_read
    }

    /// Somebody looks at these bytes in place.
    pub fn note_look(&mut self, address: usize, length: usize) {
        let has_ecc = self.rules.ecc != Ecc::None;
        if !has_ecc && self.rules.blank == Blank::Erased {
            return;
        }
        let cannot_be_read = |unit| {
            has_ecc && (self.bad.contains(&unit) || self.weak.contains_key(&unit))
                || self.rules.blank != Blank::Erased && !self.is_programmed(unit)
        };
        if self.units(address, length).any(cannot_be_read) {
            self.unhandled_faults += 1;
        }
    }

    /// One operation: `wanted` comes to stand at `place`, unless power is lost or the place is broken.
    pub fn change(
        &mut self,
        change: Change,
        address: usize,
        place: &mut [u8],
        wanted: &[u8],
    ) -> Result<(), SimFlashError> {
        if !self.has_power {
            return Err(SimFlashError::PowerOff);
        }
        let power = self.next_operation();
        self.lengths.push(place.len());
        let unit = address / self.rules.unit as usize;
        let is_broken = match change {
            Change::Erase => self.broken_blocks.contains(&address),
            Change::Program => self.broken_units.contains(&unit),
        };
        if is_broken {
            return Err(SimFlashError::Broken);
        }
        match power {
            Power::Stays => {
                place.copy_from_slice(wanted);
                self.make_all_sound(self.units(address, place.len()), change);
            }
            Power::Lost { done, cut } => self.cut_short(change, address, place, wanted, done, cut),
        }
        self.write_through(address, place)?;
        match power {
            Power::Stays => Ok(()),
            Power::Lost { .. } => Err(SimFlashError::PowerOff),
        }
    }

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

    fn make_all_sound(&mut self, mut units: std::ops::Range<usize>, change: Change) {
        if self.weak.is_empty() && self.bad.is_empty() {
            // Eight at once, where there are so many.
            while units.start.is_multiple_of(8) && units.len() >= 8 {
                if let Some(bits) = self.programmed.get_mut(units.start / 8) {
                    *bits = if change == Change::Program { 0xff } else { 0 };
                }
                units.start += 8;
            }
        }
        for unit in units {
            self.make_sound(unit, change);
        }
    }

    fn make_sound(&mut self, unit: usize, change: Change) {
        self.weak.remove(&unit);
        self.bad.remove(&unit);
        self.set_programmed(unit, change == Change::Program);
    }

    /// Leaves `done` bytes as wanted and spoils the rest, unit by unit.
    fn cut_short(
        &mut self,
        change: Change,
        address: usize,
        place: &mut [u8],
        wanted: &[u8],
        done: usize,
        cut: Cut,
    ) {
        let length = self.rules.unit as usize;
        let pieces = place.chunks_mut(length).zip(wanted.chunks(length));
        for (index, (place, wanted)) in pieces.enumerate() {
            let unit = address / length + index;
            let done = done.saturating_sub(index * length).min(length);
            if done == length {
                place.copy_from_slice(wanted);
                self.make_sound(unit, change);
                continue;
            }
            if done == 0 && cut == Cut::Clean {
                continue;
            }
            let before = place.to_vec();
            let (place_done, place_rest) = place.split_at_mut(done);
            place_done.copy_from_slice(&wanted[..done]);
            if cut == Cut::Torn {
                for (byte, wanted) in place_rest.iter_mut().zip(&wanted[done..]) {
                    *byte ^= self.random.next() as u8 & (*byte ^ wanted);
                }
            }
            let was_sound = !self.weak.contains_key(&unit) && !self.bad.contains(&unit);
            let was_programmed = self.is_programmed(unit);
            self.make_sound(unit, Change::Program);
            let mask: Vec<u8> = place
                .iter()
                .zip(wanted)
                .map(|(now, wanted)| now ^ wanted)
                .collect();
            if cut == Cut::Weak && mask.iter().any(|&bits| bits != 0) {
                let before = place.to_vec();
                self.weak.insert(unit, Weak { before, mask });
            } else if *place == before[..] && was_sound {
                // Nothing happened to it, as it reads.
                self.set_programmed(unit, was_programmed);
            } else if *place != *wanted
                && self.rules.ecc != Ecc::None
                && !self.random.next().is_multiple_of(8)
            {
                self.bad.insert(unit);
            }
        }
    }

    /// In pieces, so that a process that is killed leaves a block half erased.
    fn write_through(&mut self, address: usize, bytes: &[u8]) -> Result<(), SimFlashError> {
        let units = self.units(address, bytes.len());
        let Some((file, programmed_at)) = &mut self.file else {
            return Ok(());
        };
        let mut put = |at: u64, bytes: &[u8]| {
            file.seek(SeekFrom::Start(at))
                .and_then(|_| file.write_all(bytes))
                .map_err(|_| SimFlashError::File)
        };
        if let Some(start) = *programmed_at {
            let (first, end) = (units.start / 8, units.end.div_ceil(8));
            let bits = self.programmed.get(first..end).unwrap_or_default();
            put(start + first as u64, bits)?;
        }
        for (at, piece) in (address..).step_by(512).zip(bytes.chunks(512)) {
            put(at as u64, piece)?;
        }
        Ok(())
    }
}
