//! Power lost at any operation and any byte of an update and of a rollback, in three manners, and
//! again while the device recovers; bits that flip at rest; flash that fails. Always exactly the old
//! or the new blob, boot after boot the same one, and the device can be flashed again.
//!
//! `cargo test --release -p firmware-sim --test it power_cuts -- --nocapture` prints how many runs.

use std::sync::LazyLock;

use crate::rig;
use firmware_sim::simulated::sim_flash::{BLOCK, Blank, Cut, PowerCut, SimFlash, UNIT};
use ray_device::app::Device;
use ray_device::frame::checksum;
use ray_device::port::Clock;
use ray_device::protocol::{
    Chunk, MAX_CHUNK, NewBlob, Refusal, Reply, Request, SlotState, Status, StoredBlob,
};
use split_mix::SplitMix;

/// The factory block, and two slots of a log and two blocks for a blob.
const BLOCKS: usize = 1 + 2 * 3;

pub const OLDER: [u8; 16] = *b"an older rig    ";
pub const OLD: [u8; 16] = *b"the old rig     ";
pub const NEW: [u8; 16] = *b"the new rig     ";
pub const NEXT: [u8; 16] = *b"the one after it";

/// Units of an entry of the log.
const ENTRY_UNITS: u64 = 7;

pub struct Stopped;

impl Clock for Stopped {
    fn uptime_ms(&mut self) -> u64 {
        0
    }
}

pub fn device() -> Device<Stopped> {
    Device::new("a device", Stopped)
}

/// Starts the device and asks it these, one after the other, until it refuses one.
pub fn ask(flash: &mut SimFlash, requests: &[Request]) -> Result<Vec<Reply>, Refusal> {
    let mut regions = flash.regions();
    let mut device = device();
    let mut epoch = device.epoch(&mut regions);
    let mut replies = Vec::new();
    for request in requests {
        match epoch.respond_to(0, request) {
            Reply::Refused(refusal) => return Err(refusal),
            reply => replies.push(reply),
        }
    }
    Ok(replies)
}

pub fn update(blob: &[u8], identity: [u8; 16]) -> Vec<Request> {
    let mut requests = vec![Request::BeginUpdate(NewBlob {
        length: blob.len() as u32,
        checksum: checksum(blob),
        identity,
        rig_serial: None,
        signature: None,
    })];
    for (offset, bytes) in (0..).step_by(MAX_CHUNK).zip(blob.chunks(MAX_CHUNK)) {
        let bytes = heapless::Vec::from_slice(bytes).unwrap();
        requests.push(Request::Chunk(Chunk { offset, bytes }));
    }
    requests.push(Request::FinishUpdate);
    requests
}

pub fn update_to(identity: [u8; 16]) -> Vec<Request> {
    update(&rig::blob_of(identity), identity)
}

pub fn stored(replies: &[Reply]) -> StoredBlob {
    match replies.last() {
        Some(Reply::Active(stored)) => *stored,
        other => panic!("{other:?}"),
    }
}

pub fn status(flash: &mut SimFlash) -> Status {
    match ask(flash, &[Request::Status]).unwrap().pop() {
        Some(Reply::Status(status)) => status,
        other => panic!("{other:?}"),
    }
}

/// The identity of the blob that the device uses when it is switched on now.
pub fn active(flash: &mut SimFlash) -> Option<[u8; 16]> {
    flash.power_up();
    status(flash).blob.ok().map(|blob| blob.identity)
}

/// A flash with the old blob active, with or without an older one in the other slot.
fn flash_with_old(has_older: bool) -> SimFlash {
    with_old(SimFlash::blank(BLOCKS, 0).unwrap(), has_older)
}

/// The same of any blank flash.
pub fn with_old(mut flash: SimFlash, has_older: bool) -> SimFlash {
    if has_older {
        ask(&mut flash, &update_to(OLDER)).unwrap();
    }
    let replies = ask(&mut flash, &update_to(OLD)).unwrap();
    assert_eq!(stored(&replies).slot, u8::from(has_older));
    flash
}

pub fn copy(flash: &SimFlash, seed: u64) -> SimFlash {
    flash.copy(seed)
}

/// The operations of `requests` without any cut, and how many of them a start alone takes: none.
pub fn operations(flash: &SimFlash, requests: &[Request]) -> u64 {
    let mut flash = copy(flash, 0);
    status(&mut flash);
    assert_eq!(flash.operations(), 0, "a start that has nothing to settle");
    ask(&mut flash, requests).unwrap();
    flash.operations()
}

/// Cuts power during `requests` and, if there is another cut, while the device starts again. Then it
/// must have one of the two blobs for good, and take another.
pub fn survive(
    before: &SimFlash,
    requests: &[Request],
    cuts: &[PowerCut],
    seed: u64,
    either: [[u8; 16]; 2],
) -> [u8; 16] {
    static UPDATE_TO_NEXT: LazyLock<Vec<Request>> = LazyLock::new(|| update_to(NEXT));
    let context = || format!("{}, {cuts:?}, seed {seed}", before.rules());
    let mut flash = copy(before, seed);
    flash.plan_cut(cuts.first().copied());
    let outcome = ask(&mut flash, requests);
    for &cut in cuts.iter().skip(1) {
        flash.power_up();
        flash.plan_cut(Some(cut));
        let _ = ask(&mut flash, &[Request::Status]);
    }
    let found = active(&mut flash);
    let found = found.unwrap_or_else(|| panic!("no blob: {}", context()));
    assert!(either.contains(&found), "{found:?}: {}", context());
    if outcome.is_ok() {
        assert_eq!(found, either[1], "it was acknowledged: {}", context());
    }
    // A seal that wavers may be found wanting by a later start, which then writes one more entry; so may
    // spoiled units whose blank check answers as it likes.
    let mut written = 0;
    for boot in 0..5 {
        assert_eq!(
            active(&mut flash),
            Some(found),
            "boot {boot}: {}",
            context()
        );
        written += flash.operations();
    }
    let is_sound =
        cuts.iter().all(|cut| cut.cut != Cut::Weak) && before.rules().blank == Blank::Erased;
    let limit = if is_sound {
        0
    } else {
        2 * most_of_a_start(&flash)
    };
    assert!(written <= limit, "{written} operations: {}", context());
    if let Err(refusal) = ask(&mut flash, &UPDATE_TO_NEXT) {
        panic!("not flashable, {refusal}: {}", context());
    }
    assert_eq!(active(&mut flash), Some(NEXT), "{}", context());
    let replies = ask(&mut flash, &[Request::Rollback]);
    assert!(replies.is_ok(), "{replies:?}: {}", context());
    assert_eq!(active(&mut flash), Some(found), "{}", context());
    let faults = flash.unhandled_faults();
    assert_eq!(faults, 0, "looked at in place: {}", context());
    found
}

/// Operations by which a start settles a log: an entry is written, or the log erased.
fn most_of_a_start(flash: &SimFlash) -> u64 {
    let shape = flash.rules().shape();
    let entry = shape.entry_length() / shape.log.unit;
    let blocks = shape.log_length().div_ceil(shape.log.block);
    u64::from(entry.max(blocks))
}

/// `SEEDS=10` in the environment draws ten times as often.
pub fn seeds() -> u64 {
    let seeds = std::env::var("SEEDS").ok();
    seeds.and_then(|text| text.parse().ok()).unwrap_or(1)
}

pub const MANNERS: [Cut; 3] = [Cut::Clean, Cut::Torn, Cut::Weak];

/// Places inside an operation: each byte of a unit; of a block, all that differ in what they hit.
fn bytes_of(operation: u64, erases: &[u64]) -> Vec<usize> {
    if erases.contains(&operation) {
        vec![
            0, 1, 7, 8, 24, 31, 32, 33, 40, 64, 100, 1000, 2048, 4095, 4096,
        ]
    } else {
        (0..=UNIT).collect()
    }
}

/// The erases of an update: the log's, and each block's before its first byte.
fn erases(length: usize) -> Vec<u64> {
    let units_in_block = (BLOCK / UNIT) as u64;
    let blocks = length.div_ceil(BLOCK) as u64;
    let first_of = |block: u64| 1 + block * (units_in_block + 1);
    std::iter::once(0)
        .chain((0..blocks).map(first_of))
        .collect()
}

#[test]
fn a_cut_at_every_byte_of_an_update() {
    let requests = update_to(NEW);
    let erases = erases(rig::blob_of(NEW).len());
    let mut runs = 0;
    let mut became_new = 0;
    for has_older in [false, true] {
        let before = flash_with_old(has_older);
        for operation in 0..operations(&before, &requests) {
            for byte in bytes_of(operation, &erases) {
                for cut in MANNERS {
                    for seed in 0..seeds() {
                        let cut = PowerCut {
                            operation,
                            byte,
                            cut,
                        };
                        let found = survive(&before, &requests, &[cut], seed, [OLD, NEW]);
                        runs += 1;
                        became_new += u32::from(found == NEW);
                    }
                }
            }
        }
    }
    println!("cuts during an update: {runs} runs, all survived; {became_new} with the new blob");
    assert!(became_new > 0 && runs > 10_000);
}

#[test]
fn a_cut_at_every_byte_of_a_rollback() {
    let before = flash_with_old(true);
    let requests = [Request::Rollback];
    let mut runs = 0;
    let mut became_new = 0;
    for operation in 0..operations(&before, &requests) {
        for byte in 0..=UNIT {
            for cut in MANNERS {
                for seed in 0..20 * seeds() {
                    let cut = PowerCut {
                        operation,
                        byte,
                        cut,
                    };
                    let found = survive(&before, &requests, &[cut], seed, [OLD, OLDER]);
                    runs += 1;
                    became_new += u32::from(found == OLDER);
                }
            }
        }
    }
    println!("cuts during a rollback: {runs} runs, all survived; {became_new} rolled back");
    assert!(became_new > 0 && became_new < runs);
}

/// The first cut hits the commit or the erase of the log, where a start has something to settle.
#[test]
fn a_second_cut_while_the_device_recovers() {
    let requests = update_to(NEW);
    let mut runs = 0;
    for has_older in [false, true] {
        let before = flash_with_old(has_older);
        let total = operations(&before, &requests);
        for first in std::iter::once(0).chain(total - 2 * ENTRY_UNITS..total) {
            for byte in [0, 4, 8] {
                for cut in [Cut::Torn, Cut::Weak] {
                    let first = PowerCut {
                        operation: first,
                        byte,
                        cut,
                    };
                    for operation in 0..=ENTRY_UNITS {
                        for byte in [0, 3, 8] {
                            for cut in MANNERS {
                                let second = PowerCut {
                                    operation,
                                    byte,
                                    cut,
                                };
                                for seed in 0..seeds() {
                                    let cuts = [first, second];
                                    survive(&before, &requests, &cuts, seed, [OLD, NEW]);
                                    runs += 1;
                                }
                            }
                        }
                    }
                }
            }
        }
    }
    println!("a second cut during recovery: {runs} runs, all survived");
}

/// As unlucky as it gets: up to eight cuts in a row, each anywhere.
#[test]
fn cut_after_cut() {
    let mut random = SplitMix(7);
    let mut runs = 0;
    let befores = [flash_with_old(false), flash_with_old(true)];
    let update = update_to(NEW);
    let total = operations(&befores[0], &update);
    for seed in 0..10_000 * seeds() {
        let mut below = |limit: u64| random.next() % limit;
        let before = &befores[below(2) as usize];
        let first = match below(4) {
            0 => below(total),
            _ => total - 1 - below(2 * ENTRY_UNITS),
        };
        let mut cuts = vec![first];
        cuts.extend((0..below(8)).map(|_| 0));
        let cuts: Vec<PowerCut> = cuts
            .into_iter()
            .enumerate()
            .map(|(number, operation)| PowerCut {
                operation: if number == 0 { operation } else { below(9) },
                byte: below(UNIT as u64 + 1) as usize,
                cut: MANNERS[below(3) as usize],
            })
            .collect();
        survive(before, &update, &cuts, seed, [OLD, NEW]);
        runs += 1;
    }
    println!("up to eight cuts in a row: {runs} runs, all survived");
}

/// One bit, anywhere in the flash: the device says so or does not need it, never uses a damaged blob,
/// and can be flashed.
#[test]
fn a_bit_that_flips_at_rest() {
    let before = {
        let mut flash = flash_with_old(true);
        ask(&mut flash, &update_to(NEW)).unwrap();
        flash
    };
    let blob_length = rig::blob_of(NEW).len();
    let mut runs = 0;
    let mut kept = 0;
    for slot in [0, 1] {
        let start = before.slot_start(slot);
        let logs = start..start + 4 * 32;
        let blobs = start + BLOCK..start + BLOCK + blob_length;
        for address in logs.chain(blobs).chain([0, 100]) {
            let mut flash = copy(&before, 0);
            flash.flip(address, address as u32);
            let found = active(&mut flash).expect("a blob is left");
            assert!(found == NEW || found == OLD, "{address:#x}: {found:?}");
            kept += u32::from(found == NEW);
            assert_eq!(active(&mut flash), Some(found), "{address:#x}");
            // A bit that comes back does not bring its blob back.
            flash.flip(address, address as u32);
            assert_eq!(active(&mut flash), Some(found), "{address:#x}");
            ask(&mut flash, &update_to(NEXT)).unwrap();
            assert_eq!(active(&mut flash), Some(NEXT), "{address:#x}");
            runs += 1;
        }
    }
    println!("bits flipped at rest: {runs}, all survived; {kept} without losing the newest blob");
    // Only a flip in the newest blob itself takes it away.
    assert_eq!(runs - kept, blob_length as u32);
}

/// When it says that the update failed, the old blob stays, now and later; a log entry that does not
/// take its record is left out.
#[test]
fn flash_that_fails_is_told_and_the_old_blob_stays() {
    let before = flash_with_old(true);
    let requests = update_to(NEW);
    let slot = before.slot_start(0);
    let blob_length = rig::blob_of(NEW).len();
    let mut runs = 0;
    for address in (0..blob_length).step_by(UNIT) {
        let mut flash = copy(&before, 1);
        flash.break_unit(slot + BLOCK + address);
        let refusal = ask(&mut flash, &requests).unwrap_err();
        let place = (slot + BLOCK + address) as u32;
        assert!(
            matches!(refusal, Refusal::FlashFailed { address, .. } if address == place),
            "{refusal:?}"
        );
        assert_eq!(active(&mut flash), Some(OLD));
        flash.repair();
        ask(&mut flash, &requests).unwrap();
        assert_eq!(active(&mut flash), Some(NEW));
        runs += 1;
    }
    for block in 0..2 {
        let mut flash = copy(&before, 1);
        flash.break_block(slot + block * BLOCK);
        assert!(matches!(
            ask(&mut flash, &requests),
            Err(Refusal::FlashFailed { .. })
        ));
        assert_eq!(active(&mut flash), Some(OLD));
        runs += 1;
    }
    for unit in 0..ENTRY_UNITS as usize {
        // One entry is left out.
        let mut flash = copy(&before, 1);
        flash.break_unit(slot + unit * UNIT);
        ask(&mut flash, &requests).unwrap();
        assert_eq!(active(&mut flash), Some(NEW));
        // None takes it.
        let mut flash = copy(&before, 1);
        for entry in 0..64 {
            flash.break_unit(slot + entry * 64 + unit * UNIT);
        }
        assert!(matches!(
            ask(&mut flash, &requests),
            Err(Refusal::FlashFailed { .. })
        ));
        assert_eq!(active(&mut flash), Some(OLD));
        assert_eq!(active(&mut flash), Some(OLD));
        runs += 2;
    }
    println!("failing blocks and units: {runs} runs, all survived");
}

#[test]
fn an_update_erases_each_block_once_and_nothing_of_the_active_slot() {
    let mut flash = copy(&flash_with_old(false), 0);
    let active_slot = flash.contents()[BLOCK..4 * BLOCK].to_vec();
    ask(&mut flash, &update_to(NEW)).unwrap();
    assert_eq!(flash.wear(), [0, 0, 0, 0, 1, 1, 0]);
    assert_eq!(flash.contents()[BLOCK..4 * BLOCK], active_slot);
    // The same blob once more takes nothing at all.
    let replies = ask(&mut flash, &update_to(NEW)[..1]).unwrap();
    assert_eq!(stored(&replies).slot, 1);
    assert_eq!(flash.wear(), [0, 0, 0, 0, 1, 1, 0]);
    ask(&mut flash, &[Request::Rollback]).unwrap();
    assert_eq!(flash.wear(), [0, 0, 0, 0, 1, 1, 0]);
    assert_eq!(active(&mut flash), Some(OLD));
}

#[test]
fn a_thousand_rollbacks_in_a_row_do_not_fill_a_log() {
    let mut flash = flash_with_old(true);
    let [older, old] = [OLDER, OLD].map(Some);
    for round in 0..1000 {
        ask(&mut flash, &[Request::Rollback]).unwrap();
        let expected = if round % 2 == 0 { older } else { old };
        assert_eq!(active(&mut flash), expected, "round {round}");
    }
    ask(&mut flash, &update_to(NEW)).unwrap();
    assert_eq!(active(&mut flash), Some(NEW));
}

#[test]
fn a_few_hundred_updates_in_a_row() {
    let mut flash = SimFlash::blank(BLOCKS, 0).unwrap();
    let blobs = [update_to(OLD), update_to(NEW), update_to(NEXT)];
    for round in 0..300_usize {
        let replies = ask(&mut flash, &blobs[round % 3]).unwrap();
        assert_eq!(stored(&replies).sequence, round as u32 + 1);
    }
    // Every other update goes to either slot, so each block that is used wears the same.
    assert_eq!(flash.wear(), [0, 150, 150, 0, 150, 150, 0]);
    let SlotState::Holds(stored) = status(&mut flash).slots[1] else {
        panic!("slot 1 holds the last one");
    };
    assert_eq!((stored.sequence, stored.identity), (300, NEXT));
}
