//! Frames on the wire: exact bytes, every truncation, every flipped bit, and noise.

use super::{FrameReader, FrameWriter, MAX_FRAME, MAX_MESSAGE, NO_SEQUENCE, Received, Rejected};
use crate::cobs;
use crate::protocol::{PROTOCOL_VERSION, Refusal, Reply, Request};

fn sealed(sequence: u16, request: &Request) -> Vec<u8> {
    FrameWriter::new()
        .seal(sequence, request)
        .expect("a request fits")
        .to_vec()
}

/// What a fresh reader makes of `bytes`, answer by answer.
fn read(bytes: &[u8]) -> Vec<Result<Received<Request>, Rejected>> {
    let mut reader = FrameReader::new();
    bytes.iter().filter_map(|&byte| reader.push(byte)).collect()
}

/// A frame around any bytes at all, with a checksum that is right.
fn framed(checked: &[u8]) -> Vec<u8> {
    let mut message = checked.to_vec();
    message.extend_from_slice(&super::CHECKSUM.checksum(checked).to_le_bytes());
    let mut frame = vec![0; cobs::max_encoded_length(message.len()) + 1];
    let length = cobs::encode(&message, &mut frame).unwrap();
    frame.truncate(length + 1);
    frame
}

/// The bytes of a Hello, computed by hand but for the checksum, which is Python's
/// `zlib.crc32(b"\4\7\0\0")`.
#[test]
fn the_bytes_of_a_hello() {
    let crc = super::CHECKSUM.checksum(&[4, 7, 0, 0]).to_le_bytes();
    assert_eq!(crc, HELLO_CRC);
    let mut expected = vec![3, 4, 7, 1, 5];
    expected.extend_from_slice(&crc);
    expected.push(0);
    assert_eq!(sealed(7, &Request::Hello), expected);
}
const HELLO_CRC: [u8; 4] = [0xce, 0x5e, 0x69, 0xab];

#[test]
fn a_request_comes_back() {
    for sequence in [1, 255, 256, u16::MAX] {
        let frame = sealed(sequence, &Request::Status);
        assert_eq!(
            read(&frame),
            [Ok(Received {
                sequence,
                body: Request::Status
            })]
        );
    }
}

#[test]
fn delimiters_alone_are_silence() {
    assert_eq!(read(&[0; 100]), []);
}

#[test]
fn every_truncation_is_refused_and_the_next_frame_is_read() {
    let whole = sealed(3, &Request::Hello);
    for length in 1..whole.len() - 1 {
        let mut bytes = whole[..length].to_vec();
        bytes.push(0);
        bytes.extend_from_slice(&whole);
        let answers = read(&bytes);
        assert_eq!(answers.len(), 2, "cut at {length}");
        assert!(answers[0].is_err(), "cut at {length}");
        assert_eq!(
            answers[1],
            Ok(Received {
                sequence: 3,
                body: Request::Hello
            })
        );
    }
}

#[test]
fn every_flipped_bit_is_refused() {
    let whole = sealed(3, &Request::Hello);
    for bit in 0..8 * (whole.len() - 1) {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let answers = read(&bytes);
        assert!(!answers.is_empty(), "bit {bit}");
        assert!(answers.iter().all(Result::is_err), "bit {bit}: {answers:?}");
    }
}

#[test]
fn another_version_is_refused_under_its_own_number() {
    let refusal = Refusal::WrongVersion {
        found: 9,
        supported: PROTOCOL_VERSION,
    };
    assert_eq!(
        read(&framed(&[9, 0x34, 0x12, 0xff, 0xff])),
        [Err(Rejected {
            sequence: 0x1234,
            refusal
        })]
    );
}

#[test]
fn an_unknown_or_overlong_body_is_refused_under_its_own_number() {
    let refusal = Refusal::UnknownMessage;
    for (body, why) in [
        (&[][..], "no body"),
        (&[99], "no such request"),
        (&[0, 0], "a byte too many"),
        (&[2, 33], "33 matches announced"),
    ] {
        let checked = [&[PROTOCOL_VERSION, 5, 0], body].concat();
        let answers = read(&framed(&checked));
        assert_eq!(
            answers,
            [Err(Rejected {
                sequence: 5,
                refusal
            })],
            "{why}"
        );
    }
}

#[test]
fn an_oversized_frame_is_refused_once_and_the_next_is_read() {
    for length in [MAX_FRAME + 1, 3 * MAX_FRAME, 100_000] {
        let mut bytes = vec![0x55; length];
        bytes.push(0);
        bytes.extend_from_slice(&sealed(8, &Request::Hello));
        let refusal = Refusal::Oversized {
            limit: MAX_FRAME as u16,
        };
        assert_eq!(
            read(&bytes),
            [
                Err(Rejected {
                    sequence: NO_SEQUENCE,
                    refusal
                }),
                Ok(Received {
                    sequence: 8,
                    body: Request::Hello
                })
            ]
        );
    }
}

/// A body that does not fit is not sent at all, rather than cut.
#[test]
fn a_body_that_does_not_fit_is_not_sealed() {
    let mut writer = FrameWriter::new();
    let fits = vec![1_u8; MAX_MESSAGE - 7 - 2];
    assert_eq!(
        writer.seal(1, &&fits[..]).map(<[u8]>::len),
        Some(cobs::max_encoded_length(MAX_MESSAGE) + 1)
    );
    assert!(writer.seal(1, &&[1_u8; MAX_MESSAGE - 7 - 1][..]).is_none());
    assert!(writer.seal(1, &Reply::Refused(Refusal::BadFrame)).is_some());
}
