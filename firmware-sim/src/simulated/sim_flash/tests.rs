//! The rules of the simulated flash, and its failures.

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};

use super::{BLOCK, Cut, PowerCut, SimFlash, SimFlashError, UNIT};
use ray_device::port::MappedFlash;

fn flash() -> SimFlash {
    SimFlash::blank(5, 1).unwrap()
}

fn read(flash: &mut SimFlash, address: u32) -> [u8; UNIT] {
    let [slot, _] = &mut flash.regions().slots;
    let mut unit = [0; UNIT];
    slot.read(address, &mut unit).unwrap();
    unit
}

#[test]
fn units_are_programmed_whole_in_place_and_once() {
    let mut flash = flash();
    let [slot, _] = &mut flash.regions().slots;
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
    let [slot, _] = &mut flash.regions().slots;
    assert_eq!(slot.write(0, &[0; 24]), Err(SimFlashError::PowerOff));
    assert_eq!(slot.read(0, &mut [0]), Err(SimFlashError::PowerOff));
    assert_eq!(slot.erase(0, BLOCK as u32), Err(SimFlashError::PowerOff));
    assert!(!flash.has_power());
    flash.power_up();
    let expected = [[0; 11].as_slice(), &[0xff; 13]].concat();
    let [slot, _] = &mut flash.regions().slots;
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
    let [slot, _] = &mut flash.regions().slots;
    let _ = slot.write(0, &[0; 8]);
    flash.power_up();
    let reads: Vec<_> = (0..20).map(|_| read(&mut flash, 0)).collect();
    assert!(reads.iter().all(|unit| unit[..4] == [0; 4]));
    assert!(reads.iter().any(|unit| *unit != reads[0]));
    let mapped = |flash: &mut SimFlash| flash.regions().slots[0].mapped(0, 8).unwrap().to_vec();
    let first = mapped(&mut flash);
    assert_eq!(mapped(&mut flash), first, "the mapping keeps still");
    let [slot, _] = &mut flash.regions().slots;
    assert_eq!(slot.write(0, &[0; 8]), Err(SimFlashError::NotErased));
    slot.erase(0, BLOCK as u32).unwrap();
    assert_eq!(read(&mut flash, 0), [0xff; 8]);
    flash.power_up();
    assert_eq!(mapped(&mut flash), [0xff; 8]);
}

#[test]
fn a_torn_erase_leaves_some_bits() {
    let mut flash = flash();
    let [slot, _] = &mut flash.regions().slots;
    slot.write(0, &[0; BLOCK]).unwrap();
    flash.power_up();
    flash.plan_cut(Some(PowerCut {
        operation: 0,
        byte: 100,
        cut: Cut::Torn,
    }));
    let [slot, _] = &mut flash.regions().slots;
    let _ = slot.erase(0, BLOCK as u32);
    flash.power_up();
    let [slot, _] = &mut flash.regions().slots;
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
    let [slot, _] = &mut flash.regions().slots;
    let block = BLOCK as u32;
    assert_eq!(slot.write(0, &[0; 16]), Err(SimFlashError::Broken));
    assert_eq!(slot.erase(block, 2 * block), Err(SimFlashError::Broken));
    flash.repair();
    let [slot, _] = &mut flash.regions().slots;
    assert_eq!(slot.write(8, &[0; 8]), Ok(()));
    assert_eq!(slot.erase(block, 2 * block), Ok(()));
}

#[test]
fn too_few_blocks_or_half_a_block_are_no_flash() {
    assert!(SimFlash::blank(4, 0).is_none());
    assert!(SimFlash::with_contents(&vec![0; 5 * BLOCK + 1], 0).is_none());
}
