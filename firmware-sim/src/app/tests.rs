//! The application under noise: whatever comes in, it answers as documented and never panics.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Device, open};
use crate::frame::{FrameReader, FrameWriter, Received};
use crate::port::{BlobStore, Clock};
use crate::protocol::{Match, Refusal, Reply, Request, Sighting};
use crate::session::Session;

struct NoFlash;

impl BlobStore for NoFlash {
    fn active_blob(&self) -> &[u8] {
        &[]
    }
}

struct Stopped;

impl Clock for Stopped {
    fn uptime_ms(&mut self) -> u64 {
        5
    }
}

/// Feeds `bytes` to a session and returns the answers to it.
fn answers(
    session: &mut Session,
    device: &mut Device<'_, Stopped>,
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
    let mut device = Device::boot("a device", &NoFlash, Stopped);
    let mut session = Session::new();
    let open_error = open(&[]).unwrap_err().code();

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
    let mut device = Device::boot("a device", &NoFlash, Stopped);
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
    let mut device = Device::boot("a device", &NoFlash, Stopped);
    let mut session = Session::new();
    let mut understood = 0;
    for round in 0..20_000_u32 {
        // The first byte is a request that exists, more often than not.
        let mut body = noise(&mut random, 120);
        if let Some(first) = body.first_mut() {
            *first %= 4;
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
