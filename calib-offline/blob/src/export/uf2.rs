//! UF2: blocks of 512 bytes that each say where their 256 bytes of data go, so that a bootloader can
//! take them in any order.

/// Bytes of a block.
pub const BLOCK_LEN: usize = 512;
/// Bytes of data in a block, and what its address is a multiple of: a page of flash.
pub(super) const PAYLOAD_LEN: usize = 256;

const FIRST_MAGIC: u32 = 0x0a32_4655;
const SECOND_MAGIC: u32 = 0x9e5d_5157;
const LAST_MAGIC: u32 = 0x0ab1_6f30;
const FLAG_FAMILY: u32 = 0x2000;
/// What follows the blob in its last page: erased flash.
const ERASED: u8 = 0xff;

/// The file; the end of the blob's last page must have an address.
pub(super) fn file(blob: &[u8], base_address: u32, family: Option<u32>) -> Vec<u8> {
    let pages = blob.chunks(PAYLOAD_LEN);
    let count = pages.len() as u32;
    let mut bytes = Vec::with_capacity(pages.len() * BLOCK_LEN);
    for (number, page) in (0u32..).zip(pages) {
        let start = bytes.len();
        let head = [
            FIRST_MAGIC,
            SECOND_MAGIC,
            family.map_or(0, |_| FLAG_FAMILY),
            base_address + number * PAYLOAD_LEN as u32,
            PAYLOAD_LEN as u32,
            number,
            count,
            family.unwrap_or(0),
        ];
        bytes.extend(head.into_iter().flat_map(u32::to_le_bytes));
        bytes.extend(page);
        bytes.resize(start + 32 + PAYLOAD_LEN, ERASED);
        bytes.resize(start + BLOCK_LEN - 4, 0);
        bytes.extend(LAST_MAGIC.to_le_bytes());
    }
    bytes
}
