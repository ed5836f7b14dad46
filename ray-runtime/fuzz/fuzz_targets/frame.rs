//! Whatever bytes come over the link: no panic, and the next valid request is answered, with the blob
//! that was active before.
//!
//! An input that begins with 1 is the body of one frame, sealed here with the right checksum, which no
//! mutation would find; any other is the stream of bytes itself.

#![no_main]

use std::sync::LazyLock;

use firmware_sim::simulated::sim_flash::{BLOCK, SimFlash};
use libfuzzer_sys::fuzz_target;
use ray_device::app::Device;
use ray_device::frame::{DELIMITER, FrameReader, FrameWriter, Received, checksum};
use ray_device::port::Clock;
use ray_device::protocol::{Chunk, MAX_CHUNK, Match, NewBlob, Reply, Request, Sighting};
use ray_device::session::Session;
use ray_runtime::{Aligned, RayBlob};
use serde::ser::{Serialize, SerializeTuple, Serializer};

/// A flash that was sent the golden blob.
static FLASH: LazyLock<Vec<u8>> = LazyLock::new(|| {
    static BLOB: &Aligned<[u8]> =
        &Aligned(*include_bytes!("../../../data/golden/stereo-v3-small.rays"));
    let bytes = &BLOB.0;
    let mut flash = SimFlash::blank(5, 0).expect("five blocks are enough");
    assert!(bytes.len() <= BLOCK);
    let mut regions = flash.regions();
    let mut device = Device::new("fuzz", Stopped);
    let mut epoch = device.epoch(&mut regions);
    let mut ask = |request| assert!(!matches!(epoch.respond_to(0, &request), Reply::Refused(_)));
    ask(Request::BeginUpdate(NewBlob {
        length: bytes.len() as u32,
        checksum: checksum(bytes),
        identity: *RayBlob::open(bytes).expect("a golden blob").identity(),
        rig_serial: None,
        manifest: heapless::Vec::new(),
    }));
    for (offset, bytes) in (0..).step_by(MAX_CHUNK).zip(bytes.chunks(MAX_CHUNK)) {
        let bytes = heapless::Vec::from_slice(bytes).expect("a chunk");
        ask(Request::Chunk(Chunk {
            offset,
            bytes,
            next: None,
        }));
    }
    ask(Request::FinishUpdate);
    flash.contents().to_vec()
});

struct Stopped;

impl Clock for Stopped {
    fn uptime_ms(&mut self) -> u64 {
        0
    }
}

/// The frame of a request that the golden blob answers with a point.
static VALID: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let sighting = |camera, u_px, v_px| Sighting { camera, u_px, v_px };
    let mut matches = heapless::Vec::new();
    let _ = matches.push(Match {
        id: 7,
        first: sighting(0, 30.0, 20.5),
        second: sighting(1, 33.0, 21.0),
    });
    let mut writer = FrameWriter::new();
    let frame = writer.seal(0x1234, &Request::Measure(matches));
    frame.expect("a short message").to_vec()
});

fuzz_target!(|input: &[u8]| {
    let mut flash = SimFlash::with_contents(&FLASH, 0).expect("whole blocks");
    let mut regions = flash.regions();
    let mut device = Device::new("fuzz", Stopped);
    let mut device = device.epoch(&mut regions);
    let mut session = Session::new();
    let mut writer = FrameWriter::new();
    let stream = match input {
        [1, body @ ..] => writer.seal(9, &Raw(body)).unwrap_or_default(),
        stream => stream,
    };
    for byte in stream {
        if let Some(frame) = session.feed(*byte, &mut device) {
            reply(frame);
        }
    }
    // What is unfinished ends here.
    if let Some(frame) = session.feed(DELIMITER, &mut device) {
        reply(frame);
    }
    let mut answers = Vec::new();
    for byte in VALID.iter() {
        if let Some(frame) = session.feed(*byte, &mut device) {
            answers.push(reply(frame));
        }
    }
    let [
        Received {
            sequence: 0x1234,
            body: Reply::Measured(points),
        },
    ] = &answers[..]
    else {
        panic!("{answers:?}");
    };
    assert!(points.len() == 1 && points[0].id == 7 && points[0].outcome.is_ok());
});

/// A body of these bytes and no others.
struct Raw<'a>(&'a [u8]);

impl Serialize for Raw<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        for byte in self.0 {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }
}

/// The reply in a frame, which must be whole.
fn reply(frame: &[u8]) -> Received<Reply> {
    let (last, inner) = frame.split_last().expect("a frame has a delimiter");
    assert!(*last == DELIMITER && !inner.contains(&DELIMITER));
    let mut reader = FrameReader::new();
    let replies: Vec<_> = frame
        .iter()
        .filter_map(|byte| reader.push::<Reply>(*byte))
        .collect();
    let [Ok(reply)] = &replies[..] else {
        panic!("{replies:?}");
    };
    reply.clone()
}
