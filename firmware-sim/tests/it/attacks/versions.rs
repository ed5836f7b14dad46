//! B: older blobs, as they were recorded on the wire, and what the device remembers of versions.

use std::cell::Cell;

use firmware_sim::owner::Terms;
use firmware_sim::simulated::sim_flash::{Cut, PowerCut, SimFlash};
use ray_device::manifest::Action;
use ray_device::protocol::{Refusal, Reply, SlotState};
use ray_device::storage::trust::Distrust;

use super::bench::{Bench, OTHER, OWNER, identity};
use crate::owner::{blob, manifest, order, owner, refusal, update, version};

/// B: an older blob, as it was recorded on the wire.
#[test]
fn an_older_version_never_comes_back() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    let recorded: Vec<_> = (1..=2)
        .map(|number| update(&blob(number), &manifest(&blob(number), &version(number))))
        .collect();
    for (requests, number) in recorded.iter().zip(1..) {
        assert!(matches!(bench.ask_all(OWNER, requests), Reply::Active(_)));
        assert_eq!(bench.active(), Ok(identity(number)));
    }
    bench.flash_well(3, &version(3));
    let before = bench.flash.contents().to_vec();
    for restarts in 0..2 {
        for (requests, number) in recorded.iter().zip(1..) {
            let too_old = Refusal::VersionTooOld {
                version: number,
                least: 4,
            };
            let reply = bench.ask_all(OTHER, requests);
            assert_eq!(refusal(&reply), too_old, "{restarts}");
        }
        bench.restart();
    }
    // The one in use is acknowledged, and nothing is written for it.
    let again = bench.flash(OTHER, 3, &version(3));
    assert!(matches!(again, Reply::Active(_)), "{again:?}");
    assert_eq!(bench.flash.contents(), before);

    // A rollback does not let an older one in, nor does one after that.
    for _ in 0..3 {
        let status = bench.status();
        bench.ask(OWNER, &order(Action::Rollback, 0, &status));
        let reply = bench.ask_all(OTHER, &recorded[0]);
        assert!(matches!(refusal(&reply), Refusal::VersionTooOld { .. }));
        bench.restart();
    }
    assert_eq!(bench.status().owner.unwrap().claims.newest_version, 3);
}

#[test]
fn a_version_that_the_owner_ruled_out_is_not_used_again() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    bench.flash_well(1, &version(1));
    let least = Terms {
        least_version: 2,
        ..version(2)
    };
    bench.flash_well(2, &least);
    let too_old = Refusal::VersionTooOld {
        version: 1,
        least: 2,
    };
    let status = bench.status();
    let reply = bench.ask(OWNER, &order(Action::Rollback, 0, &status));
    assert_eq!(refusal(&reply), too_old);
    // Not even when the newest one is damaged: the device says so and takes it anew.
    damage_active(&mut bench);
    bench.restart();
    assert_eq!(bench.active(), Err(5), "the newest one is damaged");
    let SlotState::Unusable { open_error, .. } = bench.status().slots[0] else {
        panic!("version 1 is used")
    };
    assert_eq!(open_error, Distrust::VersionTooOld.code());
    let claims = bench.status().owner.unwrap().claims;
    assert_eq!((claims.newest_version, claims.least_version), (2, 2));
    let older = bench.flash(OTHER, 1, &version(1));
    assert_eq!(refusal(&older), too_old);
    bench.flash_well(2, &least);
    assert_eq!(bench.active(), Ok(identity(2)));
}

#[test]
fn the_newest_version_is_taken_once_more_where_it_was_lost() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    bench.flash_well(1, &version(1));
    bench.flash_well(2, &version(2));
    damage_active(&mut bench);
    bench.restart();
    assert_eq!(bench.active(), Ok(identity(1)));
    let claims = bench.status().owner.unwrap().claims;
    assert_eq!(claims.newest_version, 2);
    bench.flash_well(2, &version(2));
    assert_eq!(bench.active(), Ok(identity(2)));
}

/// Flips a bit of the active blob, in its slot.
fn damage_active(bench: &mut Bench<'_>) {
    let Ok(identity) = bench.active() else {
        panic!("nothing is active")
    };
    let contents = bench.flash.contents();
    let at = contents
        .windows(16)
        .position(|window| window == identity)
        .unwrap();
    bench.flash.flip(at, 0);
}

/// Wherever power fails during an update or a rollback, what the owner signed last is not forgotten: no older
/// version comes in, and none that was ruled out is used.
#[test]
fn a_cut_of_power_undercuts_no_claim() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    bench.flash_well(1, &version(1));
    bench.flash_well(2, &version(2));
    let before = bench.flash.contents().to_vec();
    let least = Terms {
        least_version: 2,
        ..version(3)
    };
    let new = blob(3);
    let updating = update(&new, &manifest(&new, &least));
    let status = bench.status();
    let rolling_back = vec![order(Action::Rollback, 0, &status)];
    let older = update(&blob(1), &manifest(&blob(1), &version(1)));
    let mut cuts = 0;
    for requests in [&updating, &rolling_back] {
        for operation in 0.. {
            let mut is_beyond = false;
            for cut in [Cut::Clean, Cut::Torn, Cut::Weak] {
                bench.flash = SimFlash::with_contents(&before, operation).unwrap();
                bench.restart();
                bench.flash.plan_cut(Some(PowerCut {
                    operation,
                    byte: 4,
                    cut,
                }));
                for request in requests {
                    if bench.flash.has_power() {
                        bench.ask(OWNER, request);
                    }
                }
                let has_ended = bench.flash.has_power();
                bench.flash.power_up();
                for _ in 0..2 {
                    bench.restart();
                    let claims = bench.status().owner.unwrap().claims;
                    let is_new = bench.active() == Ok(identity(3));
                    let expected = if is_new { (3, 2) } else { (2, 0) };
                    assert_eq!((claims.newest_version, claims.least_version), expected);
                    let is_back = bench.active() == Ok(identity(1));
                    match bench.ask_all(OTHER, &older) {
                        Reply::Refused(Refusal::VersionTooOld { .. }) => {}
                        // It is in use, as the owner ordered: nothing is sent.
                        Reply::Active(_) if is_back => {}
                        other => panic!("{operation} {cut:?}: {other:?}"),
                    }
                }
                cuts += 1;
                is_beyond = has_ended;
            }
            if is_beyond {
                break;
            }
        }
    }
    println!("cuts of power on a device with an owner: {cuts}");
    assert!(cuts > 1000, "{cuts}");
}
