//! The bytes of every message. A test that fails here means that devices in the field no longer
//! understand: raise `PROTOCOL_VERSION`, or do not change the message.

mod refusals;

use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{
    Arithmetic, BlobStatus, CameraStatus, Chunk, Claims, Hello, MAX_CAMERAS_LISTED, MAX_CHUNK,
    MAX_MATCHES, MAX_NAME, Match, Measured, Name, NewBlob, NoisyMatches, Order, OwnerStatus, Point,
    Refusal, Reply, Request, Rig, SelfTestReport, Sighting, Signature, SlotState, Status,
    StoredBlob, UpdateStatus, name,
};
use crate::frame::{FrameWriter, MAX_MESSAGE};
use crate::health::{GapReport, Predicted};
use crate::manifest::{Action, MANIFEST_LENGTH};

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
        manifest: vec(&[7, 8]),
    };
    #[rustfmt::skip]
    assert_bytes(&Request::BeginUpdate(new), &[
        3, 0xc8, 0x01, 1,
        9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9,
        1, 1, b's', 2, 7, 8,
    ]);
    let chunk = Chunk {
        offset: 128,
        bytes: vec(&[5, 255, 0]),
        next: None,
    };
    assert_bytes(
        &Request::Chunk(chunk.clone()),
        &[4, 0x80, 0x01, 3, 5, 255, 0, 0],
    );
    let chunk = Chunk {
        next: Some([2; 32]),
        ..chunk
    };
    assert_bytes(
        &Request::Chunk(chunk),
        &[&[4, 0x80, 0x01, 3, 5, 255, 0, 1][..], &[2; 32]].concat(),
    );
    for (action, number) in [(Action::Rollback, 0), (Action::Abort, 1)] {
        let order = Order {
            action,
            key: 1,
            sequence: 128,
            signature: Signature {
                r: [3; 32],
                s: [4; 32],
            },
        };
        let head = [11, number, 1, 0x80, 0x01];
        assert_bytes(
            &Request::Order(order),
            &[&head[..], &[3; 32], &[4; 32]].concat(),
        );
    }
    assert_bytes(&Request::FinishUpdate, &[5]);
    assert_bytes(&Request::AbortUpdate, &[6]);
    assert_bytes(&Request::Rollback, &[7]);
    assert_bytes(&Request::SelfTest, &[8]);

    assert_bytes(&Reply::Receiving { received: 128 }, &[4, 0x80, 0x01]);
    #[rustfmt::skip]
    assert_bytes(&Reply::Active(STORED), &[
        5, 1, 2, 3, 4,
        6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 9,
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
    version: 9,
};

const OWNER: OwnerStatus = OwnerStatus {
    keys: [Some([5; 8]), None],
    claims: Claims {
        newest_version: 9,
        least_version: 8,
        least_key: 1,
    },
};

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
        owner: None,
    };
    assert_bytes(
        &Reply::Status(without.clone()),
        &[2, 1, 2, 3, 1, 5, 0, 0, 1, 0, 4, 5, 6, 0, 0, 0, 0],
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
            checksum: 10,
            number: 11,
        }),
        rig: Some(Rig {
            serial: name("s"),
            cameras: vec(&[camera]),
        }),
        gaps: Some(GAPS),
        arithmetic: Arithmetic::Integer,
        owner: Some(OWNER),
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
        2, 1, 2, 3, 4, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 9,
        1, 9, 8, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 10, 11,
        4, 5, 6,
        1, 1, b's', 1, 1, b'l', 0x80, 0x01, 100,
        1, 3, 0, 0, 0x80, 0xbf, 0, 0, 0, 0x40, 0, 0, 0x80, 0x40,
        1, 2, 0, 0, 0, 0x3f, 0, 0, 0x80, 0xbf, 0, 0, 0x80, 0x3f,
        1,                      // in integers
        1, 1, 5, 5, 5, 5, 5, 5, 5, 5, 0, 9, 8, 1,
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
        next: Some([0xff; 32]),
    });
    assert!(writer.seal(u16::MAX, &chunk).is_some());
    let begin = Request::BeginUpdate(NewBlob {
        length: u32::MAX,
        checksum: u32::MAX,
        identity: [0xff; 16],
        rig_serial: Some(name(&"n".repeat(MAX_NAME))),
        manifest: vec(&[0xff; MANIFEST_LENGTH]),
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
        version: u32::MAX,
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
            checksum: u32::MAX,
            number: u32::MAX,
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
        owner: Some(OwnerStatus {
            keys: [Some([0xff; 8]); 2],
            claims: Claims {
                newest_version: u32::MAX,
                least_version: u32::MAX,
                least_key: u32::MAX,
            },
        }),
    }
}

#[test]
fn a_long_name_is_cut_at_a_character() {
    assert_eq!(name("left"), "left");
    let long = format!("{}äb", "n".repeat(MAX_NAME - 1));
    assert_eq!(name(&long), "n".repeat(MAX_NAME - 1).as_str());
}
