//! The bytes of every refusal, and what it says.

use super::assert_bytes;
use crate::protocol::{FlashOperation, Refusal, Reply, RigPart};

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
        (R::BadManifest { format: 2 }, &[22, 2]),
        (R::OtherManifest, &[23]),
        (R::NoSuchKey, &[24]),
        (R::KeyRetired { key: 0 }, &[25, 0]),
        (
            R::VersionTooOld {
                version: 1,
                least: 2,
            },
            &[26, 1, 2],
        ),
        (R::WrongPiece { offset: 128 }, &[27, 0x80, 0x01]),
        (R::NeedsOrder, &[28]),
        (R::StaleOrder { sequence: 5 }, &[29, 5]),
        (R::NoOwner, &[30]),
        (R::TooManyStarts { wait_ms: 6 }, &[31, 6]),
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
