//! Every form read back, by readers of their own.

use super::*;
use std::collections::BTreeMap;

/// 200,008 bytes, so that HEX crosses borders of 64 KiB.
fn blob() -> Vec<u8> {
    (0..200_008u32).map(|k| (k * 37 + k / 256) as u8).collect()
}

/// The memory that an Intel HEX file describes; every line is checked.
fn memory_of_hex(file: &[u8]) -> BTreeMap<u32, u8> {
    let text = std::str::from_utf8(file).unwrap();
    let mut memory = BTreeMap::new();
    let (mut upper, mut ended) = (None, false);
    for line in text.lines() {
        assert!(!ended, "a line behind the end of the file");
        let digits = line.strip_prefix(':').unwrap();
        let bytes: Vec<u8> = (0..digits.len() / 2)
            .map(|k| u8::from_str_radix(&digits[2 * k..2 * k + 2], 16).unwrap())
            .collect();
        let sum = bytes.iter().map(|byte| u32::from(*byte)).sum::<u32>();
        assert_eq!(sum % 256, 0, "{line}");
        let data = &bytes[4..bytes.len() - 1];
        assert_eq!(usize::from(bytes[0]), data.len());
        let address = u32::from(bytes[1]) << 8 | u32::from(bytes[2]);
        match bytes[3] {
            0 => {
                assert!(data.len() <= 16 && address as usize + data.len() <= 0x1_0000);
                let first = upper.unwrap() + address;
                for (at, byte) in (first..=u32::MAX).zip(data) {
                    assert_eq!(memory.insert(at, *byte), None);
                }
            }
            1 => ended = line == ":00000001FF",
            4 => upper = Some(u32::from(data[0]) << 24 | u32::from(data[1]) << 16),
            kind => panic!("record of type {kind}"),
        }
    }
    assert!(ended);
    memory
}

#[test]
fn a_hex_record_is_what_a_hand_computes() {
    let form = Form::Hex {
        base_address: 0x1010_0000,
    };
    let text = String::from_utf8(file(b"RAYS\x01\x00\x18\x00", &form).unwrap()).unwrap();
    // Sums 2 + 4 + 0x10 + 0x10 = 0x26, and 8 + 0x52 + 0x41 + 0x59 + 0x53 + 1 + 0x18 = 0x160.
    assert_eq!(
        text,
        ":020000041010DA\n:080000005241595301001800A0\n:00000001FF\n"
    );
}

#[test]
fn hex_holds_the_blob_at_its_address() {
    let blob = blob();
    let last = (1u64 << 32) - blob.len() as u64;
    for base_address in [0, 8, 0x0800_fff8, 0x1010_0000, last as u32] {
        let memory = memory_of_hex(&file(&blob, &Form::Hex { base_address }).unwrap());
        assert_eq!(memory.len(), blob.len());
        assert_eq!(memory.keys().next(), Some(&base_address));
        assert!(memory.values().eq(&blob), "{base_address:#x}");
    }
}

#[test]
fn a_c_array_holds_the_blob() {
    let blob = &blob()[..1000];
    let form = Form::C {
        name: "rig_2".to_owned(),
    };
    let text = String::from_utf8(file(blob, &form).unwrap()).unwrap();
    assert!(text.contains("const uint8_t rig_2[1000] __attribute__((aligned(8))) = {"));
    assert!(text.contains("const size_t rig_2_len = 1000;"));
    let (_, numbers) = text.split_once("= {").unwrap();
    let (numbers, _) = numbers.split_once('}').unwrap();
    let bytes = numbers.split(',').filter_map(|number| {
        let digits = number.trim().strip_prefix("0x")?;
        u8::from_str_radix(digits, 16).ok()
    });
    assert!(bytes.eq(blob.iter().copied()));
}

#[test]
fn raw_bytes_are_the_blob() {
    assert_eq!(file(&blob(), &Form::Binary), Ok(blob()));
}

#[test]
fn what_no_device_could_use_is_refused() {
    let blob = blob();
    let hex = |base_address| file(&blob, &Form::Hex { base_address }).err();
    let misaligned = |address, multiple| Some(ExportError::Misaligned { address, multiple });
    assert_eq!(hex(0x0800_0004), misaligned(0x0800_0004, 8));
    let too_high = |address, length| Some(ExportError::TooHigh { address, length });
    assert_eq!(hex(0xffff_0000), too_high(0xffff_0000, 200_008));
    for name in [
        "", "2rig", "my rig", "rig-2", "r\u{f6}", "int", "_rig", "a;b",
    ] {
        let form = Form::C {
            name: name.to_owned(),
        };
        let refused = ExportError::BadName {
            name: name.to_owned(),
        };
        assert_eq!(file(&blob, &form), Err(refused));
    }
}
