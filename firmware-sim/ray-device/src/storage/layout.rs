//! Where things lie: in a slot, and slots in a flash. All of it can be computed from the part's numbers,
//! on a device at compile time.
//!
//! ```text
//! slot:  log | blob | manifest
//! ```
//! Each starts at a multiple of the [line](Geometry::line). Blocks of up to [`LARGEST_OWN`] bytes: the log has its own, as
//! many as hold [`LEAST_ENTRIES`] entries. Larger ones: it shares the first with the start of the blob, unless
//! [`LEAST_SHARED`] entries would fill more than half of it. Or it lies in a region of its own, and the blob starts
//! where its region does.

use crate::port::Geometry;

/// Largest blocks that a log has for itself, bytes.
pub const LARGEST_OWN: u32 = 16 << 10;

/// Fewest entries of a log.
pub const LEAST_ENTRIES: u32 = 16;

/// Fewest entries of a log in a block that it shares, as it is not erased before the next update: room for 60
/// rollbacks in a row and what starts may add.
pub const LEAST_SHARED: u32 = 72;

/// As many as it has there, unless they would fill more than a quarter of the block.
const SHARED_ENTRIES: u32 = 256;

/// Lines from which on a record alone fits one, bytes. There an entry begins with a mark.
const MARKED_LINE: u32 = 64;

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
        !self.is_log_apart
            && self.log.block > LARGEST_OWN
            && self.entry_length().saturating_mul(LEAST_SHARED) <= self.log.block / 2
    }

    /// Where the record starts in an entry: behind the mark, if there is one.
    pub const fn record_start(self) -> u32 {
        if self.log.line() < MARKED_LINE {
            0
        } else {
            self.log.line()
        }
    }

    /// Where the seal starts in an entry: behind the record, padded to whole lines.
    pub const fn seal_start(self) -> u32 {
        self.record_start()
            .saturating_add(aligned(RECORD_LENGTH, self.log.line()))
    }

    /// Bytes of an entry of the log: mark, record and seal; no less than two of the first layout.
    pub const fn entry_length(self) -> u32 {
        let length = self.seal_start().saturating_add(self.log.line());
        if length < 64 { 64 } else { length }
    }

    /// Bytes of the log.
    pub const fn log_length(self) -> u32 {
        if !self.is_log_shared() {
            let least = self.entry_length().saturating_mul(LEAST_ENTRIES);
            return aligned(least, self.log.block);
        }
        let least = self.entry_length().saturating_mul(LEAST_SHARED);
        let wanted = self.entry_length().saturating_mul(SHARED_ENTRIES);
        let quarter = self.log.block / 4;
        let length = if wanted < quarter { wanted } else { quarter };
        aligned(if length < least { least } else { length }, self.log.line())
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
        self.log.is_supported() && self.blob.is_supported()
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
            (32, 131_072, 96, 24_576),
            (4, 131_072, 64, 16_384),
            (8, 32_768, 64, 8192),
            (64, 4096, 192, 4096),
            (128, 8192, 384, 8192),
            (128, 32_768, 384, 32_768),
            (256, 4096, 768, 12_288),
            (512, 512, 1536, 24_576),
            (512, 262_144, 1536, 110_592),
        ] {
            let shape = shape(unit, block);
            assert!(shape.is_supported());
            assert_eq!(shape.entry_length(), entry, "{unit} / {block}");
            assert_eq!(shape.log_length(), log, "{unit} / {block}");
            assert_eq!(shape.blob_start(), log);
            assert!(shape.entries() >= LEAST_ENTRIES);
            // The seal has a line of its own, and the record is not the first that is programmed, or not alone.
            let line = shape.log.line();
            assert!(shape.seal_start() + line <= entry);
            assert!(shape.seal_start().is_multiple_of(line));
            assert!(shape.seal_start() >= 2 * line);
            assert!(shape.seal_start() - shape.record_start() >= RECORD_LENGTH);
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
