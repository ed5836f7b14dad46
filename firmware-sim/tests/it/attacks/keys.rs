//! What an owner does after a key was stolen, and with blobs that nobody signed.

use std::cell::Cell;

use firmware_sim::owner::Terms;
use ray_device::manifest::Action;
use ray_device::protocol::{Refusal, Reply, Request};
use ray_device::storage::trust::{Distrust, Keys, Trust};

use super::bench::{Bench, OTHER, OWNER, identity};
use crate::owner::{blob, key, order, owner, refusal, update, version};

/// Key 0 was stolen, and whoever has it used up all versions.
#[test]
fn with_key_1_the_owner_goes_on_after_key_0_was_stolen() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    bench.flash_well(1, &version(1));
    bench.flash_well(2, &version(u32::MAX));
    let stolen = Terms {
        least_version: u32::MAX,
        ..version(u32::MAX)
    };
    assert!(matches!(
        refusal(&bench.flash(OTHER, 3, &stolen)),
        Refusal::VersionTooOld { .. }
    ));
    let handed_over = Terms {
        key: 1,
        least_key: 1,
        ..version(5)
    };
    bench.flash_well(4, &handed_over);
    for restarts in 0..2 {
        let retired = Refusal::KeyRetired { key: 0 };
        let reply = bench.flash(OTHER, 3, &stolen);
        assert_eq!(refusal(&reply), retired, "{restarts}");
        let status = bench.status();
        let reply = bench.ask(OTHER, &order(Action::Rollback, 0, &status));
        assert_eq!(refusal(&reply), retired);
        // What key 0 signed is not gone back to, not even by the owner.
        let reply = bench.ask(OWNER, &order(Action::Rollback, 1, &status));
        assert_eq!(refusal(&reply), retired);
        assert_eq!(bench.active(), Ok(identity(4)));
        bench.restart();
    }
    let next = Terms {
        key: 1,
        ..version(6)
    };
    bench.flash_well(5, &next);
    let status = bench.status();
    assert_eq!(status.owner.unwrap().claims.newest_version, 6);
    let back = bench.ask(OWNER, &order(Action::Rollback, 1, &status));
    assert!(matches!(back, Reply::Active(_)), "{back:?}");
}

/// What came while anybody could send it is not used once the device has an owner, who is told.
#[test]
fn an_unsigned_blob_in_its_slot_is_not_used_by_a_device_with_an_owner() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(Trust::Anybody, "", &now_ms);
    let one = blob(1);
    let unsigned = update(&one, &[]);
    assert!(matches!(bench.ask_all(OWNER, &unsigned), Reply::Active(_)));
    bench.trust = owner();
    bench.restart();
    assert_eq!(bench.active(), Err(Distrust::NotSigned.code()));
    let measure = bench.ask(OTHER, &Request::Measure(heapless::Vec::new()));
    let text = refusal(&measure).to_string();
    assert!(text.contains("not signed"), "{text}");
    // The owner signs it and flashes it again.
    bench.flash_well(1, &version(1));
    assert_eq!(bench.active(), Ok(identity(1)));

    // A blob that was signed beforehand, while the device had no owner yet, is used at once.
    let mut bench = Bench::new(Trust::Anybody, "", &now_ms);
    bench.flash_well(1, &version(4));
    assert!(bench.status().owner.is_none());
    bench.trust = owner();
    bench.restart();
    assert_eq!(bench.active(), Ok(identity(1)));
    assert_eq!(bench.status().owner.unwrap().claims.newest_version, 4);
    // A device with another owner does not use it.
    bench.trust = Trust::Owner(Keys::one(key(9).public()));
    bench.restart();
    assert_eq!(bench.active(), Err(Distrust::BadSignature.code()));
}
