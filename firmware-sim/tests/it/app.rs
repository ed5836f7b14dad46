//! The application under noise: whatever comes in, it answers as documented and never panics.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use ray_runtime::OpenError;

use firmware_sim::simulated::sim_flash::SimFlash;
use ray_device::app::Device;
use ray_device::frame::{FrameReader, FrameWriter, Received};
use ray_device::port::Clock;
use ray_device::protocol::{Match, NewBlob, Refusal, Reply, Request, Sighting, name};
use ray_device::session::{Responder, Session};

struct Stopped;

impl Clock for Stopped {
    fn uptime_ms(&mut self) -> u64 {
        5
    }
}

/// Feeds `bytes` to a session and returns the answers to it.
fn answers(
    session: &mut Session,
    device: &mut impl Responder,
    bytes: &[u8],
) -> Vec<Received<Reply>> {
    let mut reader = FrameReader::new();
    let mut answers = Vec::new();
    for &byte in bytes {
        let Some(frame) = session.feed(byte, device) else {
            continue;
        };
        let read: Vec<_> = frame.iter().filter_map(|&byte| reader.push(byte)).collect();
        assert_eq!(read.len(), 1, "one answer is one frame");
        answers.extend(
            read.into_iter()
                .map(|frame| frame.expect("an answer can be read")),
        );
    }
    answers
}

fn sealed(sequence: u16, request: &Request) -> Vec<u8> {
    FrameWriter::new().seal(sequence, request).unwrap().to_vec()
}

#[test]
fn without_a_blob_it_answers_and_says_so() {
    let mut flash = SimFlash::blank(5, 0).unwrap();
    let mut regions = flash.regions();
    let mut device = Device::new("a device", Stopped);
    let mut device = device.epoch(&mut regions);
    let mut session = Session::new();
    let open_error = OpenError::BadMagic { found: 0 }.code();

    let mut bytes = sealed(1, &Request::Measure(heapless::Vec::new()));
    bytes.extend(sealed(2, &Request::Status));
    let answers = answers(&mut session, &mut device, &bytes);
    assert_eq!(answers[0].sequence, 1);
    assert_eq!(
        answers[0].body,
        Reply::Refused(Refusal::NoBlob { open_error })
    );
    assert_eq!(answers[1].sequence, 2);
    let Reply::Status(status) = &answers[1].body else {
        panic!("{answers:?}")
    };
    assert_eq!(
        (status.uptime_ms, status.answered, status.refused),
        (5, 0, 1)
    );
    assert_eq!(status.blob, Err(open_error));
}

/// 20,000 rounds of noise in five kinds. Each run of bytes up to a delimiter has exactly one
/// answer, a lone delimiter has none, and a good request right behind is answered as ever.
#[test]
fn noise_never_stops_it() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut flash = SimFlash::blank(5, 0).unwrap();
    let mut regions = flash.regions();
    let mut device = Device::new("a device", Stopped);
    let mut device = device.epoch(&mut regions);
    let mut session = Session::new();
    let sighting = Sighting {
        camera: 0,
        u_px: 1.0,
        v_px: 2.0,
    };
    let asked = Match {
        id: 1,
        first: sighting,
        second: sighting,
    };
    let measure = Request::Measure(std::iter::repeat_n(asked, 5).collect());
    for round in 0..20_000_u32 {
        let mut bytes = match round % 5 {
            // Anything at all, delimiters included.
            0 => noise(&mut random, 300),
            // Nothing but small values, of which more are block lengths that fit.
            1 => noise(&mut random, 300)
                .iter()
                .map(|byte| byte % 5)
                .collect(),
            // Too long now and then.
            2 => noise(&mut random, 1500)
                .iter()
                .map(|byte| byte | 1)
                .collect(),
            // A frame that was damaged.
            3 => {
                let mut frame = sealed(7, &measure);
                for _ in 0..random.random_range(1..4) {
                    let at = random.random_range(0..frame.len() - 1);
                    frame[at] ^= 1 << random.random_range(0..8);
                }
                frame
            }
            // A whole frame, cut and glued to another.
            _ => {
                let mut frame = sealed(7, &measure);
                frame.truncate(random.random_range(0..frame.len()));
                frame.extend(sealed(8, &Request::Hello));
                frame
            }
        };
        bytes.push(0);
        let asked = bytes
            .split(|&byte| byte == 0)
            .filter(|run| !run.is_empty())
            .count();
        assert_eq!(
            answers(&mut session, &mut device, &bytes).len(),
            asked,
            "round {round}"
        );

        let answers = answers(&mut session, &mut device, &sealed(9, &Request::Hello));
        assert_eq!(answers.len(), 1, "round {round}");
        assert_eq!(answers[0].sequence, 9, "round {round}");
        assert!(matches!(answers[0].body, Reply::Hello(_)), "round {round}");
    }
}

/// Bodies that pass the checksum but were made up: they get past the frame and meet the decoder.
#[test]
fn made_up_bodies_never_stop_it() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut flash = SimFlash::blank(5, 0).unwrap();
    let mut regions = flash.regions();
    let mut device = Device::new("a device", Stopped);
    let mut device = device.epoch(&mut regions);
    let mut session = Session::new();
    let mut understood = 0;
    for round in 0..20_000_u32 {
        // The first byte is a request that exists, more often than not.
        let mut body = noise(&mut random, 120);
        if let Some(first) = body.first_mut() {
            *first %= 9;
        }
        let frame = FrameWriter::new().seal(4, &Raw(&body)).unwrap().to_vec();
        let answers = answers(&mut session, &mut device, &frame);
        assert_eq!(answers.len(), 1, "round {round}");
        assert_eq!(answers[0].sequence, 4, "round {round}");
        if answers[0].body != Reply::Refused(Refusal::UnknownMessage) {
            understood += 1;
        }
    }
    assert!(understood > 0, "no body got past the decoder");
}

fn new_blob(length: u32, checksum: u32) -> NewBlob {
    NewBlob {
        length,
        checksum,
        identity: [0; 16],
        rig_serial: None,
        signature: None,
    }
}

/// A clock that the test sets.
struct Hand<'a>(&'a core::cell::Cell<u64>);

impl Clock for Hand<'_> {
    fn uptime_ms(&mut self) -> u64 {
        self.0.get()
    }
}

#[test]
fn another_peers_update_is_in_the_way_until_it_has_been_silent_for_a_while() {
    let now_ms = core::cell::Cell::new(0);
    let mut flash = SimFlash::blank(5, 0).unwrap();
    let mut regions = flash.regions();
    let mut device = Device::new("a device", Hand(&now_ms));
    let mut device = device.epoch(&mut regions);
    let [one, other] = [1, 2].map(|sum| Request::BeginUpdate(new_blob(100, sum)));
    let receiving = |received| Reply::Receiving { received };
    let chunk = Request::Chunk(ray_device::protocol::Chunk {
        offset: 0,
        bytes: core::iter::repeat_n(7, 16).collect(),
    });

    assert_eq!(device.respond_to(1, &one), receiving(0));
    now_ms.set(4000);
    assert_eq!(device.respond_to(1, &chunk), receiving(16));
    now_ms.set(8500);
    let busy = Reply::Refused(Refusal::Busy { wait_ms: 500 });
    for request in [&other, &Request::AbortUpdate, &Request::Rollback] {
        assert_eq!(device.respond_to(2, request), busy);
    }
    let none = Reply::Refused(Refusal::NoUpdate);
    assert_eq!(device.respond_to(2, &chunk), none);
    assert_eq!(device.respond_to(2, &Request::FinishUpdate), none);
    // The same blob goes on over another connection, and the old one is out of it.
    assert_eq!(device.respond_to(3, &one), receiving(16));
    assert_eq!(device.respond_to(1, &Request::FinishUpdate), none);
    now_ms.set(13_500);
    assert_eq!(device.respond_to(2, &other), receiving(0));
    // A peer may always begin anew.
    assert_eq!(device.respond_to(2, &one), receiving(0));
    assert_eq!(device.respond_to(2, &Request::AbortUpdate), Reply::Aborted);
    assert_eq!(device.respond_to(2, &chunk), none);
}

#[test]
fn chunks_come_in_order_in_whole_units_and_a_repeat_is_acknowledged() {
    let mut flash = SimFlash::blank(5, 0).unwrap();
    let mut regions = flash.regions();
    let mut device = Device::new("a device", Stopped);
    let mut device = device.epoch(&mut regions);
    let begin = Request::BeginUpdate(new_blob(30, 1));
    device.respond_to(0, &begin);
    let mut send = |offset, fill: u8, length| {
        let bytes = core::iter::repeat_n(fill, length).collect();
        device.respond_to(
            0,
            &Request::Chunk(ray_device::protocol::Chunk { offset, bytes }),
        )
    };
    let bad = |missing| Reply::Refused(Refusal::BadChunk { missing });
    let expects = |expected| Reply::Refused(Refusal::WrongOffset { expected });
    let receiving = |received| Reply::Receiving { received };
    assert_eq!(send(0, 1, 0), bad(30));
    assert_eq!(send(0, 1, 7), bad(30));
    assert_eq!(send(0, 1, 31), bad(30));
    assert_eq!(send(8, 1, 8), expects(0));
    assert_eq!(send(0, 1, 16), receiving(16));
    assert_eq!(send(0, 1, 16), receiving(16), "a repeat");
    assert_eq!(send(0, 2, 16), expects(16), "other bytes");
    assert_eq!(send(0, 1, 8), expects(16), "a part of it");
    assert_eq!(send(u32::MAX, 1, 8), expects(16));
    assert_eq!(send(16, 3, 8), receiving(24));
    assert_eq!(send(0, 1, 16), expects(24), "a repeat of an earlier one");
    assert_eq!(
        device.respond_to(0, &Request::FinishUpdate),
        Reply::Refused(Refusal::Incomplete { received: 24 })
    );
    let last = Request::Chunk(ray_device::protocol::Chunk {
        offset: 24,
        bytes: core::iter::repeat_n(3, 6).collect(),
    });
    assert_eq!(device.respond_to(0, &last), receiving(30));
    let Reply::Refused(Refusal::ChecksumMismatch { announced, stored }) =
        device.respond_to(0, &Request::FinishUpdate)
    else {
        panic!("another checksum was announced");
    };
    let sent = [vec![1; 16], vec![3; 14]].concat();
    assert_eq!((announced, stored), (1, ray_device::frame::checksum(&sent)));
    // Given up with that.
    let none = Reply::Refused(Refusal::NoUpdate);
    assert_eq!(device.respond_to(0, &Request::FinishUpdate), none);

    // What has the announced checksum must still be a blob.
    let begin = Request::BeginUpdate(new_blob(30, stored));
    for request in [begin, Request::AbortUpdate] {
        assert!(!matches!(device.respond_to(0, &request), Reply::Refused(_)));
    }
}

#[test]
fn what_cannot_fit_or_is_for_another_rig_is_refused_before_anything_is_erased() {
    let mut flash = SimFlash::blank(5, 0).unwrap();
    let own = ray_device::protocol::Rig {
        serial: name("17"),
        cameras: heapless::Vec::new(),
    };
    ray_device::storage::rig::write(
        &mut flash.regions().factory,
        &own,
        &mut ray_device::port::NoClock,
    )
    .unwrap();
    let mut regions = flash.regions();
    let mut device = Device::new("a device", Stopped);
    let mut device = device.epoch(&mut regions);
    let mut begin = |length, serial: Option<&str>| {
        let new = NewBlob {
            rig_serial: serial.map(name),
            signature: None,
            ..new_blob(length, 1)
        };
        device.respond_to(0, &Request::BeginUpdate(new))
    };
    let limit = 4096;
    assert_eq!(
        begin(limit + 1, None),
        Reply::Refused(Refusal::TooLong { limit })
    );
    assert_eq!(
        begin(u32::MAX, None),
        Reply::Refused(Refusal::TooLong { limit })
    );
    assert_eq!(
        begin(23, None),
        Reply::Refused(Refusal::NotABlob { open_error: 1 })
    );
    assert!(matches!(
        begin(limit, Some("18")),
        Reply::Refused(Refusal::OtherRig { .. })
    ));
    drop(device);
    assert_eq!(flash.wear(), [0; 5]);
    let mut regions = flash.regions();
    let mut device = Device::new("a device", Stopped);
    let mut device = device.epoch(&mut regions);
    let new = NewBlob {
        rig_serial: Some(name("17")),
        signature: None,
        ..new_blob(limit, 1)
    };
    let begun = device.respond_to(0, &Request::BeginUpdate(new));
    assert_eq!(begun, Reply::Receiving { received: 0 });
}

fn noise(random: &mut ChaCha8Rng, max_length: usize) -> Vec<u8> {
    let mut bytes = vec![0; random.random_range(0..max_length)];
    random.fill_bytes(&mut bytes);
    bytes
}

/// Bytes that stand in a message as they are, without a length in front.
struct Raw<'a>(&'a [u8]);

impl serde::Serialize for Raw<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeTuple;
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        for byte in self.0 {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }
}
