//! Refusals in words: what is wrong, and what to do next.

use ray_runtime::MatchNoise;

use super::{FlashOperation, Refusal, RigPart};
use crate::protocol::unusable::{Distrust, OTHER_PART, OTHER_PART_WORDS};

impl core::fmt::Display for Refusal {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Oversized { limit } => write!(out, "the frame is longer than {limit} bytes"),
            Self::BadFrame => out.write_str("the bytes are no frame"),
            Self::BadChecksum => out.write_str("the frame was damaged on its way"),
            Self::WrongVersion { found, supported } => write!(
                out,
                "the frame is of protocol version {found}, {supported} is spoken"
            ),
            Self::UnknownMessage => out.write_str("the frame holds no known message"),
            Self::NoBlob { open_error } => write_no_blob(out, open_error),
            Self::TooLong { limit } => write!(
                out,
                "the blob is longer than a slot of its flash, {limit} bytes: pack it with a larger error bound"
            ),
            Self::WrongOffset { expected } => {
                write!(out, "the next chunk starts at byte {expected}: go on there")
            }
            Self::BadChunk { missing } => write!(
                out,
                "the chunk is empty, too long or ends inside a program unit; {missing} bytes are missing"
            ),
            Self::NoUpdate => out.write_str("no update of yours is under way (another took over, or the device restarted): begin it again"),
            Self::Incomplete { received } => {
                write!(
                    out,
                    "only {received} bytes have arrived: send the rest first"
                )
            }
            Self::ChecksumMismatch { announced, stored } => write!(
                out,
                "the stored bytes have the checksum {stored:08x}, not the announced {announced:08x}: send the blob again"
            ),
            Self::NotABlob { open_error } => write_not_a_blob(out, open_error),
            Self::OtherIdentity => out.write_str("the blob is of another calibration than announced: send the file again"),
            Self::OtherRig {
                camera,
                what,
                expected,
                found,
            } => write_other_rig(out, camera, what, expected, found),
            Self::NothingToRollBackTo => out.write_str("the other slot holds no whole blob: flash the one that you want"),
            Self::LogFull => out.write_str("the other slot has no room for another commit: flash its blob again"),
            Self::FlashFailed { operation, address } => write_flash_failed(out, operation, address),
            Self::Busy { wait_ms } => write!(
                out,
                "somebody else is updating it: try again in {} s",
                wait_ms.div_ceil(1000)
            ),
            Self::NotSigned => out.write_str("it has an owner and takes signed blobs only: sign it with the owner's key, calib-offline sign RIG.rays --key key.pem --version N"),
            Self::BadSignature => out.write_str("the signature is not by the owner's key, or not of these words: sign again with the key that the device was built for"),
            Self::BadNoise => write!(
                out,
                "the noise of matches must be 0 or {} to {} px: give it so",
                MatchNoise::LEAST_PX,
                MatchNoise::MOST_PX
            ),
            Self::BadManifest { format } => write_bad_manifest(out, format),
            Self::OtherManifest => out.write_str("the manifest is of another blob: sign this one, or give the manifest that was written for it"),
            Self::NoSuchKey => out.write_str("the device has no key of the number that was signed with: sign with --key-number 0 or 1, as it was built for"),
            Self::KeyRetired { key } => write!(
                out,
                "key {key} is retired on this device: sign with the key after it, and its --key-number"
            ),
            Self::VersionTooOld { version, least } => write!(
                out,
                "version {version} is too old, the device takes {least} and above: sign the blob that you want with such a --version"
            ),
            Self::WrongPiece { offset } => write!(
                out,
                "the bytes from {offset} on are not those that the owner signed: send the file that was signed"
            ),
            Self::NeedsOrder => out.write_str("the device has an owner, whose order it takes: give the owner's key with --key key.pem"),
            Self::StaleOrder { sequence } => write!(
                out,
                "the order is for another moment, blob number {sequence} is in use by now: sign a new one"
            ),
            Self::NoOwner => out.write_str("the device has no owner and takes no orders: ask without --key"),
            Self::TooManyStarts { wait_ms } => write!(
                out,
                "too many updates were begun and never finished, so it spares its flash: try again in {} min, or restart it",
                wait_ms.div_ceil(60_000)
            ),
        }
    }
}

const WRONG_ROUNDING: &str =
    "its processor does not round to nearest, so no blob can be read as it was meant";

fn write_no_blob(out: &mut core::fmt::Formatter<'_>, open_error: u8) -> core::fmt::Result {
    if let Some(reason) = Distrust::from_code(open_error) {
        return write!(
            out,
            "the blob in its flash is not used: {reason} (code {open_error})"
        );
    }
    // The codes are the runtime's; these are the ones that a user can act upon.
    let reason = match open_error {
        2 => "its flash holds no blob",
        3 => "the blob in its flash is of a version that it does not read",
        5 => "the blob in its flash is damaged",
        16 => {
            return write!(
                out,
                "{WRONG_ROUNDING} (code {open_error}): mend its firmware, the blob is well"
            );
        }
        OTHER_PART => {
            return write!(
                out,
                "its slot {OTHER_PART_WORDS} (code {open_error}): flash one first"
            );
        }
        _ => "the blob in its flash cannot be opened",
    };
    write!(out, "{reason} (code {open_error}): flash one first")
}

/// The codes are the runtime's; these are the ones that a user can act upon.
fn write_not_a_blob(out: &mut core::fmt::Formatter<'_>, open_error: u8) -> core::fmt::Result {
    let reason = match open_error {
        2 => "what was sent is no blob",
        3 => {
            "the blob is of a format version that the device does not read: bring its firmware up to date"
        }
        5 => "the blob was damaged before it was sent: pack it again",
        15 => {
            "the blob says what a device must know to measure with it, and this one does not: bring its firmware up to date"
        }
        16 => WRONG_ROUNDING,
        _ => "what was sent cannot be opened as a blob: pack it again",
    };
    write!(out, "{reason} (code {open_error})")
}

fn write_other_rig(
    out: &mut core::fmt::Formatter<'_>,
    camera: u8,
    what: RigPart,
    expected: u32,
    found: u32,
) -> core::fmt::Result {
    match what {
        RigPart::Count => write!(
            out,
            "the blob is for another rig: it has {found} cameras, the device {expected}"
        )?,
        RigPart::Name => write!(
            out,
            "the blob is for another rig: its camera {camera} has another name"
        )?,
        RigPart::Width => write!(
            out,
            "the blob is for another rig: its camera {camera} is {found} px wide, the device's {expected} px"
        )?,
        RigPart::Height => write!(
            out,
            "the blob is for another rig: its camera {camera} is {found} px high, the device's {expected} px"
        )?,
        RigPart::Serial => {
            out.write_str("the blob is for another rig: the device has another serial number")?;
        }
    }
    out.write_str(". `status` lists the device's cameras; take the blob of this rig")
}

fn write_flash_failed(
    out: &mut core::fmt::Formatter<'_>,
    operation: FlashOperation,
    address: u32,
) -> core::fmt::Result {
    let operation = match operation {
        FlashOperation::Read => "read",
        FlashOperation::Erase => "be erased",
        FlashOperation::Program => "be programmed",
    };
    write!(
        out,
        "its flash could not {operation} at {address:#x}: try again; if it fails again, the flash is worn out or write-protected"
    )
}

fn write_bad_manifest(out: &mut core::fmt::Formatter<'_>, format: u8) -> core::fmt::Result {
    match format {
            0 => out.write_str("what came in place of a manifest is none: give the file that calib-offline sign wrote"),
            1 => out.write_str("the manifest says what cannot be (its key, its versions or its serial number): sign the blob again"),
            _ => write!(
                out,
                "the manifest is of format {format}, which the device does not read: bring its firmware up to date"
            ),
    }
}
