//! The bytes of every message. A test that fails here means that devices in the field no longer
//! understand: raise `PROTOCOL_VERSION`, or do not change the message.

use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{
    Arithmetic, BlobStatus, CameraStatus, Chunk, FlashOperation, Hello, MAX_CAMERAS_LISTED,
    MAX_CHUNK, MAX_MATCHES, MAX_NAME, Match, Measured, Name, NewBlob, NoisyMatches, Point, Refusal,
    Reply, Request, Rig, RigPart, SelfTestReport, Sighting, Signature, SlotState, Status,
    StoredBlob, UpdateStatus, name,
};
use crate::frame::{FrameWriter, MAX_MESSAGE};
use crate::health::{GapReport, Predicted};

/// Asserts that `message` is exactly `bytes`, in both directions.
fn assert_bytes<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(
    message: &T,
    bytes: &[u8],
) {
    assert_eq!(
        postcard::to_slice(message, &mut [0; MAX_MESSAGE]).unwrap(),
        bytes,
        "{message:?}"
    );
    assert_eq!(&postcard::from_bytes::<T>(bytes).unwrap(), message);
}

fn vec<T: Clone, const N: usize>(items: &[T]) -> Vec<T, N> {
    items.iter().cloned().collect()
}

#[test]
fn bytes_of_requests() {
    assert_bytes(&Request::Hello, &[0]);
    assert_bytes(&Request::Status, &[1]);
    let asked = Match {
        id: 300,
        first: Sighting {
            camera: 0,
            u_px: 1.0,
            v_px: -2.0,
        },
        second: Sighting {
            camera: 1,
            u_px: 0.5,
            v_px: 1.5,
        },
    };
    #[rustfmt::skip]
    assert_bytes(&Request::Measure(vec(&[asked])), &[
        2, 1,                   // measure, one match
        0xac, 0x02,             // id 300
        0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0, // camera 0 at (1, -2)
        1, 0, 0, 0, 0x3f, 0, 0, 0xc0, 0x3f, // camera 1 at (0.5, 1.5)
    ]);
    let noisy = NoisyMatches {
        noise_px: 0.5,
        matches: vec(&[asked]),
    };
    #[rustfmt::skip]
    assert_bytes(&Request::MeasurePoints(vec(&[asked])), &[
        10, 1,
        0xac, 0x02,
        0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0,
        1, 0, 0, 0, 0x3f, 0, 0, 0xc0, 0x3f,
    ]);
    #[rustfmt::skip]
    assert_bytes(&Request::MeasureNoisy(noisy), &[
        9, 0, 0, 0, 0x3f, 1,    // measure with 0.5 px, one match
        0xac, 0x02,
        0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0,
        1, 0, 0, 0, 0x3f, 0, 0, 0xc0, 0x3f,
    ]);
}

#[test]
fn bytes_of_an_update() {
    let new = NewBlob {
        length: 200,
        checksum: 1,
        identity: [9; 16],
        rig_serial: Some(name("s")),
        signature: None,
    };
    #[rustfmt::skip]
    assert_bytes(&Request::BeginUpdate(new), &[
        3, 0xc8, 0x01, 1,
        9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9,
        1, 1, b's', 0,
    ]);
    let chunk = Chunk {
        offset: 128,
        bytes: vec(&[5, 255, 0]),
    };
    assert_bytes(&Request::Chunk(chunk), &[4, 0x80, 0x01, 3, 5, 255, 0]);
    assert_bytes(&Request::FinishUpdate, &[5]);
    assert_bytes(&Request::AbortUpdate, &[6]);
    assert_bytes(&Request::Rollback, &[7]);
    assert_bytes(&Request::SelfTest, &[8]);

    assert_bytes(&Reply::Receiving { received: 128 }, &[4, 0x80, 0x01]);
    #[rustfmt::skip]
    assert_bytes(&Reply::Active(STORED), &[
        5, 1, 2, 3, 4,
        6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6,
    ]);
    assert_bytes(&Reply::Aborted, &[6]);
    let report = SelfTestReport {
        tests: 3,
        equal: 2,
        unanswered: 1,
        worst_mm: 1.0,
        worst_direction: 0.5,
    };
    assert_bytes(
        &Reply::SelfTested(report),
        &[7, 3, 2, 1, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x3f],
    );
}
const GAPS: GapReport = GapReport {
    points: 3,
    mean_signed_mm: -1.0,
    mean_size_mm: 2.0,
    within_95_mm: 4.0,
    predicted: Some(Predicted {
        points: 2,
        mean_sigma_mm: 0.5,
        shift: -1.0,
        spread: 1.0,
    }),
};

const STORED: StoredBlob = StoredBlob {
    slot: 1,
    sequence: 2,
    length: 3,
    checksum: 4,
    identity: [6; 16],
};

#[test]
fn bytes_of_an_updates_refusals() {
    use Refusal as R;
    let rig = R::OtherRig {
        camera: 1,
        what: RigPart::Height,
        expected: 3,
        found: 4,
    };
    let failed = R::FlashFailed {
        operation: FlashOperation::Program,
        address: 128,
    };
    for (refusal, bytes) in [
        (R::TooLong { limit: 1 }, &[6, 1][..]),
        (R::WrongOffset { expected: 128 }, &[7, 0x80, 0x01]),
        (R::BadChunk { missing: 8 }, &[8, 8]),
        (R::NoUpdate, &[9]),
        (R::Incomplete { received: 5 }, &[10, 5]),
        (
            R::ChecksumMismatch {
                announced: 1,
                stored: 2,
            },
            &[11, 1, 2],
        ),
        (R::NotABlob { open_error: 5 }, &[12, 5]),
        (R::OtherIdentity, &[13]),
        (rig, &[14, 1, 3, 3, 4]),
        (R::NothingToRollBackTo, &[15]),
        (R::LogFull, &[16]),
        (failed, &[17, 2, 0x80, 0x01]),
        (R::Busy { wait_ms: 7 }, &[18, 7]),
        (R::NotSigned, &[19]),
        (R::BadSignature, &[20]),
        (R::BadNoise, &[21]),
    ] {
        assert_bytes(&Reply::Refused(refusal), &[&[0], bytes].concat());
        // In words, of which the last say what to do.
        assert!(refusal.to_string().len() > 40, "{refusal}");
    }
}

#[test]
fn bytes_of_refusals() {
    assert_bytes(
        &Reply::Refused(Refusal::Oversized { limit: 1030 }),
        &[0, 0, 0x86, 0x08],
    );
    assert_bytes(&Reply::Refused(Refusal::BadFrame), &[0, 1]);
    assert_bytes(&Reply::Refused(Refusal::BadChecksum), &[0, 2]);
    let refusal = Refusal::WrongVersion {
        found: 9,
        supported: 1,
    };
    assert_bytes(&Reply::Refused(refusal), &[0, 3, 9, 1]);
    assert_bytes(&Reply::Refused(Refusal::UnknownMessage), &[0, 4]);
    assert_bytes(
        &Reply::Refused(Refusal::NoBlob { open_error: 2 }),
        &[0, 5, 2],
    );
}

#[test]
fn bytes_of_answers() {
    let hello = Hello {
        device: name("ab"),
        firmware: name("0.1"),
        max_matches: 28,
        max_chunk: 512,
        max_blob: 5,
        unit: 8,
        needs_signature: true,
    };
    assert_bytes(
        &Reply::Hello(hello),
        &[
            1, 2, b'a', b'b', 3, b'0', b'.', b'1', 28, 0x80, 0x04, 5, 8, 1,
        ],
    );

    let without = Status {
        uptime_ms: 1,
        answered: 2,
        refused: 3,
        blob: Err(5),
        active_slot: None,
        slots: [SlotState::Empty, SlotState::Receiving],
        update: None,
        max_blob: 4,
        updates: 5,
        rollbacks: 6,
        rig: None,
        gaps: None,
        arithmetic: Arithmetic::Float,
    };
    assert_bytes(
        &Reply::Status(without.clone()),
        &[2, 1, 2, 3, 1, 5, 0, 0, 1, 0, 4, 5, 6, 0, 0, 0],
    );
    let camera = CameraStatus {
        name: name("l"),
        width_px: 128,
        height_px: 100,
    };
    let blob = BlobStatus {
        identity: [7; 16],
        length: 129,
        camera_count: 1,
        cameras: vec(std::slice::from_ref(&camera)),
    };
    let with = Status {
        blob: Ok(blob),
        active_slot: Some(1),
        slots: [
            SlotState::Unusable {
                sequence: 1,
                open_error: 5,
            },
            SlotState::Holds(STORED),
        ],
        update: Some(UpdateStatus {
            length: 9,
            received: 8,
            identity: [1; 16],
        }),
        rig: Some(Rig {
            serial: name("s"),
            cameras: vec(&[camera]),
        }),
        gaps: Some(GAPS),
        arithmetic: Arithmetic::Integer,
        ..without
    };
    #[rustfmt::skip]
    assert_bytes(&Reply::Status(with), &[
        2, 1, 2, 3, 0,
        7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7,
        0x81, 0x01, 1,          // 129 bytes, one camera
        1, 1, b'l', 0x80, 0x01, 100,
        1, 1,                   // slot 1
        3, 1, 5,
        2, 1, 2, 3, 4, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6,
        1, 9, 8, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
        4, 5, 6,
        1, 1, b's', 1, 1, b'l', 0x80, 0x01, 100,
        1, 3, 0, 0, 0x80, 0xbf, 0, 0, 0, 0x40, 0, 0, 0x80, 0x40,
        1, 2, 0, 0, 0, 0x3f, 0, 0, 0x80, 0xbf, 0, 0, 0x80, 0x3f,
        1,                      // in integers
    ]);
}

#[test]
fn bytes_of_measured_points() {
    let point = Point {
        point_mm: [1.0, 2.0, -2.0],
        gap_squared_mm2: 0.5,
        sigma_mm: None,
    };
    let found = Measured {
        id: 1,
        outcome: Ok(point),
    };
    let with_sigma = Measured {
        id: 3,
        outcome: Ok(Point {
            sigma_mm: Some([1.0, 0.5, 2.0]),
            ..point
        }),
    };
    let refused = Measured {
        id: 2,
        outcome: Err(64),
    };
    #[rustfmt::skip]
    assert_bytes(&Reply::Measured(vec(&[found, refused, with_sigma])), &[
        3, 3,
        1, 0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 0, 0, 0, 0xc0, 0, 0, 0, 0x3f, 0,
        2, 1, 64,
        3, 0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 0, 0, 0, 0xc0, 0, 0, 0, 0x3f,
        1, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x3f, 0, 0, 0, 0x40,
    ]);
}

/// Otherwise a device would keep silent: an answer that does not fit is not sent.
#[test]
fn the_longest_messages_fit_a_frame() {
    let sighting = Sighting {
        camera: u8::MAX,
        u_px: f32::MAX,
        v_px: f32::MAX,
    };
    let asked = Match {
        id: u32::MAX,
        first: sighting,
        second: sighting,
    };
    let point = Point {
        point_mm: [f32::MAX; 3],
        gap_squared_mm2: f32::MAX,
        sigma_mm: Some([f32::MAX; 3]),
    };
    let found = Measured {
        id: u32::MAX,
        outcome: Ok(point),
    };
    let status = longest_status();
    let longest: Name = name(&"n".repeat(MAX_NAME));
    let hello = Hello {
        device: longest.clone(),
        firmware: longest,
        max_matches: u8::MAX,
        max_chunk: u16::MAX,
        max_blob: u32::MAX,
        unit: u16::MAX,
        needs_signature: true,
    };
    let refusal = Refusal::WrongVersion {
        found: u8::MAX,
        supported: u8::MAX,
    };

    let mut writer = FrameWriter::new();
    let measure = Request::Measure(vec(&[asked; MAX_MATCHES]));
    assert!(writer.seal(u16::MAX, &measure).is_some());
    let noisy = Request::MeasureNoisy(NoisyMatches {
        noise_px: f32::MAX,
        matches: vec(&[asked; MAX_MATCHES]),
    });
    assert!(writer.seal(u16::MAX, &noisy).is_some());
    let chunk = Request::Chunk(Chunk {
        offset: u32::MAX,
        bytes: vec(&[0xff; MAX_CHUNK]),
    });
    assert!(writer.seal(u16::MAX, &chunk).is_some());
    let begin = Request::BeginUpdate(NewBlob {
        length: u32::MAX,
        checksum: u32::MAX,
        identity: [0xff; 16],
        rig_serial: Some(name(&"n".repeat(MAX_NAME))),
        signature: Some(Signature {
            r: [0xff; 32],
            s: [0xff; 32],
        }),
    });
    assert!(writer.seal(u16::MAX, &begin).is_some());
    for reply in [
        Reply::Measured(vec(&[found; MAX_MATCHES])),
        Reply::Status(status),
        Reply::Hello(hello),
        Reply::Refused(refusal),
        Reply::Refused(Refusal::Oversized { limit: u16::MAX }),
    ] {
        assert!(writer.seal(u16::MAX, &reply).is_some(), "{reply:?}");
    }
}

fn longest_status() -> Status {
    let longest: Name = name(&"n".repeat(MAX_NAME));
    let camera = CameraStatus {
        name: longest.clone(),
        width_px: u32::MAX,
        height_px: u32::MAX,
    };
    let blob = BlobStatus {
        identity: [0xff; 16],
        length: u32::MAX,
        camera_count: u8::MAX,
        cameras: vec(&vec![camera.clone(); MAX_CAMERAS_LISTED]),
    };
    let stored = StoredBlob {
        slot: 1,
        sequence: u32::MAX,
        length: u32::MAX,
        checksum: u32::MAX,
        ..STORED
    };
    Status {
        uptime_ms: u64::MAX,
        answered: u32::MAX,
        refused: u32::MAX,
        blob: Ok(blob),
        active_slot: Some(1),
        slots: [SlotState::Holds(stored); 2],
        update: Some(UpdateStatus {
            length: u32::MAX,
            received: u32::MAX,
            identity: [0xff; 16],
        }),
        max_blob: u32::MAX,
        updates: u32::MAX,
        rollbacks: u32::MAX,
        rig: Some(Rig {
            serial: longest.clone(),
            cameras: vec(&vec![camera; MAX_CAMERAS_LISTED]),
        }),
        gaps: Some(GapReport {
            points: u32::MAX,
            predicted: Some(Predicted {
                points: u32::MAX,
                ..GAPS.predicted.unwrap()
            }),
            ..GAPS
        }),
        arithmetic: Arithmetic::Integer,
    }
}

#[test]
fn a_long_name_is_cut_at_a_character() {
    assert_eq!(name("left"), "left");
    let long = format!("{}äb", "n".repeat(MAX_NAME - 1));
    assert_eq!(name(&long), "n".repeat(MAX_NAME - 1).as_str());
}

/// The words for a code are tied to the runtime's numbering.
#[test]
fn a_refusal_for_want_of_a_blob_says_why() {
    use ray_runtime::{OpenError, Rounding};
    for (error, words) in [
        (OpenError::BadMagic { found: 0 }, "holds no blob"),
        (
            OpenError::WrongVersion {
                found: 2,
                supported: 1,
            },
            "version",
        ),
        (
            OpenError::BadCrc {
                stated: 0,
                computed: 1,
            },
            "damaged",
        ),
        (OpenError::BadHeader, "cannot be opened (code 7): flash one"),
        (
            OpenError::WrongRounding {
                found: Rounding::TowardZero,
            },
            "round to nearest",
        ),
    ] {
        let text = Refusal::NoBlob {
            open_error: error.code(),
        }
        .to_string();
        assert!(text.contains(words), "{text}");
    }
}
