//! Power lost on every kind of part: program units of 1 to 512 bytes, erased to 0xff and 0x00, with ECC errors that
//! the driver returns and with ECC faults that a handler turns into them, with blank words that cannot be
//! read or read as anything, logs in blocks of their own, shared, or apart. After each cut six starts with the
//! same blob, the old or the new one, and an update that succeeds; never a look in place at what cannot be read.
//!
//! `cargo test --release -p firmware-sim --test it parts -- --nocapture` prints how many cuts. With
//! `SEEDS=10` in the environment every operation is cut at every byte of a unit (longer than 16: at some 27), and
//! three times as many kinds of part are tried.

use crate::power_cuts::{
    MANNERS, NEW, NEXT, OLD, OLDER, active, ask, copy, seeds, status, survive, update_to, with_old,
};
use crate::rig;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use firmware_sim::simulated::sim_flash::{
    Cut, PowerCut, Rules, SimFlash, SimFlashError, SimRegion,
};
use ray_device::app::Device;
use ray_device::frame::checksum;
use ray_device::port::{Clock, Flash, MappedFlash, NoClock, Regions};
use ray_device::protocol::{Refusal, Reply, Request};
use ray_device::storage::factory::WithBlob;
use split_mix::SplitMix;

/// A blank flash by these rules with room for two slots of the tests' blobs, and no more.
fn blank(rules: &str) -> SimFlash {
    let rules: Rules = rules.parse().unwrap();
    let shape = rules.shape();
    let blob = rig::blob().len() as u32;
    let slot = (shape.blob_start() + blob).next_multiple_of(rules.block);
    let front = match rules.log_block {
        Some(block) => (block + 2 * shape.log_length()).next_multiple_of(rules.block),
        None => rules.block,
    };
    SimFlash::blank_with(rules, (front + 2 * slot) as usize, 0).unwrap()
}

/// Where in an operation of so many bytes to cut: if `all`, at every byte of a unit of up to 16 and at some 27 of a
/// longer one, among them the first nine and the last three; of a block at places that differ in what they hit.
fn places(length: usize, unit: usize, all: bool) -> Vec<usize> {
    let mut places = if length > unit {
        vec![
            0,
            1,
            unit - 1,
            unit,
            48,
            64,
            65,
            length / 2,
            length - 1,
            length,
        ]
    } else if all && unit < 32 {
        (0..=length).collect()
    } else if all {
        (0..=8)
            .chain((8..length).step_by(unit / 16))
            .chain(length - 2..=length)
            .collect()
    } else {
        vec![0, 1, length / 2, length - 1, length]
    };
    places.retain(|&place| place <= length);
    places.sort_unstable();
    places.dedup();
    places
}

/// Cuts `requests` short, at every operation if `all`, otherwise at the first, at those of the commit and at some
/// between; how often, and how often the second of `either` was in use then.
fn cut_everywhere(
    before: &SimFlash,
    requests: &[Request],
    either: [[u8; 16]; 2],
    all: bool,
) -> (u32, u32) {
    let mut dry = copy(before, 0);
    status(&mut dry);
    assert_eq!(dry.operations(), 0, "a start that has nothing to settle");
    ask(&mut dry, requests).unwrap();
    let lengths = dry.operation_lengths().to_vec();
    let unit = before.rules().unit as usize;
    let entries = 2 * (64 / unit).max(3);
    let stride = (lengths.len() / 6).max(1);
    let (mut runs, mut became_new) = (0, 0);
    for (operation, &length) in lengths.iter().enumerate() {
        let is_commit = operation + entries >= lengths.len();
        // The last entry is a copy: every other unit of the two.
        let is_chosen = is_commit && (unit >= 8 || operation % 8 < 2)
            || operation < 2
            || length > unit
            || operation.is_multiple_of(stride);
        if !all && !is_chosen {
            continue;
        }
        for byte in places(length, unit, all) {
            for cut in MANNERS {
                let cut = PowerCut {
                    operation: operation as u64,
                    byte,
                    cut,
                };
                let seed = (operation * 1000 + byte) as u64;
                let found = survive(before, requests, &[cut], seed, either);
                runs += 1;
                became_new += u32::from(found == either[1]);
            }
        }
    }
    (runs, became_new)
}

/// Cuts an update and a rollback everywhere, and starts that recover from that.
fn try_part(rules: &str, all: bool) -> u32 {
    let before = with_old(blank(rules), true);
    let update = update_to(NEW);
    let (updates, new) = cut_everywhere(&before, &update, [OLD, NEW], all);
    assert!(new > 0 && new < updates, "{rules}: {new} of {updates}");
    let (rollbacks, back) = cut_everywhere(&before, &[Request::Rollback], [OLD, OLDER], all);
    assert!(
        back > 0 && back < rollbacks,
        "{rules}: {back} of {rollbacks}"
    );
    let first = with_old(blank(rules), false);
    let operations = {
        let mut dry = copy(&first, 0);
        ask(&mut dry, &update).unwrap();
        dry.operations()
    };
    // Cuts in a row, the first of them where there is something to settle.
    let mut random = SplitMix(9);
    let unit = u64::from(before.rules().unit);
    let entries = 2 * (64 / unit).max(3);
    let chains = 10 * seeds();
    for seed in 0..chains {
        let mut below = |limit: u64| random.next() % limit;
        let has_older = below(2) == 0;
        let start = if below(4) == 0 {
            0
        } else {
            operations - 1 - below(entries.min(operations))
        };
        let mut cut = |operation| PowerCut {
            operation,
            byte: below(unit + 1) as usize,
            cut: MANNERS[below(3) as usize],
        };
        let cuts = [cut(start), cut(seed % entries), cut(seed % 3)];
        let before = if has_older { &before } else { &first };
        survive(before, &update, &cuts, seed, [OLD, NEW]);
    }
    updates + rollbacks + chains as u32
}

fn try_unit(unit: u32) {
    let mut runs = 0;
    let mut parts = 0;
    for erased in ["ff", "00"] {
        for (is_always, more) in [
            (erased == "00", ""),
            (false, ",ecc=error"),
            (erased == "ff", ",ecc=fault"),
            (erased == "00", ",ecc=error,blank=fault"),
            (false, ",ecc=fault,blank=fault"),
            (erased == "ff", ",blank=undefined"),
        ] {
            if !is_always && seeds() == 1 {
                continue;
            }
            let rules = format!("unit={unit},block=4096,erased={erased}{more}");
            runs += try_part(&rules, seeds() > 1 && is_always);
            parts += 1;
        }
    }
    println!("units of {unit}: {runs} cuts of {parts} kinds of part, all survived");
}

macro_rules! units {
    ($($name:ident $unit:literal)*) => {
        $(#[test]
        fn $name() {
            try_unit($unit);
        })*
    };
}

units! {
    units_of_1 1
    units_of_2 2
    units_of_4 4
    units_of_8 8
    units_of_16 16
    units_of_32 32
    units_of_64 64
    units_of_128 128
    units_of_256 256
    units_of_512 512
}

/// Real parts, as `RELIABILITY.md` lists them.
const REAL_PARTS: [(&str, &str); 18] = [
    (
        "STM32F4, logs in small sectors",
        "unit=4,block=131072,erased=ff,log-block=16384",
    ),
    (
        "STM32F4, all in large sectors",
        "unit=4,block=131072,erased=ff",
    ),
    (
        "STM32F7 by embassy's driver",
        "unit=16,block=131072,erased=ff",
    ),
    ("STM32L4, G4", "unit=8,block=2048,erased=ff,ecc=fault"),
    ("STM32L0, L1", "unit=4,block=128,erased=00"),
    ("STM32H743", "unit=32,block=131072,erased=ff,ecc=fault"),
    (
        "STM32H7A/B, H7R/S, H5, U5",
        "unit=16,block=8192,erased=ff,ecc=fault",
    ),
    ("nRF52, nRF53, ESP32-S3", "unit=4,block=4096,erased=ff"),
    ("nRF54L", "unit=16,block=4096,erased=ff,erase=none"),
    (
        "RP2040, RP2350, i.MX RT, N6, K210 on SPI NOR",
        "unit=256,block=4096,erased=ff",
    ),
    (
        "the same with a driver of single bytes",
        "unit=1,block=4096,erased=ff",
    ),
    (
        "SAMD51, E54 in quad words",
        "unit=16,block=8192,erased=ff,ecc=error",
    ),
    ("SAMD51 in pages", "unit=512,block=8192,erased=ff,ecc=error"),
    ("SAME70", "unit=16,block=8192,erased=ff,ecc=error"),
    (
        "LPC55",
        "unit=512,block=512,erased=ff,ecc=fault,blank=fault",
    ),
    ("MCX A, N", "unit=128,block=8192,erased=ff,ecc=error"),
    (
        "RA6, RA8 code flash",
        "unit=128,block=32768,erased=ff,ecc=error",
    ),
    ("RA data flash", "unit=4,block=64,erased=ff,blank=undefined"),
];

#[test]
fn real_parts() {
    let mut runs = 0;
    for (name, rules) in REAL_PARTS {
        let cuts = try_part(rules, seeds() > 1);
        println!("{name} ({rules}): {cuts} cuts, all survived");
        runs += cuts;
    }
    println!(
        "real parts: {runs} cuts of {} parts, all survived",
        REAL_PARTS.len()
    );
}

/// Where the log has blocks of its own there is no end to them; where it shares the blob's, 60 and more.
#[test]
fn rollbacks_in_a_row_do_not_fill_a_log() {
    for (name, rules) in REAL_PARTS {
        let mut flash = with_old(blank(rules), true);
        let is_shared = flash.rules().shape().is_log_shared();
        let most = if is_shared { 60 } else { 1000 };
        for round in 0..most {
            if let Err(refusal) = ask(&mut flash, &[Request::Rollback]) {
                panic!("{name}, round {round}: {refusal}");
            }
            let expected = if round % 2 == 0 { OLDER } else { OLD };
            assert_eq!(active(&mut flash), Some(expected), "{name}, round {round}");
        }
        ask(&mut flash, &update_to(NEXT)).unwrap();
        assert_eq!(active(&mut flash), Some(NEXT), "{name}");
        assert_eq!(flash.unhandled_faults(), 0, "{name}");
    }
}

/// The rollback that finds its log full, cut everywhere: the blob in use stays, or the other one comes.
#[test]
fn a_cut_while_a_full_log_is_erased() {
    let mut flash = with_old(blank("unit=8,block=2048,ecc=error"), true);
    let mut full = None;
    for round in 0..100 {
        let mut dry = copy(&flash, 0);
        ask(&mut dry, &[Request::Rollback]).unwrap();
        if dry.operation_lengths().contains(&2048) {
            full = Some(round);
            break;
        }
        ask(&mut flash, &[Request::Rollback]).unwrap();
        flash.power_up();
    }
    let round = full.expect("a log of 32 entries is full before long");
    let either = if round % 2 == 0 {
        [OLD, OLDER]
    } else {
        [OLDER, OLD]
    };
    let (runs, became_new) = cut_everywhere(&flash, &[Request::Rollback], either, true);
    println!(
        "cuts while a full log is erased: {runs} runs, all survived; {became_new} rolled back"
    );
    assert!(became_new > 0 && became_new < runs);
}

/// A clock that feeds the watchdog of the flash.
struct Watched(std::sync::Arc<firmware_sim::simulated::sim_flash::Effort>);

impl Clock for Watched {
    fn uptime_ms(&mut self) -> u64 {
        0
    }

    fn step(&mut self) {
        self.0.step();
    }
}

/// One pass over the blob when an update is finished, one more by the start behind it; and a step often enough
/// for a watchdog.
#[test]
fn long_steps_are_counted_and_interrupted() {
    for (name, rules) in REAL_PARTS {
        let mut flash = with_old(blank(rules), true);
        let shape = flash.rules().shape();
        let effort = flash.effort();
        effort.start_watching();
        let blob = u64::from(rig::blob().len() as u32);
        // Blank checks of every entry, and what stands in a few.
        let logs = 2 * (u64::from(shape.log_length()) + 64 * 64);
        let line = u64::from(shape.blob.line());
        let mut device = Device::new("a device", Watched(flash.effort()));
        let mut regions = flash.regions();
        let before = effort.bytes_read();
        let mut epoch = device.epoch(&mut regions);
        let start = effort.bytes_read() - before;
        assert!(start >= 2 * blob, "{name}: {start} bytes");
        // Either slot's blob once, its last line to the end; and the factory record.
        let most = 2 * (blob + line) + logs + line.max(64);
        assert!(start <= most, "{name}: {start} of {most} bytes for a start");
        let update = update_to(NEW);
        let (finish, chunks) = update.split_last().unwrap();
        for request in chunks {
            assert!(!matches!(epoch.respond_to(0, request), Reply::Refused(_)));
        }
        let before = effort.bytes_read();
        assert!(matches!(epoch.respond_to(0, finish), Reply::Active(_)));
        let read = effort.bytes_read() - before;
        let most = blob + line + 2 * logs + 4 * u64::from(shape.entry_length());
        assert!(
            (blob..=most).contains(&read),
            "{name}: {read} of {most} bytes to finish"
        );
        let [read, programmed, erased] = effort.most_between_steps();
        assert!(read <= 4096, "{name}: {read} bytes read without a step");
        let most = 256.max(line);
        assert!(
            programmed <= most,
            "{name}: {programmed} bytes programmed without a step"
        );
        assert!(erased <= 1, "{name}: {erased} blocks erased without a step");
    }
}

/// What the first layout left in a flash is used, rolled back to, and followed by today's records.
#[test]
fn slots_of_the_first_layout_are_read() {
    let entry = |sequence: u32, blob: &[u8], is_sealed: bool| {
        let words = [
            u32::from_le_bytes(*b"RayC"),
            sequence,
            blob.len() as u32,
            checksum(blob),
        ];
        let head: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let sum = checksum(&head);
        let seal = [u32::from_le_bytes(*b"Seal"), sum].map(u32::to_le_bytes);
        let mut entry = [
            head,
            sum.to_le_bytes().to_vec(),
            (!sum).to_le_bytes().to_vec(),
        ]
        .concat();
        entry.extend(if is_sealed {
            seal.concat()
        } else {
            vec![0xff; 8]
        });
        entry
    };
    for is_sealed in [true, false] {
        let mut image = vec![0xff; 7 * 4096];
        for (start, sequence, identity) in [(4096, 4, OLDER), (4 * 4096, 5, OLD)] {
            let blob = rig::blob_of(identity);
            // Three entries, the last of which may have lost its seal.
            for (index, is_sealed) in [(0, true), (1, true), (2, is_sealed)] {
                let entry = entry(sequence, &blob, is_sealed);
                image[start + 32 * index..][..32].copy_from_slice(&entry);
            }
            image[start + 4096..][..blob.len()].copy_from_slice(&blob);
        }
        let mut flash = SimFlash::with_contents(&image, 0).unwrap();
        assert_eq!(active(&mut flash), Some(OLD));
        let written = flash.operations() > 0;
        assert_eq!(
            written, !is_sealed,
            "a start settles what is not sealed, and nothing else"
        );
        assert_eq!(active(&mut flash), Some(OLD));
        ask(&mut flash, &[Request::Rollback]).unwrap();
        assert_eq!(active(&mut flash), Some(OLDER));
        ask(&mut flash, &update_to(NEW)).unwrap();
        assert_eq!(active(&mut flash), Some(NEW));
        let (runs, _) = cut_everywhere(&flash, &[Request::Rollback], [NEW, OLDER], false);
        assert!(runs > 0);
    }
}

/// A slot that was written for another unit or block says so.
#[test]
fn a_slot_of_another_part_is_told() {
    let of = |rules: &str| SimFlash::blank_with(rules.parse().unwrap(), 1 << 18, 0).unwrap();
    let flash = with_old(of("unit=8,block=8192"), true);
    let rules: Rules = "unit=32,block=8192".parse().unwrap();
    let mut other = SimFlash::with(rules, flash.contents(), None, 0).unwrap();
    let state = status(&mut other);
    assert_eq!(state.blob.unwrap_err(), ray_device::storage::OTHER_PART);
    let told = Refusal::NoBlob {
        open_error: ray_device::storage::OTHER_PART,
    }
    .to_string();
    assert!(told.contains("another"), "{told}");
    ask(&mut other, &update_to(NEW)).unwrap();
    assert_eq!(active(&mut other), Some(NEW));
}

/// Weak bits are the worst: with each kind of part, whatever is decided once stays so over a hundred starts.
#[test]
fn what_was_decided_stays_for_a_hundred_starts() {
    for (name, rules) in REAL_PARTS {
        let before = with_old(blank(rules), true);
        let update = update_to(NEW);
        let mut dry = copy(&before, 0);
        ask(&mut dry, &update).unwrap();
        let total = dry.operations();
        for back in 1..=8 {
            let mut flash = copy(&before, back);
            flash.plan_cut(Some(PowerCut {
                operation: total.saturating_sub(back),
                byte: 0,
                cut: Cut::Weak,
            }));
            let _ = ask(&mut flash, &update);
            let first = active(&mut flash);
            for start in 0..100 {
                assert_eq!(active(&mut flash), first, "{name}, start {start}");
            }
        }
    }
}

/// A device with a blob that it was made with, beside a flash.
fn ask_with_factory(flash: &mut SimFlash, blob: &[u8], requests: &[Request]) -> Vec<Reply> {
    let Regions { factory, slots } = flash.regions();
    let mut regions = Regions {
        factory: WithBlob { factory, blob },
        slots,
    };
    let mut device = Device::new("a device", NoClock);
    let mut epoch = device.epoch(&mut regions);
    let replies = requests.iter().map(|request| epoch.respond_to(0, request));
    replies.collect()
}

#[test]
fn the_factory_blob_is_there_when_nothing_else_is() {
    const MADE: [u8; 16] = *b"as it was made  ";
    let bytes = rig::blob_of(MADE);
    let mut aligned = vec![0_u64; bytes.len() / 8];
    bytemuck::cast_slice_mut(&mut aligned).copy_from_slice(&bytes);
    let made: &[u8] = bytemuck::cast_slice(&aligned);
    for (name, rules) in REAL_PARTS {
        let mut flash = blank(rules);
        let active = |flash: &mut SimFlash, requests: &[Request]| {
            let replies = ask_with_factory(flash, made, requests);
            if let Some(Reply::Refused(refusal)) = replies.last() {
                return Err(*refusal);
            }
            flash.power_up();
            let Some(Reply::Status(status)) =
                ask_with_factory(flash, made, &[Request::Status]).pop()
            else {
                panic!("a status");
            };
            let stays = ask_with_factory(flash, made, &[Request::Status]).pop();
            let identity = status.blob.map(|blob| blob.identity).unwrap();
            assert!(
                matches!(stays, Some(Reply::Status(again)) if again.active_slot == status.active_slot)
            );
            Ok((identity, status.active_slot))
        };
        let rollback = [Request::Rollback];
        let nothing = Err(Refusal::NothingToRollBackTo);
        assert_eq!(active(&mut flash, &[]), Ok((MADE, Some(2))), "{name}");
        assert_eq!(active(&mut flash, &rollback), nothing, "{name}");
        assert_eq!(
            active(&mut flash, &update_to(OLD)),
            Ok((OLD, Some(0))),
            "{name}"
        );
        // Back to it and forth again; updates and rollbacks go on from there.
        assert_eq!(active(&mut flash, &rollback), Ok((MADE, Some(1))), "{name}");
        assert_eq!(active(&mut flash, &rollback), Ok((OLD, Some(0))), "{name}");
        assert_eq!(active(&mut flash, &rollback), Ok((MADE, Some(1))), "{name}");
        assert_eq!(
            active(&mut flash, &update_to(NEW)),
            Ok((NEW, Some(0))),
            "{name}"
        );
        assert_eq!(active(&mut flash, &rollback), Ok((MADE, Some(1))), "{name}");
        assert_eq!(active(&mut flash, &rollback), Ok((NEW, Some(0))), "{name}");
        assert_eq!(
            active(&mut flash, &update_to(NEXT)),
            Ok((NEXT, Some(1))),
            "{name}"
        );
        // Both damaged: it is used, and stays in use should one of them read well again.
        let [a, b] = [0, 1].map(|slot| flash.blob_start(slot) + 100);
        flash.flip(a, 1);
        flash.flip(b, 1);
        let (identity, slot) = active(&mut flash, &[]).unwrap();
        assert_eq!(identity, MADE, "{name}");
        flash.flip(a, 1);
        flash.flip(b, 1);
        assert_eq!(active(&mut flash, &[]), Ok((MADE, slot)), "{name}");
        assert_eq!(
            active(&mut flash, &update_to(OLD)).unwrap().0,
            OLD,
            "{name}"
        );
        assert_eq!(flash.unhandled_faults(), 0, "{name}");
    }
    // One that cannot be opened is none.
    let mut flash = blank("unit=8");
    let damaged = ask_with_factory(&mut flash, &made[..made.len() - 8], &[Request::Status]).pop();
    assert!(matches!(damaged, Some(Reply::Status(status)) if status.blob.is_err()));
}

/// What an application knows of its cameras from elsewhere counts as a factory record.
#[test]
fn the_cameras_may_come_from_elsewhere() {
    let mut flash = blank("unit=8");
    let own = ray_device::protocol::Rig {
        serial: ray_device::protocol::name("from the chip's number"),
        cameras: heapless::Vec::new(),
    };
    let mut regions = Regions {
        factory: Some(own.clone()),
        slots: flash.regions().slots,
    };
    let mut device = Device::new("a device", NoClock);
    let mut epoch = device.epoch(&mut regions);
    let Reply::Status(status) = epoch.respond_to(0, &Request::Status) else {
        panic!("a status");
    };
    assert_eq!(status.rig, Some(own));
}

/// A driver of its own type, whose constants say what it is, as a real one.
#[derive(Debug)]
struct Typed<'a, const UNIT: usize, const BLOCK: usize>(SimRegion<'a>);

impl<const U: usize, const B: usize> ErrorType for Typed<'_, U, B> {
    type Error = SimFlashError;
}

impl<const U: usize, const B: usize> ReadNorFlash for Typed<'_, U, B> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), SimFlashError> {
        self.0.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<const U: usize, const B: usize> NorFlash for Typed<'_, U, B> {
    const WRITE_SIZE: usize = U;
    const ERASE_SIZE: usize = B;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), SimFlashError> {
        self.0.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), SimFlashError> {
        self.0.write(offset, bytes)
    }
}

impl<const U: usize, const B: usize> Flash for Typed<'_, U, B> {}

impl<const U: usize, const B: usize> MappedFlash for Typed<'_, U, B> {
    fn mapped(&self, start: u32, length: u32) -> Option<&[u8]> {
        self.0.mapped(start, length)
    }
}

/// The part is what the driver's constants say: the same bytes in the flash as by the simulated rules.
#[test]
fn the_constants_of_a_driver_are_enough() {
    fn flashed<const U: usize, const B: usize>() {
        let rules = format!("unit={U},block={B},ecc=fault");
        let simulated = with_old(blank(&rules), true);
        let mut flash = blank(&rules);
        for identity in [OLDER, OLD] {
            let Regions { factory, slots } = flash.regions();
            let mut regions = Regions {
                factory,
                slots: slots.map(|slot| Typed::<U, B>(slot.blob)),
            };
            let mut device = Device::new("a device", NoClock);
            let mut epoch = device.epoch(&mut regions);
            for request in update_to(identity) {
                let reply = epoch.respond_to(0, &request);
                assert!(!matches!(reply, Reply::Refused(_)), "{rules}: {reply:?}");
            }
        }
        assert!(flash.contents() == simulated.contents(), "{rules}");
    }
    flashed::<4, 4096>();
    flashed::<8, 2048>();
    flashed::<16, 8192>();
    flashed::<32, 131_072>();
    flashed::<128, 8192>();
    flashed::<512, 512>();
}

/// A cut while the slot that could be rolled back to is being erased: a rollback is refused or lasts.
#[test]
fn a_rollback_after_a_cut_is_refused_or_lasts() {
    let (mut refused, mut done) = (0, 0);
    for (name, rules) in REAL_PARTS {
        let before = with_old(blank(rules), true);
        let update = update_to(NEW);
        let block = before.rules().log_geometry().block as usize;
        for (operation, byte) in [(0, 0), (0, 64), (0, block - 8), (0, block), (1, 0), (2, 4)] {
            for cut in MANNERS {
                for seed in 0..3 {
                    let mut flash = copy(&before, seed);
                    flash.plan_cut(Some(PowerCut {
                        operation,
                        byte,
                        cut,
                    }));
                    let _ = ask(&mut flash, &update);
                    assert_eq!(active(&mut flash), Some(OLD), "{name}");
                    match ask(&mut flash, &[Request::Rollback]) {
                        Ok(_) => done += 1,
                        Err(_) => refused += 1,
                    }
                    let first = active(&mut flash);
                    assert!(
                        first == Some(OLD) || first == Some(OLDER),
                        "{name}: {first:?}"
                    );
                    for start in 0..6 {
                        assert_eq!(active(&mut flash), first, "{name}, start {start}");
                    }
                    assert_eq!(flash.unhandled_faults(), 0, "{name}");
                }
            }
        }
    }
    println!("rollbacks after a cut in an erase: {done} last, {refused} are refused");
    assert!(done > 0 && refused > 0);
}
