//! E: others who send while the owner updates.

use std::cell::Cell;

use firmware_sim::owner::Terms;
use ray_device::frame::FrameWriter;
use ray_device::protocol::{Refusal, Reply, Request, name};
use ray_device::storage::trust::Trust;

use super::bench::{Bench, OTHER, OWNER, identity};
use crate::owner::{announce, blob, chunk, manifest, owner, pieces, refusal, update, version};

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

/// The other's request of this number.
type Attack<'a> = &'a dyn Fn(u32) -> Request;

/// E: somebody keeps sending what is out of place while the owner updates. Times with and without, in the time
/// of the simulation; `attack` makes the other's next request, `pause_ms` apart.
fn times_of_an_update(
    trust: Trust,
    pause_ms: f64,
    owner_pause_ms: f64,
    attack: Attack<'_>,
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
        assert_eq!(bench.active(), Ok(identity(2)));
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
    let cases: [(&str, f64, f64, Attack<'_>); 4] = [
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
