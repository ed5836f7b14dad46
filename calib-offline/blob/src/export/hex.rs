//! Intel HEX: lines `:LLAAAATTDD...CC` of a length, the low half of an address, a type, data and a
//! checksum, all in hexadecimal digits.

use std::fmt::Write;

/// Bytes of data in a record.
const RECORD_LEN: usize = 16;
const DATA: u8 = 0;
const END_OF_FILE: u8 = 1;
/// The upper half of the addresses that follow.
const EXTENDED_LINEAR_ADDRESS: u8 = 4;

/// The file of pieces, each with its address, in ascending order; every end must have an address.
pub(super) fn file(pieces: &[(u32, &[u8])]) -> Vec<u8> {
    let mut text = String::new();
    let mut last_half = None;
    for (start, bytes) in pieces {
        let (mut address, mut rest) = (*start, *bytes);
        while !rest.is_empty() {
            let half = (address >> 16) as u16;
            if last_half != Some(half) {
                record(&mut text, 0, EXTENDED_LINEAR_ADDRESS, &half.to_be_bytes());
                last_half = Some(half);
            }
            // A record's address has 16 bits: none goes beyond the border of a half.
            let to_border = 0x1_0000 - (address & 0xffff) as usize;
            let (data, after) = rest.split_at(rest.len().min(RECORD_LEN).min(to_border));
            record(&mut text, address as u16, DATA, data);
            rest = after;
            // Wraps only where nothing follows.
            address = address.wrapping_add(data.len() as u32);
        }
    }
    record(&mut text, 0, END_OF_FILE, &[]);
    text.into_bytes()
}

fn record(text: &mut String, address: u16, kind: u8, data: &[u8]) {
    let [high, low] = address.to_be_bytes();
    let head = [data.len() as u8, high, low, kind];
    let sum = head
        .iter()
        .chain(data)
        .fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    text.push(':');
    for byte in head.iter().chain(data).chain(&[sum.wrapping_neg()]) {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02X}");
    }
    text.push('\n');
}
