//! UF2 files, read back and put through a model of the RP2040's boot ROM.

use super::uf2::file as uf2_file;
use super::*;
use std::collections::BTreeSet;

/// The golden blob of 7,304 bytes.
const BLOB: &[u8] = include_bytes!("../../../../data/golden/stereo-v3-fast.rays");
const FLASH_START: u32 = 0x1000_0000;
/// 2 MiB, and what stood there before.
static USED_FLASH: [u8; 2 << 20] = [0x5a; 2 << 20];

fn word(block: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(block[at..at + 4].try_into().unwrap())
}

fn to(base_address: u32, family: &str) -> Uf2 {
    Uf2 {
        base_address,
        family: Some(family.parse().unwrap()),
        absolute_block: false,
    }
}

/// What the boot ROM of an RP2040 makes of a file, block by block: it leaves blocks without its family
/// alone, erases the sector of a block's ADDRESS when the first of the 16 blocks of a sector's worth of
/// NUMBERS comes, and programming clears bits.
fn flash_of_rp2040(file: &[u8]) -> Vec<u8> {
    const SECTOR: usize = 4096;
    let mut flash = USED_FLASH.to_vec();
    let mut erased = BTreeSet::new();
    for block in file.chunks(UF2_BLOCK_LEN) {
        if word(block, 8) & 0x2000 == 0 || word(block, 28) != 0xe48b_ff56 {
            continue;
        }
        let place = (word(block, 12) - FLASH_START) as usize;
        if erased.insert(word(block, 20) as usize * 256 / SECTOR) {
            let sector = place / SECTOR * SECTOR;
            flash[sector..sector + SECTOR].fill(0xff);
        }
        for (stored, byte) in flash[place..].iter_mut().zip(&block[32..288]) {
            *stored &= byte;
        }
    }
    flash
}

/// How many bytes of the blob do not stand where they should.
fn wrong(flash: &[u8], address: u32) -> usize {
    let stored = &flash[(address - FLASH_START) as usize..];
    BLOB.iter().zip(stored).filter(|(a, b)| a != b).count()
}

/// A file in pages of 256 bytes at any page, as for bootloaders that erase by address.
fn in_pages(base_address: u32) -> Vec<u8> {
    let elsewhere = Uf2 {
        base_address: base_address + 0x1000_0000,
        family: Some(Family(17)),
        absolute_block: false,
    };
    let mut file = uf2_file(BLOB, &elsewhere).unwrap();
    for block in file.chunks_mut(UF2_BLOCK_LEN) {
        let address = word(block, 12) - 0x1000_0000;
        block[12..16].copy_from_slice(&address.to_le_bytes());
        block[28..32].copy_from_slice(&0xe48b_ff56_u32.to_le_bytes());
    }
    file
}

#[test]
fn the_boot_rom_of_an_rp2040_writes_the_whole_blob_and_nothing_else() {
    for address in [0x1010_0000, 0x1010_1000, 0x101f_e000] {
        let file = uf2_file(BLOB, &to(address, "rp2040")).unwrap();
        assert_eq!(file.len(), 32 * UF2_BLOCK_LEN);
        let flash = flash_of_rp2040(&file);
        assert_eq!(wrong(&flash, address), 0, "{address:#x}");
        let start = (address - FLASH_START) as usize;
        let sectors = start..start + 8192;
        assert!(
            flash[start + BLOB.len()..sectors.end]
                .iter()
                .all(|byte| *byte == 0xff)
        );
        assert!(
            flash[..start]
                .iter()
                .chain(&flash[sectors.end..])
                .all(|byte| *byte == 0x5a)
        );
    }
}

#[test]
fn the_model_of_the_boot_rom_sees_what_pages_do_and_export_refuses_them() {
    for (address, expected) in [(0x1010_0000, 0), (0x1010_0100, 256), (0x1010_0800, 2953)] {
        assert_eq!(
            wrong(&flash_of_rp2040(&in_pages(address)), address),
            expected
        );
        if expected > 0 {
            let refused = ExportError::NotASector {
                address,
                below: 0x1010_0000,
                above: 0x1010_1000,
            };
            assert_eq!(uf2_file(BLOB, &to(address, "rp2040")), Err(refused));
        }
    }
    // Another family's blocks change nothing.
    let other = uf2_file(BLOB, &to(0x1010_0000, "rp2350-arm-s")).unwrap();
    assert_eq!(flash_of_rp2040(&other), USED_FLASH);
}

#[test]
fn every_block_says_where_it_goes() {
    for (address, family, pages) in [
        (0x1010_0000, Some("rp2350-riscv"), 32),
        (0x0002_7000, Some("nrf52840"), 29),
        (0x0800_0100, None, 29),
    ] {
        let family: Option<Family> = family.map(|name| name.parse().unwrap());
        let uf2 = Uf2 {
            base_address: address,
            family,
            absolute_block: false,
        };
        let file = uf2_file(BLOB, &uf2).unwrap();
        assert_eq!(file.len(), pages * UF2_BLOCK_LEN);
        assert_eq!(uf2_filled_len(BLOB.len(), family), pages * 256);
        let mut memory: Vec<u8> = Vec::new();
        for (number, block) in file.chunks(UF2_BLOCK_LEN).enumerate() {
            assert_eq!(block[..8], *b"UF2\n\x57\x51\x5d\x9e");
            assert_eq!(word(block, 508), 0x0ab1_6f30);
            assert_eq!(word(block, 8), if family.is_some() { 0x2000 } else { 0 });
            assert_eq!(word(block, 12) as usize, address as usize + memory.len());
            let expected = (256, number as u32, pages as u32);
            assert_eq!(
                (word(block, 16), word(block, 20), word(block, 24)),
                expected
            );
            assert_eq!(word(block, 28), family.map_or(0, |family| family.0));
            memory.extend(&block[32..288]);
            assert!(block[288..508].iter().all(|byte| *byte == 0));
        }
        assert_eq!(memory[..BLOB.len()], *BLOB);
        assert!(memory[BLOB.len()..].iter().all(|byte| *byte == 0xff));
    }
}

#[test]
fn the_absolute_block_goes_first_and_is_ignored_by_those_that_know_its_tag() {
    let plain = to(0x1010_0000, "rp2350-arm-s");
    let first = Uf2 {
        absolute_block: true,
        ..plain
    };
    let file = uf2_file(BLOB, &first).unwrap();
    let (block, rest) = file.split_at(UF2_BLOCK_LEN);
    assert_eq!(rest, uf2_file(BLOB, &plain).unwrap());
    let head = [0xa000, 0x10ff_ff00, 256, 0, 2, 0xe48b_ff57];
    assert_eq!([8, 12, 16, 20, 24, 28].map(|at| word(block, at)), head);
    assert!(block[32..288].iter().all(|byte| *byte == 0xef));
    assert_eq!(word(block, 288), 0x9957_e304);
    assert!(block[292..508].iter().all(|byte| *byte == 0));
    assert_eq!(word(block, 508), 0x0ab1_6f30);
}

#[test]
fn what_the_bootloader_would_not_write_is_refused() {
    let refused = |uf2: Uf2| uf2_file(BLOB, &uf2).unwrap_err();
    let nameless = |base_address| Uf2 {
        base_address,
        family: None,
        absolute_block: false,
    };
    let address = 0x1010_0000;
    assert_eq!(
        refused(nameless(address)),
        ExportError::NoFamily { address }
    );
    let misaligned = |address| ExportError::Misaligned {
        address,
        multiple: 256,
    };
    assert_eq!(refused(nameless(0x0800_0008)), misaligned(0x0800_0008));
    assert_eq!(refused(to(0x0002_7080, "nrf52")), misaligned(0x0002_7080));
    let too_high = ExportError::TooHigh {
        address: 0xffff_f000,
        length: 7424,
    };
    assert_eq!(refused(nameless(0xffff_f000)), too_high);
    for (address, family, end) in [
        (0x0800_0000, "rp2040", 0x1100_0000),
        (0x10ff_f000, "rp2040", 0x1100_0000),
        (0x11ff_f000, "data", 0x1200_0000),
        (0x2000_0000, "rp2350-arm-s", 0x1200_0000),
    ] {
        let expected = ExportError::NotInFlash {
            address,
            length: 8192,
            family: family.parse().unwrap(),
            end,
        };
        assert_eq!(refused(to(address, family)), expected);
    }
    let with_block = |uf2: Uf2| {
        refused(Uf2 {
            absolute_block: true,
            ..uf2
        })
    };
    for uf2 in [
        to(address, "rp2040"),
        to(0x2000, "samd21"),
        nameless(0x2000),
    ] {
        assert_eq!(with_block(uf2), ExportError::NeedlessAbsoluteBlock);
    }
    let covered = ExportError::OnAbsoluteBlock {
        address: 0x10ff_ff00,
    };
    assert_eq!(with_block(to(0x10ff_e000, "rp2350-arm-s")), covered);
}
