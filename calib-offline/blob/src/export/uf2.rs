//! UF2: blocks of 512 bytes that each say where their 256 bytes of data go, so that a bootloader can
//! take them in any order.
//!
//! The boot ROMs of the RP2040 and the RP2350 do not quite take them in any order: they erase a sector
//! of 4096 bytes when the first block of a run of 16 comes, by the blocks' NUMBERS, and write by
//! their addresses. So for them a file starts where a sector starts and fills its last one. A block
//! that names no family they leave alone.

use super::address::check_address;
use super::error::ExportError;
use super::uf2_family::{ABSOLUTE, Family};

/// Bytes of a block.
pub const BLOCK_LEN: usize = 512;
/// Bytes of data in a block, and what its address is a multiple of: a page of flash.
const PAYLOAD_LEN: usize = 256;
/// What the boot ROMs of Raspberry Pi's parts erase at once, bytes.
const SECTOR_LEN: usize = 4096;
/// Where the flash of Raspberry Pi's parts is mapped: on the RP2040 the first half of it.
const RASPBERRY_PI_FLASH: std::ops::Range<u64> = 0x1000_0000..0x1200_0000;
const RP2040_FLASH: std::ops::Range<u64> = 0x1000_0000..0x1100_0000;

const FIRST_MAGIC: u32 = 0x0a32_4655;
const SECOND_MAGIC: u32 = 0x9e5d_5157;
const LAST_MAGIC: u32 = 0x0ab1_6f30;
const FLAG_FAMILY: u32 = 0x2000;
const FLAG_EXTENSION: u32 = 0x8000;
/// What follows the contents in the last page or sector: erased flash.
const ERASED: u8 = 0xff;

/// Where picotool puts the absolute block: the last page of 16 MiB.
const ABSOLUTE_BLOCK_ADDRESS: u32 = 0x10ff_ff00;
/// Behind its data: boot ROMs that know of extensions leave the block alone.
const IGNORE_BLOCK: u32 = 0x9957_e304;

/// What a UF2 file says besides its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Uf2 {
    /// Where the bytes go in the device's memory: a multiple of 256, of 4096 for parts of Raspberry Pi.
    pub base_address: u32,
    /// The devices that may take it; parts of Raspberry Pi take nothing without.
    pub family: Option<Family>,
    /// Whether a block for a fixed address of the family `absolute` goes first: boot ROMs of RP2350
    /// stepping A2 with a partition table take no file without one (erratum E10).
    pub absolute_block: bool,
}

/// The file of these bytes.
///
/// # Errors
/// [`ExportError`] if the bootloader would not write what the file says.
pub(super) fn file(contents: &[u8], uf2: &Uf2) -> Result<Vec<u8>, ExportError> {
    let pages = filled_len(contents.len(), uf2.family) / PAYLOAD_LEN;
    check(contents.len(), uf2)?;
    let mut bytes = Vec::with_capacity((pages + 1) * BLOCK_LEN);
    if uf2.absolute_block {
        let flags = FLAG_FAMILY | FLAG_EXTENSION;
        let head = [
            flags,
            ABSOLUTE_BLOCK_ADDRESS,
            PAYLOAD_LEN as u32,
            0,
            2,
            ABSOLUTE.0,
        ];
        push_block(
            &mut bytes,
            head,
            &[0xef; PAYLOAD_LEN],
            &IGNORE_BLOCK.to_le_bytes(),
        );
    }
    let flags = uf2.family.map_or(0, |_| FLAG_FAMILY);
    let family = uf2.family.map_or(0, |family| family.0);
    for (number, start) in (0u32..).zip((0..pages).map(|page| page * PAYLOAD_LEN)) {
        let address = uf2.base_address + number * PAYLOAD_LEN as u32;
        let head = [
            flags,
            address,
            PAYLOAD_LEN as u32,
            number,
            pages as u32,
            family,
        ];
        let page = contents.get(start..).unwrap_or_default();
        let page = page.get(..PAYLOAD_LEN).unwrap_or(page);
        push_block(&mut bytes, head, page, &[]);
    }
    Ok(bytes)
}

/// How many bytes the file writes for so many of contents: whole pages, or whole sectors.
pub fn filled_len(length: usize, family: Option<Family>) -> usize {
    length.next_multiple_of(multiple(family))
}

fn multiple(family: Option<Family>) -> usize {
    if family.is_some_and(Family::is_raspberry_pi) {
        SECTOR_LEN
    } else {
        PAYLOAD_LEN
    }
}

fn check(length: usize, uf2: &Uf2) -> Result<(), ExportError> {
    let address = uf2.base_address;
    let filled = filled_len(length, uf2.family);
    let Some(family) = uf2.family else {
        return if RASPBERRY_PI_FLASH.contains(&u64::from(address)) {
            Err(ExportError::NoFamily { address })
        } else if uf2.absolute_block {
            Err(ExportError::NeedlessAbsoluteBlock)
        } else {
            check_address(address, PAYLOAD_LEN as u32, filled)
        };
    };
    if uf2.absolute_block && !family.is_rp2350() {
        return Err(ExportError::NeedlessAbsoluteBlock);
    }
    if family.is_raspberry_pi() {
        let flash = if family.is_rp2350() {
            RASPBERRY_PI_FLASH
        } else {
            RP2040_FLASH
        };
        let end = u64::from(address) + filled as u64;
        if u64::from(address) < flash.start || end > flash.end {
            return Err(ExportError::NotInFlash {
                address,
                length: filled,
                family,
                end: flash.end as u32,
            });
        }
        if !address.is_multiple_of(SECTOR_LEN as u32) {
            return Err(ExportError::NotASector {
                address,
                below: address - address % SECTOR_LEN as u32,
                above: address.next_multiple_of(SECTOR_LEN as u32),
            });
        }
        let covers = u64::from(address)..end;
        if uf2.absolute_block && covers.contains(&u64::from(ABSOLUTE_BLOCK_ADDRESS)) {
            return Err(ExportError::OnAbsoluteBlock {
                address: ABSOLUTE_BLOCK_ADDRESS,
            });
        }
    }
    check_address(address, PAYLOAD_LEN as u32, filled)
}

/// Adds a block of a head without its magic numbers, data that is filled up, and what stands behind it.
fn push_block(bytes: &mut Vec<u8>, head: [u32; 6], data: &[u8], behind: &[u8]) {
    let start = bytes.len();
    let magic = [FIRST_MAGIC, SECOND_MAGIC];
    bytes.extend(magic.into_iter().chain(head).flat_map(u32::to_le_bytes));
    bytes.extend(data);
    bytes.resize(start + 32 + PAYLOAD_LEN, ERASED);
    bytes.extend(behind);
    bytes.resize(start + BLOCK_LEN - 4, 0);
    bytes.extend(LAST_MAGIC.to_le_bytes());
}
