//! What else there is to a part: logs of the first layout, a slot that was written for another, the factory's blob,
//! cameras that are known from elsewhere, drivers of their own type, and how much is read between two looks at
//! the watchdog.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use firmware_sim::simulated::sim_flash::{Effort, Rules, SimFlash, SimFlashError, SimRegion};
use ray_device::app::Device;
use ray_device::frame::checksum;
use ray_device::port::{Clock, Flash, MappedFlash, NoClock, Regions};
use ray_device::protocol::{Refusal, Reply, Request};
use ray_device::storage::factory::WithBlob;

use crate::parts::{REAL_PARTS, blank, cut_everywhere};
use crate::power_cuts::{NEW, NEXT, OLD, OLDER, active, ask, status, update_to, with_old};
use crate::rig;

/// A clock that feeds the watchdog of the flash.
struct Watched(std::sync::Arc<Effort>);

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
