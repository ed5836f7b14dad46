//! C and D: announcements and updates that are never finished.

use std::cell::Cell;

use firmware_sim::owner::Terms;
use ray_device::manifest::Action;
use ray_device::protocol::{Refusal, Reply, RigPart};
use ray_device::storage::trust::Trust;

use super::bench::{Bench, OTHER, OWNER, identity};
use crate::owner::{announce, blob, chunk, key, manifest, order, owner, pieces, refusal, version};

/// C and D: announcements that nobody signed, or that are for another device, cost nothing.
#[test]
fn announcements_do_not_erase() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "R-7", &now_ms);
    bench.flash_well(1, &version(1));
    bench.flash_well(2, &version(2));
    let before = (bench.flash.contents().to_vec(), bench.erases());
    let new = blob(3);
    let good = manifest(&new, &version(3));
    let of = |terms: Terms| manifest(&new, &terms).to_vec();
    let with = |at: usize, byte: u8| {
        let mut manifest = good.to_vec();
        manifest[at] ^= byte;
        manifest
    };
    let stranger = {
        let text = firmware_sim::owner::manifest_of(&new, &version(3)).unwrap();
        key(9).sign_manifest(&text).to_vec()
    };
    let serial = |text: &str| Terms {
        rig_serial: Some(text.to_owned()),
        ..version(3)
    };
    let other_serial = Refusal::OtherRig {
        camera: 0,
        what: RigPart::Serial,
        expected: 0,
        found: 0,
    };
    for (manifest, expected) in [
        (vec![], Refusal::NotSigned),
        (good[1..].to_vec(), Refusal::BadManifest { format: 0 }),
        (with(4, 3), Refusal::BadManifest { format: 2 }),
        (with(104, 1), Refusal::BadSignature),
        (with(167, 128), Refusal::BadSignature),
        // What was signed is changed behind the signature's back.
        (with(8, 4), Refusal::BadSignature),
        (with(5, 1), Refusal::BadSignature),
        (with(16, 1), Refusal::OtherManifest),
        (with(24, 1), Refusal::OtherManifest),
        (with(72, 1), Refusal::BadSignature),
        (stranger, Refusal::BadSignature),
        (of(serial("R-8")), other_serial),
        (
            manifest(&blob(4), &version(4)).to_vec(),
            Refusal::OtherManifest,
        ),
        (
            of(version(1)),
            Refusal::VersionTooOld {
                version: 1,
                least: 3,
            },
        ),
        (
            of(version(2)),
            Refusal::VersionTooOld {
                version: 2,
                least: 3,
            },
        ),
    ] {
        let reply = bench.ask(OTHER, &announce(&new, &manifest));
        assert_eq!(refusal(&reply), expected);
        assert!(bench.status().update.is_none());
    }
    // Made-up ones, 10,000 times, over time.
    let mut made_up = good;
    for round in 0..10_000_u32 {
        now_ms.set(now_ms.get() + 50);
        made_up[104..108].copy_from_slice(&round.to_le_bytes());
        let mut regions = bench.flash.regions();
        let mut epoch = bench.device.epoch(&mut regions);
        // The signature is verified in one of a hundred here, which is what takes time.
        let manifest: &[u8] = if round % 100 == 0 { &made_up } else { &[] };
        let reply = epoch.respond_to(OTHER, &announce(&new, manifest));
        assert!(matches!(reply, Reply::Refused(_)), "{reply:?}");
    }
    // Even the owner's own erases nothing before its first piece came.
    for _ in 0..10_000 {
        now_ms.set(now_ms.get() + 50);
        let reply = bench.ask(OTHER, &announce(&new, &good));
        assert_eq!(reply, Reply::Receiving { received: 0 });
        let garbage = chunk(0, &[7; 512], None);
        let reply = bench.ask(OTHER, &garbage);
        assert_eq!(refusal(&reply), Refusal::WrongPiece { offset: 0 });
    }
    assert_eq!((bench.flash.contents().to_vec(), bench.erases()), before);
    let status = bench.status();
    let back = bench.ask(OWNER, &order(Action::Rollback, 0, &status));
    assert!(matches!(back, Reply::Active(_)), "{back:?}");
    assert_eq!(bench.active(), Ok(identity(1)));
    // The one for this rig is taken.
    bench.flash_well(3, &serial("R-7"));
}

/// A manifest for one rig does not fit a device that does not know its own.
#[test]
fn a_blob_signed_for_one_rig_stays_on_it() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    let terms = Terms {
        rig_serial: Some("R-7".to_owned()),
        ..version(1)
    };
    let reply = bench.flash(OTHER, 1, &terms);
    assert!(matches!(refusal(&reply), Refusal::OtherRig { .. }));
}

/// A device without an owner does not erase for an announcement either, and only so often for updates that are
/// begun and left behind.
#[test]
fn updates_that_never_end_spare_the_flash() {
    // On a device with an owner the first start of each version is beside the 32.
    for (trust, beside) in [(Trust::Anybody, 0), (owner(), 2)] {
        let now_ms = Cell::new(0);
        let mut bench = Bench::new(trust, "", &now_ms);
        let before = bench.erases();
        // Two blobs in turn: on a device with an owner a newer one, and as time passes the older one again.
        let mut refused = 0;
        for round in 0..2_000_u32 {
            now_ms.set(now_ms.get() + 6_000);
            let new = blob(1 + round % 2);
            let manifest = manifest(&new, &version(1 + round % 2));
            let reply = bench.ask(OTHER, &announce(&new, &manifest));
            assert_eq!(reply, Reply::Receiving { received: 0 });
            match bench.ask(OTHER, &pieces(&new)[0]) {
                Reply::Receiving { .. } => {}
                reply => {
                    assert!(matches!(refusal(&reply), Refusal::TooManyStarts { .. }));
                    refused += 1;
                }
            }
        }
        // In 3 hours and 20 minutes: 32 and 3 starts, each the log's block and the blob's first one.
        assert_eq!(bench.erases() - before, 2 * (35 + beside));
        assert_eq!(refused, 2_000 - 35 - beside);
        // An hour later the owner has one, and all of them after it was finished.
        now_ms.set(now_ms.get() + 3_600_000);
        bench.flash_well(3, &version(3));
        for round in 0..32 {
            now_ms.set(now_ms.get() + 6_000);
            let new = blob(4 + round % 2);
            let manifest = manifest(&new, &version(4 + round % 2));
            bench.ask(OTHER, &announce(&new, &manifest));
            let reply = bench.ask(OTHER, &pieces(&new)[0]);
            assert!(matches!(reply, Reply::Receiving { .. }), "{reply:?}");
        }
    }
}

/// A peer with two of the owner's manifests that the device has not had uses all starts up: the owner's next version is
/// taken at once all the same.
#[test]
fn recorded_manifests_do_not_keep_the_next_version_out() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    bench.flash_well(6, &version(6));
    let begin = |bench: &mut Bench<'_>, number: u32| {
        now_ms.set(now_ms.get() + 6_000);
        let new = blob(number);
        let manifest = manifest(&new, &version(number));
        bench.ask(OTHER, &announce(&new, &manifest));
        bench.ask(OTHER, &pieces(&new)[0])
    };
    let mut started = 0;
    while matches!(begin(&mut bench, 7 + started % 2), Reply::Receiving { .. }) {
        started += 1;
    }
    assert_eq!(started, 2 + 32);
    // That it was announced by somebody before, without a piece, takes nothing from it.
    let newest = blob(9);
    let announced = announce(&newest, &manifest(&newest, &version(9)));
    bench.ask(OTHER, &announced);
    let refused = begin(&mut bench, 8);
    assert!(matches!(refusal(&refused), Refusal::TooManyStarts { .. }));
    bench.flash_well(9, &version(9));
    assert_eq!(bench.active(), Ok(identity(9)));
}
