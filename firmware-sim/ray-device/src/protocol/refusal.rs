//! Why a frame or a request was refused: facts on the wire, words and the next step in `Display`.

use ray_runtime::MatchNoise;
use serde::{Deserialize, Serialize};

use super::unusable::{Distrust, OTHER_PART};

/// Why a frame or a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// More bytes than a frame may have came without a delimiter.
    Oversized {
        /// Most bytes between two delimiters.
        limit: u16,
    },
    /// The bytes between two delimiters are no COBS encoding, or too few for a head and a checksum.
    BadFrame,
    /// The checksum does not match: the frame was damaged on its way.
    BadChecksum,
    /// The frame is whole, but of another protocol version.
    WrongVersion {
        /// The version in the frame.
        found: u8,
        /// The version spoken here.
        supported: u8,
    },
    /// The frame is whole, but its body is no message known here.
    UnknownMessage,
    /// Nothing can be measured: no blob could be opened.
    NoBlob {
        /// The stable code of the runtime's `OpenError`.
        open_error: u8,
    },
    /// The announced blob is longer than a slot.
    TooLong {
        /// Longest blob that a slot holds, bytes.
        limit: u32,
    },
    /// A chunk does not start where the last one ended.
    WrongOffset {
        /// Where the next chunk starts.
        expected: u32,
    },
    /// A chunk is empty, goes beyond the announced length, or ends inside a program unit.
    BadChunk {
        /// Bytes still missing.
        missing: u32,
    },
    /// No update of this peer is under way: none was begun, it was finished or given up, another
    /// peer took over, or the device restarted.
    NoUpdate,
    /// Not all bytes have arrived.
    Incomplete {
        /// Where the next chunk starts.
        received: u32,
    },
    /// The stored bytes do not have the announced checksum.
    ChecksumMismatch {
        /// As announced.
        announced: u32,
        /// Of the bytes read back from flash.
        stored: u32,
    },
    /// The runtime cannot open what was sent.
    NotABlob {
        /// The stable code of its `OpenError`.
        open_error: u8,
    },
    /// The blob is of another calibration than announced.
    OtherIdentity,
    /// The blob was calibrated for other cameras than the device has.
    OtherRig {
        /// Which camera, from 0; of no meaning for the count and the serial number.
        camera: u8,
        /// What differs.
        what: RigPart,
        /// What the device has; 0 for a name or a serial number, which `status` lists.
        expected: u32,
        /// What the blob has; 0 for a name or a serial number.
        found: u32,
    },
    /// The other slot holds no blob that can be used.
    NothingToRollBackTo,
    /// The other slot has no room for another commit record.
    LogFull,
    /// The flash failed.
    FlashFailed {
        /// What it was to do.
        operation: FlashOperation,
        /// Where, from the start of the flash.
        address: u32,
    },
    /// Another peer's update is under way.
    Busy {
        /// It is given up unless it goes on within this time, ms.
        wait_ms: u32,
    },
    /// The device takes signed blobs only, and there is no manifest.
    NotSigned,
    /// The signature is not by the key that the manifest or the order names.
    BadSignature,
    /// The noise of matches is not in the range of the runtime's `MatchNoise`.
    BadNoise,
    /// The manifest cannot be read.
    BadManifest {
        /// Its format; 0 if it is no manifest at all, 1 if what it says is impossible.
        format: u8,
    },
    /// The manifest is of another blob than the one announced, or than the one in the slot.
    OtherManifest,
    /// The device has no key of the number that the manifest or the order names.
    NoSuchKey,
    /// The key that signed was retired by a later manifest.
    KeyRetired {
        /// Its number.
        key: u8,
    },
    /// The device has had a newer version, or may not go back so far.
    VersionTooOld {
        /// That of the manifest.
        version: u32,
        /// The lowest that is taken.
        least: u32,
    },
    /// The bytes of a chunk are not those that the owner signed.
    WrongPiece {
        /// Where it starts.
        offset: u32,
    },
    /// The device has an owner, who must sign an order for this.
    NeedsOrder,
    /// The order is for another moment: the active blob has another sequence number by now.
    StaleOrder {
        /// Of the active blob; 0 if there is none.
        sequence: u32,
    },
    /// The device has no owner who could order anything.
    NoOwner,
    /// Too many updates were begun and never finished: the flash is spared for a while.
    TooManyStarts {
        /// How long yet, ms; a restart of the device ends it at once.
        wait_ms: u32,
    },
}

/// What of a camera, or of the rig, is not the device's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RigPart {
    /// The number of cameras.
    Count,
    /// A camera's name.
    Name,
    /// A sensor's width, px.
    Width,
    /// A sensor's height, px.
    Height,
    /// The rig's serial number.
    Serial,
}

/// What flash can fail to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FlashOperation {
    /// Reading.
    Read,
    /// Erasing a block.
    Erase,
    /// Programming a unit, or it reads otherwise afterwards.
    Program,
}

impl Distrust {
    /// The one that a refusal of [`Keys::check_stored`](crate::storage::trust::Keys::check_stored) stands for.
    pub const fn of(refusal: Refusal) -> Self {
        match refusal {
            Refusal::NotSigned => Self::NotSigned,
            Refusal::BadManifest { .. } => Self::BadManifest,
            Refusal::OtherManifest => Self::OtherManifest,
            Refusal::OtherRig { .. } => Self::OtherRig,
            Refusal::KeyRetired { .. } => Self::KeyRetired,
            Refusal::VersionTooOld { .. } => Self::VersionTooOld,
            _ => Self::BadSignature,
        }
    }
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Oversized { limit } => write!(out, "the frame is longer than {limit} bytes"),
            Self::BadFrame => write!(out, "the bytes are no frame"),
            Self::BadChecksum => write!(out, "the frame was damaged on its way"),
            Self::WrongVersion { found, supported } => write!(
                out,
                "the frame is of protocol version {found}, {supported} is spoken"
            ),
            Self::UnknownMessage => write!(out, "the frame holds no known message"),
            Self::NoBlob { open_error } => {
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
                        "its slot was written for another part, with another program unit or erase block"
                    }
                    _ => "the blob in its flash cannot be opened",
                };
                write!(out, "{reason} (code {open_error}): flash one first")
            }
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
            Self::NoUpdate => write!(
                out,
                "no update of yours is under way (another took over, or the device restarted): begin it again"
            ),
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
            Self::OtherIdentity => write!(
                out,
                "the blob is of another calibration than announced: send the file again"
            ),
            Self::OtherRig {
                camera,
                what,
                expected,
                found,
            } => write_other_rig(out, camera, what, expected, found),
            Self::NothingToRollBackTo => write!(
                out,
                "the other slot holds no whole blob: flash the one that you want"
            ),
            Self::LogFull => write!(
                out,
                "the other slot has no room for another commit: flash its blob again"
            ),
            Self::FlashFailed { operation, address } => {
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
            Self::Busy { wait_ms } => write!(
                out,
                "somebody else is updating it: try again in {} s",
                wait_ms.div_ceil(1000)
            ),
            Self::NotSigned => write!(
                out,
                "it has an owner and takes signed blobs only: sign it with the owner's key, calib-offline sign RIG.rays --key key.pem --version N"
            ),
            Self::BadSignature => write!(
                out,
                "the signature is not by the owner's key, or not of these words: sign again with the key that the device was built for"
            ),
            Self::BadNoise => write!(
                out,
                "the noise of matches must be 0 or {} to {} px: give it so",
                MatchNoise::LEAST_PX,
                MatchNoise::MOST_PX
            ),
            Self::BadManifest { format: 0 } => write!(
                out,
                "what came in place of a manifest is none: give the file that calib-offline sign wrote"
            ),
            Self::BadManifest { format: 1 } => write!(
                out,
                "the manifest says what cannot be (its key, its versions or its serial number): sign the blob again"
            ),
            Self::BadManifest { format } => write!(
                out,
                "the manifest is of format {format}, which the device does not read: bring its firmware up to date"
            ),
            Self::OtherManifest => write!(
                out,
                "the manifest is of another blob: sign this one, or give the manifest that was written for it"
            ),
            Self::NoSuchKey => write!(
                out,
                "the device has no key of the number that was signed with: sign with --key-number 0 or 1, as it was built for"
            ),
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
            Self::NeedsOrder => write!(
                out,
                "the device has an owner, whose order it takes: give the owner's key with --key key.pem"
            ),
            Self::StaleOrder { sequence } => write!(
                out,
                "the order is for another moment, blob number {sequence} is in use by now: sign a new one"
            ),
            Self::NoOwner => write!(
                out,
                "the device has no owner and takes no orders: ask without --key"
            ),
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
        RigPart::Serial => write!(
            out,
            "the blob is for another rig: the device has another serial number"
        )?,
    }
    write!(
        out,
        ". `status` lists the device's cameras; take the blob of this rig"
    )
}
