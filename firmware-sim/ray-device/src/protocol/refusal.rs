//! Why a frame or a request was refused: facts on the wire, words and the next step in `Display`.

mod words;

use serde::{Deserialize, Serialize};

use super::unusable::Distrust;

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
