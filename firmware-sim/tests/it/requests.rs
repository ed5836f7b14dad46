//! Every request of a peer in every state, on a device with an owner and on one without: each gets an answer
//! with a stable code, and none changes what it may not.

use std::cell::Cell;
use std::fmt::Write as _;

use embedded_storage::nor_flash::ReadNorFlash;
use firmware_sim::simulated::sim_flash::SimFlash;
use ray_device::frame::FrameWriter;
use ray_device::manifest::Action;
use ray_device::port::Flash;
use ray_device::protocol::{NoisyMatches, Reply, Request};
use ray_device::storage::trust::Trust;

use crate::owner::{
    announce, blob, chunk, device, manifest, order, owner, pieces, update, version,
};

/// Who asks in the table; peer 2 is somebody else.
const ASKING: u32 = 1;

/// What goes before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Nothing was begun.
    Idle,
    /// The asking peer has announced a blob.
    Announced,
    /// And has stored its first piece.
    ReceivingOwn,
    /// Another peer has.
    ReceivingOthers,
    /// All of it has arrived from the asking peer.
    Complete,
    /// The flash failed under the asking peer's update.
    Failed,
}

const STATES: [State; 6] = [
    State::Idle,
    State::Announced,
    State::ReceivingOwn,
    State::ReceivingOthers,
    State::Complete,
    State::Failed,
];

/// A name, and the request with the blob's number that is under way.
fn requests() -> Vec<(&'static str, Request)> {
    let (new, other) = (blob(3), blob(4));
    let good = manifest(&new, &version(3));
    let mut damaged = good;
    damaged[120] ^= 1;
    let mut misplaced = pieces(&new)[2].clone();
    if let Request::Chunk(chunk) = &mut misplaced {
        chunk.offset = u32::MAX;
    }
    let noisy = |noise_px| {
        Request::MeasureNoisy(NoisyMatches {
            noise_px,
            matches: heapless::Vec::new(),
        })
    };
    let Reply::Status(nobody) = blank_status() else {
        unreachable!()
    };
    vec![
        ("hello", Request::Hello),
        ("status", Request::Status),
        ("measure", Request::Measure(heapless::Vec::new())),
        ("measure, noisy", noisy(0.5)),
        ("measure, bad noise", noisy(f32::NAN)),
        ("self-test", Request::SelfTest),
        ("announce, unsigned", announce(&new, &[])),
        ("announce, damaged", announce(&new, &damaged)),
        ("announce, signed", announce(&new, &good)),
        (
            "announce, newer",
            announce(&other, &manifest(&other, &version(4))),
        ),
        (
            "announce, older",
            announce(&blob(1), &manifest(&blob(1), &version(1))),
        ),
        (
            "announce, in use",
            announce(&blob(2), &manifest(&blob(2), &version(2))),
        ),
        ("piece, first", pieces(&new)[0].clone()),
        ("piece, second", pieces(&new)[1].clone()),
        ("chunk, empty", chunk(0, &[], None)),
        ("chunk, garbage", chunk(512, &[7; 512], None)),
        ("chunk, misplaced", misplaced),
        ("finish", Request::FinishUpdate),
        ("abort", Request::AbortUpdate),
        ("rollback", Request::Rollback),
        ("order, stranger's", order(Action::Rollback, 9, &nobody)),
        ("order, stranger's abort", order(Action::Abort, 9, &nobody)),
    ]
}

fn blank_status() -> Reply {
    let now_ms = Cell::new(0);
    let mut flash = SimFlash::blank(9, 1).unwrap();
    let mut regions = flash.regions();
    device(Trust::Anybody, &now_ms)
        .epoch(&mut regions)
        .respond_to(ASKING, &Request::Status)
}

/// What an answer is, by its bytes: the number of the reply, or 100 and that of the refusal.
fn code(reply: &Reply) -> u8 {
    let mut writer = FrameWriter::new();
    assert!(writer.seal(1, reply).is_some(), "it fits a frame");
    let mut bytes = [0; 1024];
    let bytes = postcard::to_slice(reply, &mut bytes).unwrap();
    match *bytes {
        [0, refusal, ..] => 100 + refusal,
        [reply, ..] => reply,
        [] => unreachable!(),
    }
}

/// The flash with two blobs, of which the second is in use, or with none.
fn flash(trust: Trust, has_blob: bool) -> SimFlash {
    let mut flash = SimFlash::blank(9, 1).unwrap();
    let now_ms = Cell::new(0);
    let mut device = device(trust, &now_ms);
    for number in 1..=if has_blob { 2 } else { 0 } {
        let blob = blob(number);
        for request in update(&blob, &manifest(&blob, &version(number))) {
            let reply = device
                .epoch(&mut flash.regions())
                .respond_to(ASKING, &request);
            assert!(!matches!(reply, Reply::Refused(_)), "{reply:?}");
        }
    }
    flash
}

/// The code of the answer in this state, and whether the flash changed.
fn answer(trust: Trust, has_blob: bool, state: State, request: &Request) -> (u8, bool) {
    let mut flash = flash(trust, has_blob);
    let now_ms = Cell::new(1000);
    let mut device = device(trust, &now_ms);
    let new = blob(3);
    let before = update(&new, &manifest(&new, &version(3)));
    let (count, peer) = match state {
        State::Idle => (0, ASKING),
        State::Announced => (1, ASKING),
        State::ReceivingOwn | State::Failed => (2, ASKING),
        State::ReceivingOthers => (2, 2),
        State::Complete => (before.len() - 1, ASKING),
    };
    for request in &before[..count] {
        let reply = device.epoch(&mut flash.regions()).respond_to(peer, request);
        assert!(matches!(reply, Reply::Receiving { .. }), "{reply:?}");
    }
    if state == State::Failed {
        for block in 1..9 {
            flash.break_block(block * BLOCK);
            flash.break_unit(block * BLOCK + 1024);
            flash.break_unit(block * BLOCK + 512);
        }
        let reply = device
            .epoch(&mut flash.regions())
            .respond_to(peer, &before[2]);
        assert!(matches!(reply, Reply::Refused(_)), "{reply:?}");
        flash.repair();
    }

    let contents = flash.contents().to_vec();
    let mut regions = flash.regions();
    let mut epoch = device.epoch(&mut regions);
    let Reply::Status(status) = epoch.respond_to(ASKING, &Request::Status) else {
        panic!("no status")
    };
    let reply = epoch.respond_to(ASKING, request);
    drop(epoch);
    let has_changed = flash.contents() != contents;
    if has_changed {
        // Only a piece, or what makes a blob count, writes; and never where the blob in use is.
        let may_write = matches!(
            (request, &reply),
            (Request::Chunk(_), Reply::Receiving { .. })
                | (
                    Request::FinishUpdate | Request::Rollback | Request::Order(_),
                    Reply::Active(_)
                )
        );
        assert!(may_write, "{state:?} {reply:?}");
        let active = status.active_slot.map(usize::from);
        let places = flash.regions().slots.map(|slot| {
            let start = slot.blob.start() as usize;
            start..start + slot.blob.capacity()
        });
        for (slot, place) in places.iter().enumerate() {
            let is_same = flash.contents()[place.clone()] == contents[place.clone()];
            assert!(is_same || active != Some(slot), "{state:?} {reply:?}");
        }
        let factory = ..places[0].start;
        assert_eq!(flash.contents()[factory], contents[factory]);
    }
    (code(&reply), has_changed)
}

const BLOCK: usize = firmware_sim::simulated::sim_flash::BLOCK;

/// One row for each request: the codes in all states, `*` where the flash changed.
fn table(trust: Trust, has_blob: bool) -> String {
    let mut text = String::new();
    for (what, request) in requests() {
        let _ = write!(text, "{what:24}");
        for state in STATES {
            let (code, has_changed) = answer(trust, has_blob, state, &request);
            let mark = if has_changed { "*" } else { " " };
            let _ = write!(text, "{code:5}{mark}");
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

#[test]
fn every_request_in_every_state_has_its_answer() {
    let mut found = String::new();
    for (what, trust) in [("anybody", Trust::Anybody), ("an owner", owner())] {
        for has_blob in [false, true] {
            let blobs = if has_blob { "two blobs" } else { "no blob" };
            let _ = writeln!(found, "# {what}, {blobs}");
            let _ = write!(found, "{:24}", "");
            for state in ["idle", "ann.", "own", "other", "all", "fail"] {
                let _ = write!(found, "{state:>5} ");
            }
            found.truncate(found.trim_end().len());
            found.push('\n');
            found += &table(trust, has_blob);
        }
    }
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/requests.txt");
    if std::env::var_os("OVERWRITE").is_some() {
        std::fs::write(file, &found).unwrap();
    }
    let expected = std::fs::read_to_string(file).unwrap();
    assert_eq!(
        found, expected,
        "OVERWRITE=1 accepts what is found:\n{found}"
    );
}
