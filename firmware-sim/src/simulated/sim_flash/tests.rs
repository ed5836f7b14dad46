//! The rules of the simulated flash, and its failures.

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};

use super::{BLOCK, Cut, Ecc, PowerCut, Rules, SimFlash, SimFlashError, UNIT};
use ray_device::port::{Flash, MappedFlash};

fn flash() -> SimFlash {
    SimFlash::blank(5, 1).unwrap()
}

fn read(flash: &mut SimFlash, address: u32) -> [u8; UNIT] {
    let slot = &mut flash.regions().slots[0].blob;
    let mut unit = [0; UNIT];
    slot.read(address, &mut unit).unwrap();
    unit
}

#[test]
fn units_are_programmed_whole_in_place_and_once() {
    let mut flash = flash();
    let slot = &mut flash.regions().slots[0].blob;
    let capacity = slot.capacity() as u32;
    assert_eq!(slot.write(4, &[0; 8]), Err(SimFlashError::NotAligned));
    assert_eq!(slot.write(8, &[0; 7]), Err(SimFlashError::NotAligned));
    assert_eq!(
        slot.write(capacity, &[0; 8]),
        Err(SimFlashError::OutOfBounds)
    );
    assert_eq!(slot.write(8, &[5; 16]), Ok(()));
    assert_eq!(
        slot.mapped(0, 25).unwrap()[7..],
        [&[0xff][..], &[5; 16], &[0xff]].concat()
    );
    assert_eq!(slot.write(16, &[5; 8]), Err(SimFlashError::NotErased));
    assert_eq!(slot.erase(0, 8), Err(SimFlashError::NotAligned));
    assert_eq!(
        slot.erase(0, capacity + BLOCK as u32),
        Err(SimFlashError::OutOfBounds)
    );
    assert_eq!(slot.erase(0, BLOCK as u32), Ok(()));
    assert_eq!(slot.write(16, &[6; 8]), Ok(()));
    assert_eq!(flash.wear(), [0, 1, 0, 0, 0]);
}

#[test]
fn without_power_nothing_works() {
    let mut flash = flash();
    flash.plan_cut(Some(PowerCut {
        operation: 1,
        byte: 3,
        cut: Cut::Clean,
    }));
    let slot = &mut flash.regions().slots[0].blob;
    assert_eq!(slot.write(0, &[0; 24]), Err(SimFlashError::PowerOff));
    assert_eq!(slot.read(0, &mut [0]), Err(SimFlashError::PowerOff));
    assert_eq!(slot.erase(0, BLOCK as u32), Err(SimFlashError::PowerOff));
    assert!(!flash.has_power());
    flash.power_up();
    let expected = [[0; 11].as_slice(), &[0xff; 13]].concat();
    let slot = &mut flash.regions().slots[0].blob;
    assert_eq!(*slot.mapped(0, 24).unwrap(), expected);
}

#[test]
fn a_weak_unit_reads_differently_until_it_is_erased() {
    let mut flash = flash();
    flash.plan_cut(Some(PowerCut {
        operation: 0,
        byte: 4,
        cut: Cut::Weak,
    }));
    let slot = &mut flash.regions().slots[0].blob;
    let _ = slot.write(0, &[0; 8]);
    flash.power_up();
    let reads: Vec<_> = (0..20).map(|_| read(&mut flash, 0)).collect();
    assert!(reads.iter().all(|unit| unit[..4] == [0; 4]));
    assert!(reads.iter().any(|unit| *unit != reads[0]));
    let mapped =
        |flash: &mut SimFlash| flash.regions().slots[0].blob.mapped(0, 8).unwrap().to_vec();
    let first = mapped(&mut flash);
    assert_eq!(mapped(&mut flash), first, "the mapping keeps still");
    let slot = &mut flash.regions().slots[0].blob;
    assert_eq!(slot.write(0, &[0; 8]), Err(SimFlashError::NotErased));
    slot.erase(0, BLOCK as u32).unwrap();
    assert_eq!(read(&mut flash, 0), [0xff; 8]);
    flash.power_up();
    assert_eq!(mapped(&mut flash), [0xff; 8]);
}

#[test]
fn a_torn_erase_leaves_some_bits() {
    let mut flash = flash();
    let slot = &mut flash.regions().slots[0].blob;
    slot.write(0, &[0; BLOCK]).unwrap();
    flash.power_up();
    flash.plan_cut(Some(PowerCut {
        operation: 0,
        byte: 100,
        cut: Cut::Torn,
    }));
    let slot = &mut flash.regions().slots[0].blob;
    let _ = slot.erase(0, BLOCK as u32);
    flash.power_up();
    let slot = &mut flash.regions().slots[0].blob;
    assert_eq!(*slot.mapped(0, 100).unwrap(), [0xff; 100]);
    let ones: u32 = slot.mapped(0, BLOCK as u32).unwrap()[100..]
        .iter()
        .map(|b| b.count_ones())
        .sum();
    let bits = 8 * (BLOCK as u32 - 100);
    assert!((bits / 3..2 * bits / 3).contains(&ones), "{ones} of {bits}");
}

#[test]
fn broken_places_fail_until_repaired() {
    let mut flash = flash();
    flash.break_unit(BLOCK + 8);
    flash.break_block(2 * BLOCK);
    let slot = &mut flash.regions().slots[0].blob;
    let block = BLOCK as u32;
    assert_eq!(slot.write(0, &[0; 16]), Err(SimFlashError::Broken));
    assert_eq!(slot.erase(block, 2 * block), Err(SimFlashError::Broken));
    flash.repair();
    let slot = &mut flash.regions().slots[0].blob;
    assert_eq!(slot.write(8, &[0; 8]), Ok(()));
    assert_eq!(slot.erase(block, 2 * block), Ok(()));
}

#[test]
fn too_few_blocks_or_half_a_block_are_no_flash() {
    assert!(SimFlash::blank(4, 0).is_none());
    assert!(SimFlash::with_contents(&vec![0; 5 * BLOCK + 1], 0).is_none());
}

fn with(rules: &str) -> SimFlash {
    let rules: Rules = rules.parse().unwrap();
    SimFlash::blank_with(rules, 5 << 12, 1).unwrap()
}

#[test]
fn units_and_blocks_are_those_of_the_rules() {
    let mut flash = with("unit=32,block=2048,erased=00");
    let slot = &mut flash.regions().slots[0].blob;
    assert_eq!(slot.mapped(0, 8), Some(&[0; 8][..]));
    assert_eq!(slot.write(16, &[1; 32]), Err(SimFlashError::NotAligned));
    assert_eq!(slot.write(32, &[1; 16]), Err(SimFlashError::NotAligned));
    assert_eq!(slot.write(32, &[0; 32]), Ok(()), "as erased");
    assert_eq!(slot.write(32, &[1; 32]), Err(SimFlashError::NotErased));
    assert_eq!(slot.erase(0, 1024), Err(SimFlashError::NotAligned));
    assert_eq!(slot.erase(0, 2048), Ok(()));
    assert_eq!(slot.write(32, &[1; 32]), Ok(()));
    // Without the need to erase, a unit takes other bytes at once, and there is no erase.
    let mut flash = with("unit=16,erase=none");
    let slot = &mut flash.regions().slots[0].blob;
    assert_eq!(slot.write(0, &[1; 16]), Ok(()));
    assert_eq!(slot.write(0, &[2; 16]), Ok(()));
    assert_eq!(slot.erase(0, 4096), Err(SimFlashError::Broken));
}

#[test]
fn what_a_cut_spoiled_cannot_be_read_where_there_is_ecc() {
    for ecc in [Ecc::Error, Ecc::Fault] {
        let mut bad = 0;
        for seed in 0..100 {
            let rules = Rules {
                ecc,
                ..Rules::default()
            };
            let mut flash = SimFlash::blank_with(rules, 5 * BLOCK, seed).unwrap();
            flash.plan_cut(Some(PowerCut {
                operation: 1,
                byte: 3,
                cut: Cut::Clean,
            }));
            let slot = &mut flash.regions().slots[0].blob;
            let _ = slot.write(0, &[0; 24]);
            flash.power_up();
            let slot = &mut flash.regions().slots[0].blob;
            assert_eq!(slot.read(0, &mut [0; 8]), Ok(()), "the unit before");
            assert_eq!(slot.read(16, &mut [0; 8]), Ok(()), "the unit behind");
            assert_eq!(slot.mapped(0, 8).unwrap(), [0; 8]);
            let is_bad = slot.read(8, &mut [0; 8]).is_err();
            // Nor can a longer read that touches it, and a look in place is a fault.
            assert_eq!(slot.read(0, &mut [0; 24]).is_err(), is_bad);
            assert!(slot.mapped(8, 8).is_some());
            assert_eq!(flash.unhandled_faults(), u64::from(is_bad));
            bad += u32::from(is_bad);
            let slot = &mut flash.regions().slots[0].blob;
            slot.erase(0, BLOCK as u32).unwrap();
            assert_eq!(slot.read(8, &mut [0; 8]), Ok(()));
        }
        assert!((75..100).contains(&bad), "{bad}");
    }
}

#[test]
fn blank_units_read_as_the_rules_say() {
    let mut flash = with("blank=fault");
    let slot = &mut flash.regions().slots[0].blob;
    slot.write(8, &[0xff; 8]).unwrap();
    assert_eq!(slot.is_blank(0, 8), Ok(true));
    assert_eq!(
        slot.is_blank(8, 8),
        Ok(false),
        "programmed, as it happens, as erased"
    );
    assert_eq!(slot.read(0, &mut [0; 8]), Err(SimFlashError::Unreadable));
    assert_eq!(slot.read(8, &mut [0; 8]), Ok(()));
    assert!(slot.mapped(0, 8).is_some());
    assert_eq!(flash.unhandled_faults(), 1);
    let mut flash = with("blank=undefined");
    let first = read(&mut flash, 0);
    assert_ne!(read(&mut flash, 0), first);
    assert_eq!(flash.regions().slots[0].blob.is_blank(0, 64), Ok(true));
}

#[test]
fn logs_may_have_regions_with_blocks_of_their_own() {
    let rules: Rules = "unit=4,block=131072,log-block=16384".parse().unwrap();
    let mut flash = SimFlash::blank_with(rules, 3 << 17, 1).unwrap();
    assert_eq!(
        (
            flash.log_start(0),
            flash.log_start(1),
            flash.slot_start(0),
            flash.blob_start(1)
        ),
        (16_384, 32_768, 1 << 17, 2 << 17)
    );
    let log = flash.regions().slots[0].log.take().unwrap();
    assert_eq!((log.capacity(), log.geometry().block), (16_384, 16_384));
    assert!(SimFlash::blank_with(rules, 2 << 17, 1).is_none());
}
