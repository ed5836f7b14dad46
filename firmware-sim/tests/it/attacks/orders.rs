//! A: rollbacks and updates given up, without the owner's order or with an old one.

use std::cell::Cell;

use firmware_sim::owner::Terms;
use ray_device::manifest::Action;
use ray_device::protocol::{Refusal, Reply, Request, name};

use super::bench::{Bench, OTHER, OWNER, identity};
use crate::owner::{announce, blob, manifest, order, owner, pieces, refusal, version};

/// A: somebody asks for a rollback, or replays an order.
#[test]
fn a_rollback_takes_an_order_for_this_device_and_this_moment() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "R-7", &now_ms);
    bench.flash_well(1, &version(1));
    bench.flash_well(2, &version(2));
    let before = bench.flash.contents().to_vec();
    let asked = bench.ask(OTHER, &Request::Rollback);
    assert_eq!(refusal(&asked), Refusal::NeedsOrder);
    let status = bench.status();
    // By a stranger's key, for a device of another number, and of another moment.
    let strangers = bench.ask(OTHER, &order(Action::Rollback, 5, &status));
    assert_eq!(refusal(&strangers), Refusal::BadSignature);
    let mut other = status.clone();
    other.rig.as_mut().unwrap().serial = name("R-8");
    let elsewhere = bench.ask(OTHER, &order(Action::Rollback, 0, &other));
    assert_eq!(refusal(&elsewhere), Refusal::BadSignature);
    let abort = bench.ask(OTHER, &Request::AbortUpdate);
    assert_eq!(refusal(&abort), Refusal::NeedsOrder);
    assert_eq!(bench.flash.contents(), before);

    let recorded = order(Action::Rollback, 0, &status);
    assert!(matches!(bench.ask(OWNER, &recorded), Reply::Active(_)));
    assert_eq!(bench.active(), Ok(identity(1)));
    let before = bench.flash.contents().to_vec();
    for _ in 0..2 {
        let replayed = bench.ask(OTHER, &recorded);
        assert_eq!(refusal(&replayed), Refusal::StaleOrder { sequence: 3 });
        bench.restart();
    }
    assert_eq!(bench.flash.contents(), before);
    // With key 1, and back again; then the first order would need its old number once more.
    let status = bench.status();
    let back = bench.ask(OWNER, &order(Action::Rollback, 1, &status));
    assert!(matches!(back, Reply::Active(_)));
    assert_eq!(bench.active(), Ok(identity(2)));
    assert_eq!(
        refusal(&bench.ask(OTHER, &recorded)),
        Refusal::StaleOrder { sequence: 4 }
    );
}

#[test]
fn an_order_to_give_up_works_for_one_update() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    let (one, two) = (blob(1), pieces(&blob(1)));
    let announced = announce(&one, &manifest(&one, &version(1)));
    let begin = |bench: &mut Bench<'_>| {
        let begun = [bench.ask(OWNER, &announced), bench.ask(OWNER, &two[0])];
        assert_eq!(begun[1], Reply::Receiving { received: 512 });
    };
    begin(&mut bench);
    let status = bench.status();
    let recorded = order(Action::Abort, 0, &status);
    assert_eq!(bench.ask(OWNER, &recorded), Reply::Aborted);
    begin(&mut bench);
    let replayed = bench.ask(OTHER, &recorded);
    assert_eq!(refusal(&replayed), Refusal::BadSignature);
    assert_eq!(bench.status().update.unwrap().received, 512);
}

/// The one at the button.
#[test]
fn a_local_call_needs_no_order_but_goes_no_further_back() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    bench.flash_well(1, &version(1));
    bench.flash_well(2, &version(2));
    let mut regions = bench.flash.regions();
    let mut epoch = bench.device.epoch(&mut regions);
    assert_eq!(epoch.abort_update(), Reply::Aborted);
    assert!(matches!(epoch.rollback(), Ok(Reply::Active(_))));
    drop(epoch);
    assert_eq!(bench.active(), Ok(identity(1)));
    let least = Terms {
        least_version: 3,
        ..version(3)
    };
    bench.flash_well(3, &least);
    let mut regions = bench.flash.regions();
    let outcome = bench.device.epoch(&mut regions).rollback();
    let too_old = Refusal::VersionTooOld {
        version: 1,
        least: 3,
    };
    assert_eq!(outcome, Err(too_old));
}
