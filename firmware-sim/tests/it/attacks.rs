//! What somebody who reaches a device, but does not have its owner's key, can do to it: attacks A to E, their
//! variants, and what an owner does after a key was stolen.

use std::cell::Cell;

use firmware_sim::owner::Terms;
use firmware_sim::simulated::sim_flash::{Cut, PowerCut, SimFlash};
use ray_device::app::Device;
use ray_device::frame::FrameWriter;
use ray_device::manifest::Action;
use ray_device::port::NoClock;
use ray_device::protocol::{
    BlobStatus, CameraStatus, Refusal, Reply, Request, Rig, RigPart, SlotState, Status, StoredBlob,
    name,
};
use ray_device::storage::transfer::Peer;
use ray_device::storage::trust::{Distrust, Keys, Trust};

use crate::owner::{
    Hand, announce, blob, chunk, device, key, manifest, order, owner, pieces, refusal, update,
    version,
};
use crate::rig;

const OWNER: Peer = 1;
const OTHER: Peer = 2;

/// A device and its flash; each request is answered by an epoch of its own, as behind a restart of the session.
struct Bench<'a> {
    flash: SimFlash,
    device: Device<Hand<'a>>,
    now_ms: &'a Cell<u64>,
    trust: Trust,
}

impl<'a> Bench<'a> {
    fn new(trust: Trust, serial: &str, now_ms: &'a Cell<u64>) -> Self {
        let mut flash = SimFlash::blank(9, 1).unwrap();
        if !serial.is_empty() {
            let cameras = rig::CAMERAS.map(|(text, width_px, height_px)| CameraStatus {
                name: name(text),
                width_px,
                height_px,
            });
            let own = Rig {
                serial: name(serial),
                cameras: cameras.into_iter().collect(),
            };
            ray_device::storage::rig::write(&mut flash.regions().factory, &own, &mut NoClock)
                .unwrap();
        }
        Self {
            flash,
            device: device(trust, now_ms),
            now_ms,
            trust,
        }
    }

    fn ask(&mut self, peer: Peer, request: &Request) -> Reply {
        let mut regions = self.flash.regions();
        self.device.epoch(&mut regions).respond_to(peer, request)
    }

    /// All of them, up to the first that ends the update, whose answer this is.
    fn ask_all(&mut self, peer: Peer, requests: &[Request]) -> Reply {
        let mut last = None;
        for request in requests {
            let reply = self.ask(peer, request);
            let is_end = matches!(reply, Reply::Refused(_) | Reply::Active(_));
            last = Some(reply);
            if is_end {
                break;
            }
        }
        last.unwrap()
    }

    fn flash(&mut self, peer: Peer, number: u32, terms: &Terms) -> Reply {
        let blob = blob(number);
        self.ask_all(peer, &update(&blob, &manifest(&blob, terms)))
    }

    #[track_caller]
    fn flash_well(&mut self, number: u32, terms: &Terms) -> StoredBlob {
        match self.flash(OWNER, number, terms) {
            Reply::Active(stored) => stored,
            other => panic!("{other:?}"),
        }
    }

    fn status(&mut self) -> Status {
        match self.ask(OWNER, &Request::Status) {
            Reply::Status(status) => status,
            other => panic!("{other:?}"),
        }
    }

    /// The identity of the blob in use, or why there is none.
    fn active(&mut self) -> Result<[u8; 16], u8> {
        self.status()
            .blob
            .map(|BlobStatus { identity, .. }| identity)
    }

    fn restart(&mut self) {
        self.device = device(self.trust, self.now_ms);
    }

    fn erases(&mut self) -> u32 {
        self.flash.wear().iter().sum()
    }
}

fn identity(number: u32) -> Result<[u8; 16], u8> {
    let mut identity = [b'v'; 16];
    identity[..4].copy_from_slice(&number.to_le_bytes());
    Ok(identity)
}

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
    assert_eq!(bench.active(), identity(1));
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
    assert_eq!(bench.active(), identity(2));
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
    assert_eq!(bench.active(), identity(1));
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
        assert_eq!(bench.active(), identity(number));
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
    assert_eq!(bench.active(), identity(2));
}

#[test]
fn the_newest_version_is_taken_once_more_where_it_was_lost() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    bench.flash_well(1, &version(1));
    bench.flash_well(2, &version(2));
    damage_active(&mut bench);
    bench.restart();
    assert_eq!(bench.active(), identity(1));
    let claims = bench.status().owner.unwrap().claims;
    assert_eq!(claims.newest_version, 2);
    bench.flash_well(2, &version(2));
    assert_eq!(bench.active(), identity(2));
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
    assert_eq!(bench.active(), identity(1));
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
    for trust in [Trust::Anybody, owner()] {
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
        assert_eq!(bench.erases() - before, 2 * 35);
        assert_eq!(refused, 2_000 - 35);
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

/// The time that a request takes over a line of 115,200 baud and in the device, ms: its bytes, and for a chunk
/// that is stored the programming of its units and one erase.
fn cost_ms(request: &Request, reply: &Reply) -> f64 {
    let mut writer = FrameWriter::new();
    let bytes = writer.seal(1, request).unwrap().len() + writer.seal(1, reply).unwrap().len();
    let stored = matches!(
        (request, reply),
        (Request::Chunk(_), Reply::Receiving { .. })
    );
    bytes as f64 * 10.0 / 115.2 + if stored { 64.0 * 0.09 + 85.0 } else { 1.0 }
}

/// E: somebody keeps sending what is out of place while the owner updates. Times with and without, in the time
/// of the simulation; `attack` makes the other's next request, `pause_ms` apart.
fn times_of_an_update(
    trust: Trust,
    pause_ms: f64,
    owner_pause_ms: f64,
    attack: &dyn Fn(u32) -> Request,
) -> [f64; 2] {
    [false, true].map(|is_attacked| {
        let now_ms = Cell::new(0);
        let mut bench = Bench::new(trust, "", &now_ms);
        bench.flash_well(1, &version(1));
        let start = 10_000.0;
        let mut now = start;
        let mut next_attack = start;
        let mut attacks = 0;
        let new = blob(2);
        let mut requests = update(&new, &manifest(&new, &version(2))).into_iter();
        let mut request = requests.next();
        while let Some(asked) = &request {
            while is_attacked && next_attack <= now {
                let attack = attack(attacks);
                now_ms.set(now as u64);
                let reply = bench.ask(OTHER, &attack);
                now += cost_ms(&attack, &reply);
                next_attack += pause_ms;
                attacks += 1;
                assert!(attacks < 10_000, "the update does not end");
            }
            now_ms.set(now as u64);
            let reply = bench.ask(OWNER, asked);
            now += cost_ms(asked, &reply) + owner_pause_ms;
            match reply {
                Reply::Refused(Refusal::Busy { wait_ms }) => now += f64::from(wait_ms),
                Reply::Refused(refusal) => panic!("{refusal}"),
                _ => request = requests.next(),
            }
        }
        assert_eq!(bench.active(), identity(2));
        now - start
    })
}

#[test]
fn misplaced_chunks_and_garbage_do_not_keep_the_owner_out() {
    let new = blob(2);
    let foreign = blob(9);
    let made_up = manifest(
        &foreign,
        &Terms {
            key: 0,
            ..version(9)
        },
    );
    let mut made_up = made_up.to_vec();
    made_up[104] ^= 1;
    let misplaced = |_| chunk(0x1000_0000, &[7; 8], None);
    let garbage = |_| chunk(0, &[7; 512], Some([9; 32]));
    let recorded = pieces(&new);
    let everything = |round: u32| match round % 6 {
        0 => announce(&foreign, &made_up),
        1 => garbage(0),
        2 => Request::AbortUpdate,
        3 => Request::FinishUpdate,
        4 => Request::Rollback,
        _ => recorded[round as usize % recorded.len()].clone(),
    };
    let cases: [(&str, f64, f64, &dyn Fn(u32) -> Request); 4] = [
        (
            "misplaced, every 4.9 s, a slow owner",
            4_900.0,
            2_000.0,
            &misplaced,
        ),
        ("misplaced, every 4.9 s", 4_900.0, 0.0, &misplaced),
        ("garbage, five a second", 200.0, 0.0, &garbage),
        ("everything in turn, five a second", 200.0, 0.0, &everything),
    ];
    for (what, pause_ms, owner_pause_ms, attack) in cases {
        let [alone, attacked] = times_of_an_update(owner(), pause_ms, owner_pause_ms, attack);
        println!("{what}: {alone:.0} ms alone, {attacked:.0} ms with it");
        assert!(attacked <= 2.0 * alone, "{what}: {alone} {attacked}");
    }
    // Without an owner, somebody who only announces and misplaces is in nobody's way.
    let other = |round: u32| match round % 2 {
        0 => announce(&foreign, &[]),
        _ => misplaced(0),
    };
    let [alone, attacked] = times_of_an_update(Trust::Anybody, 4_900.0, 2_000.0, &other);
    println!("no owner, announced and misplaced: {alone:.0} ms alone, {attacked:.0} ms with it");
    assert!(attacked <= 2.0 * alone, "{alone} {attacked}");
}

/// Whoever replays what the owner sent only helps, and a newer version goes first.
#[test]
fn it_does_not_matter_who_brings_the_owners_pieces() {
    let now_ms = Cell::new(0);
    let mut bench = Bench::new(owner(), "", &now_ms);
    let [new, newer] = [blob(1), blob(2)];
    let [first, second] = [&new, &newer].map(|blob| pieces(blob));
    let begin = announce(&new, &manifest(&new, &version(1)));
    bench.ask(OWNER, &begin);
    let receiving = |received| Reply::Receiving { received };
    assert_eq!(bench.ask(OWNER, &first[0]), receiving(512));
    assert_eq!(bench.ask(OTHER, &first[1]), receiving(1024));
    assert_eq!(bench.ask(OWNER, &first[1]), receiving(1024));
    assert_eq!(
        bench.ask(OWNER, &first[0]),
        receiving(1024),
        "an older repeat"
    );
    // Announced anew, from anywhere, with whatever else is said beside the manifest.
    let Request::BeginUpdate(mut again) = begin.clone() else {
        unreachable!()
    };
    again.rig_serial = Some(name("anything"));
    again.checksum ^= 1;
    assert_eq!(
        bench.ask(OTHER, &Request::BeginUpdate(again)),
        receiving(1024)
    );
    // Another of the same version waits, a newer one does not, and then the older one waits.
    let same = blob(3);
    let same = announce(&same, &manifest(&same, &version(1)));
    assert_eq!(
        refusal(&bench.ask(OWNER, &same)),
        Refusal::Busy { wait_ms: 5000 }
    );
    let begin_newer = announce(&newer, &manifest(&newer, &version(2)));
    assert_eq!(bench.ask(OWNER, &begin_newer), receiving(0));
    assert_eq!(
        refusal(&bench.ask(OTHER, &begin)),
        Refusal::Busy { wait_ms: 5000 }
    );
    assert_eq!(
        refusal(&bench.ask(OTHER, &first[0])),
        Refusal::WrongPiece { offset: 0 }
    );
    now_ms.set(4_000);
    assert_eq!(bench.ask(OWNER, &second[0]), receiving(512));
    now_ms.set(8_999);
    assert_eq!(
        refusal(&bench.ask(OTHER, &begin)),
        Refusal::Busy { wait_ms: 1 }
    );
    now_ms.set(9_000);
    assert_eq!(bench.ask(OTHER, &begin), receiving(0));
}

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
        assert_eq!(bench.active(), identity(4));
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
    assert_eq!(bench.active(), identity(1));

    // A blob that was signed beforehand, while the device had no owner yet, is used at once.
    let mut bench = Bench::new(Trust::Anybody, "", &now_ms);
    bench.flash_well(1, &version(4));
    assert!(bench.status().owner.is_none());
    bench.trust = owner();
    bench.restart();
    assert_eq!(bench.active(), identity(1));
    assert_eq!(bench.status().owner.unwrap().claims.newest_version, 4);
    // A device with another owner does not use it.
    bench.trust = Trust::Owner(Keys::one(key(9).public()));
    bench.restart();
    assert_eq!(bench.active(), Err(Distrust::BadSignature.code()));
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
                    let is_new = bench.active() == identity(3);
                    let expected = if is_new { (3, 2) } else { (2, 0) };
                    assert_eq!((claims.newest_version, claims.least_version), expected);
                    let is_back = bench.active() == identity(1);
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
