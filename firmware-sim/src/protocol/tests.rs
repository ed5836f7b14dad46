//! The bytes of every message. A test that fails here means that devices in the field no longer
//! understand: raise `PROTOCOL_VERSION`, or do not change the message.

use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{
    BlobStatus, CameraStatus, Hello, MAX_CAMERAS_LISTED, MAX_MATCHES, MAX_NAME, Match, Measured,
    Name, Point, Refusal, Reply, Request, Sighting, Status, name,
};
use crate::frame::{FrameWriter, MAX_MESSAGE};

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
    };
    assert_bytes(
        &Reply::Hello(hello),
        &[1, 2, b'a', b'b', 3, b'0', b'.', b'1', 28],
    );

    let without = Status {
        uptime_ms: 1,
        answered: 2,
        refused: 3,
        blob: Err(5),
    };
    assert_bytes(&Reply::Status(without), &[2, 1, 2, 3, 1, 5]);
    let camera = CameraStatus {
        name: name("l"),
        width_px: 128,
        height_px: 100,
    };
    let blob = BlobStatus {
        identity: [7; 16],
        length: 129,
        camera_count: 1,
        cameras: vec(&[camera]),
    };
    let with = Status {
        uptime_ms: 1,
        answered: 2,
        refused: 3,
        blob: Ok(blob),
    };
    #[rustfmt::skip]
    assert_bytes(&Reply::Status(with), &[
        2, 1, 2, 3, 0,
        7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7,
        0x81, 0x01, 1,          // 129 bytes, one camera
        1, 1, b'l', 0x80, 0x01, 100,
    ]);

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
        cameras: vec(&vec![camera; MAX_CAMERAS_LISTED]),
    };
    let status = Status {
        uptime_ms: u64::MAX,
        answered: u32::MAX,
        refused: u32::MAX,
        blob: Ok(blob),
    };
    let hello = Hello {
        device: longest.clone(),
        firmware: longest,
        max_matches: u8::MAX,
    };
    let refusal = Refusal::WrongVersion {
        found: u8::MAX,
        supported: u8::MAX,
    };

    let mut writer = FrameWriter::new();
    let measure = Request::Measure(vec(&[asked; MAX_MATCHES]));
    assert!(writer.seal(u16::MAX, &measure).is_some());
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

#[test]
fn a_long_name_is_cut_at_a_character() {
    assert_eq!(name("left"), "left");
    let long = format!("{}äb", "n".repeat(MAX_NAME - 1));
    assert_eq!(name(&long), "n".repeat(MAX_NAME - 1).as_str());
}

/// The words for a code are tied to the runtime's numbering.
#[test]
fn a_refusal_for_want_of_a_blob_says_why() {
    use ray_runtime::OpenError;
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
        (OpenError::BadHeader, "cannot be opened (code 7)"),
    ] {
        let text = Refusal::NoBlob {
            open_error: error.code(),
        }
        .to_string();
        assert!(text.contains(words), "{text}");
    }
}
