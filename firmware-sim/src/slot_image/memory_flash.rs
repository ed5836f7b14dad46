//! Flash in memory with the unit, the block and the erased value of any part, which knows what of it was programmed.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use ray_device::port::{Flash, Geometry, MappedFlash};

/// A region of flash.
#[derive(Debug, Clone)]
pub struct MemoryFlash {
    geometry: Geometry,
    start: u32,
    length: usize,
    /// Words, because the runtime asks for a blob on a multiple of 8.
    words: Vec<u64>,
    /// Of each unit.
    is_programmed: Vec<bool>,
}

impl MemoryFlash {
    /// A blank one, whose start and length are multiples of the block.
    pub fn blank(geometry: Geometry, start: u32, length: u32) -> Self {
        let word = u64::from_ne_bytes([geometry.erased; 8]);
        Self {
            geometry,
            start,
            length: length as usize,
            words: vec![word; (length as usize).div_ceil(8)],
            is_programmed: vec![false; (length / geometry.unit) as usize],
        }
    }

    /// What was programmed, in whole units: offsets and bytes, ascending, none touching the next.
    pub fn programmed(&self) -> Vec<(u32, &[u8])> {
        let unit = self.geometry.unit as usize;
        let mut runs = Vec::new();
        let mut from = 0;
        for run in self.is_programmed.chunk_by(|a, b| a == b) {
            let to = from + run.len() * unit;
            if run.first() == Some(&true) {
                runs.push((from as u32, &self.bytes()[from..to]));
            }
            from = to;
        }
        runs
    }

    /// Puts bytes in at an address, as a flash tool would, those that lie in this region.
    pub fn load(&mut self, address: u32, bytes: &[u8]) {
        let start = self.start;
        for (at, byte) in (address..).zip(bytes) {
            let offset = at.wrapping_sub(start) as usize;
            if let Some(place) = self.bytes_mut().get_mut(offset) {
                *place = *byte;
            }
        }
    }

    fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.length]
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.length]
    }

    /// The place of `length` bytes at `offset`, if both are multiples of `multiple` and they are there.
    fn place(
        &self,
        offset: u32,
        length: usize,
        multiple: u32,
    ) -> Result<std::ops::Range<usize>, NorFlashErrorKind> {
        let (start, multiple) = (offset as usize, multiple as usize);
        let end = start.saturating_add(length);
        if end > self.length {
            return Err(NorFlashErrorKind::OutOfBounds);
        }
        if !(start.is_multiple_of(multiple) && length.is_multiple_of(multiple)) {
            return Err(NorFlashErrorKind::NotAligned);
        }
        Ok(start..end)
    }
}

impl ErrorType for MemoryFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for MemoryFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let place = self.place(offset, bytes.len(), 1)?;
        bytes.copy_from_slice(&self.bytes()[place]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.length
    }
}

impl NorFlash for MemoryFlash {
    // The least of what `geometry` may say.
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = Geometry::MIN_BLOCK as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let length = to.saturating_sub(from) as usize;
        let place = self.place(from, length, self.geometry.block)?;
        let erased = self.geometry.erased;
        let unit = self.geometry.unit as usize;
        self.is_programmed[place.start / unit..place.end / unit].fill(false);
        self.bytes_mut()[place].fill(erased);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let place = self.place(offset, bytes.len(), self.geometry.unit)?;
        let unit = self.geometry.unit as usize;
        let units = place.start / unit..place.end / unit;
        if self.geometry.needs_erase && self.is_programmed[units.clone()].contains(&true) {
            return Err(NorFlashErrorKind::Other);
        }
        self.is_programmed[units].fill(true);
        self.bytes_mut()[place].copy_from_slice(bytes);
        Ok(())
    }
}

impl Flash for MemoryFlash {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn start(&self) -> u32 {
        self.start
    }
}

impl MappedFlash for MemoryFlash {
    fn mapped(&self, start: u32, length: u32) -> Option<&[u8]> {
        let end = start.checked_add(length)?;
        self.bytes().get(start as usize..end as usize)
    }
}
