//! Varints of the metadata that take more bytes than they need are read, the same on every target; those that hold
//! more than their type are refused.

use crate::document::{Read, golden, read};
use crate::test_blob::{AlignedBytes, repair_checksum};
use ray_runtime::format::{HEADER_LEN, Header, RECORD_LEN, aligned};
use ray_runtime::{OpenError, RayBlob};
use std::path::{Path, PathBuf};

/// Offsets of varints from the start of the metadata, whose texts are all shorter than 128 bytes.
struct Varints {
    identity_length: usize,
    frame_length: usize,
    pixel_convention: usize,
    self_test_count: usize,
}

fn varints(blob: &[u8]) -> Varints {
    let meta = &blob[HEADER_LEN..];
    let frame_length = 1 + usize::from(meta[0]);
    let written_by = frame_length + 1 + usize::from(meta[frame_length]);
    let pixel_convention = written_by + 1 + usize::from(meta[written_by]);
    Varints {
        identity_length: 0,
        frame_length,
        pixel_convention,
        // Behind two enumerations and two numbers.
        self_test_count: pixel_convention + 2 + 8,
    }
}

/// The blob with the one-byte varint at `at` in its metadata written otherwise, and all that follows from that.
fn rewritten(blob: &[u8], at: usize, varint: &[u8]) -> Vec<u8> {
    let (_, mut header) = Header::read(blob).unwrap();
    let meta_end = HEADER_LEN + header.meta_len as usize;
    let records = aligned(meta_end);
    let at = HEADER_LEN + at;
    let mut meta = blob[HEADER_LEN..meta_end].to_vec();
    meta.splice(at - HEADER_LEN..=at - HEADER_LEN, varint.iter().copied());
    let moved = aligned(HEADER_LEN + meta.len()) - records;
    header.meta_len = meta.len() as u32;
    header.total_len += moved as u32;
    let mut bytes = header.to_bytes().to_vec();
    bytes.extend(meta);
    bytes.resize(records + moved, 0);
    bytes.extend(&blob[records..]);
    for camera in 0..usize::from(header.camera_count) {
        for word in [5, 6] {
            let place = records + moved + camera * RECORD_LEN + 4 * word;
            let offset = u32::from_le_bytes(bytes[place..place + 4].try_into().unwrap());
            bytes[place..place + 4].copy_from_slice(&(offset + moved as u32).to_le_bytes());
        }
    }
    repair_checksum(&mut bytes);
    bytes
}

/// A varint of `digits` bytes for a number below 128.
fn longer(number: u8, digits: usize) -> Vec<u8> {
    let mut varint = vec![0x80; digits];
    varint[0] |= number;
    varint[digits - 1] &= 0x7f;
    varint
}

#[test]
fn longer_varints_than_needed_are_read_as_the_document_says() {
    let mut copies: Vec<PathBuf> = Vec::new();
    for path in golden() {
        let blob = std::fs::read(&path).unwrap();
        let at = varints(&blob);
        for (place, most) in [
            (at.identity_length, 5),
            (at.frame_length, 5),
            (at.pixel_convention, 5),
            (at.self_test_count, 3),
        ] {
            for digits in 2..=most {
                let varint = longer(blob[HEADER_LEN + place], digits);
                let bytes = AlignedBytes::new(&rewritten(&blob, place, &varint));
                let opened = RayBlob::open(bytes.bytes()).unwrap();
                opened.run_self_tests().unwrap();
                if digits == most {
                    let name = path.file_name().unwrap().to_str().unwrap();
                    let copy = format!("varint-{place}-{name}");
                    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join(copy);
                    std::fs::write(&copy, bytes.bytes()).unwrap();
                    copies.push(copy);
                }
            }
        }
    }
    for (path, Read { code, said, .. }) in copies.iter().zip(read("read_blob.py", &copies)) {
        assert_eq!(code, 0, "{}: {said}", path.display());
    }
}

#[test]
fn a_varint_beyond_its_type_is_refused() {
    for path in golden() {
        let blob = std::fs::read(&path).unwrap();
        let at = varints(&blob);
        let last_digit = |digits, last| {
            move |number| {
                let mut varint = longer(number, digits);
                varint[digits - 1] |= last;
                varint
            }
        };
        for (place, digits, last) in [
            // A sixth byte would still fit the length that a host has.
            (at.identity_length, 6, 0),
            (at.identity_length, 5, 0x10),
            (at.frame_length, 6, 0),
            (at.frame_length, 5, 0x10),
            (at.pixel_convention, 6, 0),
            (at.self_test_count, 4, 0),
            (at.self_test_count, 3, 0x04),
        ] {
            let varint = last_digit(digits, last)(blob[HEADER_LEN + place]);
            let bytes = AlignedBytes::new(&rewritten(&blob, place, &varint));
            let found = RayBlob::open(bytes.bytes()).err();
            assert_eq!(found, Some(OpenError::BadMeta), "{varint:x?}");
        }
    }
}
