//! Where things lie: in a slot, and slots in a flash. All of it can be computed from the part's numbers,
//! on a device at compile time.
//!
//! ```text
//! slot:  log | blob | manifest
//! ```
//! Each starts at a multiple of the [line](Geometry::line). Blocks of up to [`LARGEST_OWN`] bytes: the log has its own, as
//! many as hold [`LEAST_ENTRIES`] entries. Larger ones: it shares the first with the start of the blob. Or it
//! lies in a region of its own, and the blob starts where its region does.

use crate::port::Geometry;

/// Largest blocks that a log has for itself, bytes.
pub const LARGEST_OWN: u32 = 16 << 10;

/// Fewest entries of a log.
pub const LEAST_ENTRIES: u32 = 16;

/// Entries of a log in a block that it shares, unless they would fill more than a quarter of it.
const SHARED_ENTRIES: u32 = 256;

/// Length of a record, bytes; it is padded to whole lines.
pub const RECORD_LENGTH: u32 = 48;

/// `address`, or the next one above it that is a multiple of `line`, a power of two.
pub const fn aligned(address: u32, line: u32) -> u32 {
    let mask = line.saturating_sub(1);
    address.saturating_add(mask) & !mask
}

/// What a slot looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Of the flash with the log.
    pub log: Geometry,
    /// Of the flash with the blob.
    pub blob: Geometry,
    /// Whether the log lies in a region of its own.
    pub is_log_apart: bool,
}

impl Shape {
    /// Of a slot in one region.
    pub const fn of(geometry: Geometry) -> Self {
        Self {
            log: geometry,
            blob: geometry,
            is_log_apart: false,
        }
    }

    /// Whether the log shares its block with the start of the blob.
    pub const fn is_log_shared(self) -> bool {
        !self.is_log_apart && self.log.block > LARGEST_OWN
    }

    /// Bytes of a record, padded to whole lines: where its seal starts in the entry.
    pub const fn record_length(self) -> u32 {
        aligned(RECORD_LENGTH, self.log.line())
    }

    /// Bytes of an entry of the log: a record and its seal, and what makes that a power of two.
    pub const fn entry_length(self) -> u32 {
        let least = self.record_length().saturating_add(self.log.line());
        match least.checked_next_power_of_two() {
            Some(length) => length,
            None => least,
        }
    }

    /// Bytes of the log.
    pub const fn log_length(self) -> u32 {
        let least = self.entry_length().saturating_mul(LEAST_ENTRIES);
        if !self.is_log_shared() {
            return aligned(least, self.log.block);
        }
        let wanted = self.entry_length().saturating_mul(SHARED_ENTRIES);
        let quarter = self.log.block / 4;
        let length = if wanted < quarter { wanted } else { quarter };
        if length < least { least } else { length }
    }

    /// How many entries the log has.
    pub const fn entries(self) -> u32 {
        match self.log_length().checked_div(self.entry_length()) {
            Some(entries) => entries,
            None => 0,
        }
    }

    /// Where the blob starts in its region.
    pub const fn blob_start(self) -> u32 {
        if self.is_log_apart {
            0
        } else {
            self.log_length()
        }
    }

    /// Where the manifest starts that stands behind a blob of this length.
    pub const fn manifest_start(self, blob_length: u32) -> u32 {
        aligned(
            self.blob_start().saturating_add(blob_length),
            self.blob.line(),
        )
    }

    /// Longest blob, with a manifest of this length, in a region of so many bytes.
    pub const fn max_blob(self, region: u32, manifest_length: u32) -> u32 {
        let line = self.blob.line();
        let room = region.saturating_sub(self.blob_start());
        room.saturating_sub(aligned(manifest_length, line)) & !line.saturating_sub(1)
    }

    /// Fewest bytes of a slot's region: the log, and a block or what is left of its block.
    pub const fn least_region(self) -> u32 {
        aligned(self.blob_start().saturating_add(1), self.blob.block)
    }

    /// Whether the storage can work with it.
    pub const fn is_supported(self) -> bool {
        self.log.is_supported()
            && self.blob.is_supported()
            && (!self.is_log_shared() || self.log_length() < self.blob.block)
    }
}

/// Where the regions of one flash start and how long they are, bytes from its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Length of the factory's region.
    pub factory: u32,
    /// Length of a slot.
    pub slot: u32,
}

impl Layout {
    /// For a flash of `capacity` bytes: one block for the factory record, and half of the rest for each
    /// slot. `None` if that is too little for a slot, or the storage cannot work with such a flash.
    pub const fn of(capacity: u32, geometry: Geometry) -> Option<Self> {
        let shape = Shape::of(geometry);
        if !shape.is_supported() {
            return None;
        }
        let block = geometry.block;
        let Some(blocks) = (capacity / block).checked_sub(1) else {
            return None;
        };
        let slot = blocks / 2 * block;
        if slot < shape.least_region() {
            return None;
        }
        Some(Self {
            factory: block,
            slot,
        })
    }

    /// Where a slot starts.
    pub const fn slot_start(self, slot: usize) -> u32 {
        match slot {
            0 => self.factory,
            _ => self.factory + self.slot,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(unit: u32, block: u32) -> Shape {
        Shape::of(Geometry {
            unit,
            block,
            erased: 0xff,
            needs_erase: true,
        })
    }

    /// Unit and block; entry, log and start of the blob.
    #[test]
    fn entries_and_logs_of_real_parts() {
        for (unit, block, entry, log) in [
            (4, 4096, 64, 4096),
            (8, 2048, 64, 2048),
            (1, 4096, 64, 4096),
            (4, 64, 64, 1024),
            (4, 128, 64, 1024),
            (16, 8192, 64, 8192),
            (32, 131_072, 128, 32_768),
            (4, 131_072, 64, 16_384),
            (64, 4096, 128, 4096),
            (128, 8192, 256, 8192),
            (256, 4096, 512, 8192),
            (512, 512, 1024, 16_384),
            (512, 131_072, 1024, 32_768),
        ] {
            let shape = shape(unit, block);
            assert!(shape.is_supported());
            assert_eq!(shape.entry_length(), entry, "{unit} / {block}");
            assert_eq!(shape.log_length(), log, "{unit} / {block}");
            assert_eq!(shape.blob_start(), log);
            assert!(shape.entries() >= LEAST_ENTRIES);
            // The seal has a line of its own.
            assert!(shape.record_length() + shape.log.line() <= entry);
            assert!(shape.record_length().is_multiple_of(shape.log.line()));
            assert!(shape.blob_start().is_multiple_of(shape.blob.line()));
        }
    }

    #[test]
    fn flash_that_is_too_short_or_odd_has_no_layout() {
        let of = |capacity, unit, block| Layout::of(capacity, shape(unit, block).blob);
        assert_eq!(of(4 * 4096, 8, 4096), None);
        assert_eq!(
            of(5 * 4096, 8, 4096),
            Some(Layout {
                factory: 4096,
                slot: 8192
            })
        );
        // Three sectors are enough where the log shares its block.
        assert!(of(3 << 17, 32, 1 << 17).is_some());
        assert_eq!(of(2 << 17, 32, 1 << 17), None);
        for (unit, block) in [
            (0, 4096),
            (24, 4096),
            (1024, 4096),
            (8, 0),
            (8, 1000),
            (8, 32),
        ] {
            assert_eq!(of(1 << 20, unit, block), None, "{unit} / {block}");
        }
    }

    #[test]
    fn a_manifest_takes_whole_lines_from_the_longest_blob() {
        let shape = shape(32, 4096);
        assert_eq!(shape.max_blob(8192, 0), 4096);
        assert_eq!(shape.max_blob(8192, 1), 4064);
        assert_eq!(shape.max_blob(8192, 33), 4032);
        assert_eq!(shape.max_blob(4000, 0), 0);
        assert_eq!(shape.manifest_start(100), 4096 + 128);
    }
}
