//! Why a device does not use the blob that stands in a slot: codes of its own, behind those of the runtime's `OpenError`.

/// In place of an `OpenError`'s code: the slot was written for a flash of another unit or block.
pub const OTHER_PART: u8 = 128;

/// What such a slot is, in words that follow its name.
pub const OTHER_PART_WORDS: &str =
    "was written for another part, with another program unit or erase block";

/// Why a device with an owner does not use a whole blob: codes behind those of the runtime's `OpenError`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Distrust {
    /// There is no manifest with it.
    NotSigned = 160,
    /// The manifest cannot be read.
    BadManifest = 161,
    /// It is not signed by a key of the device, or damaged.
    BadSignature = 162,
    /// It is of another blob, or the blob is damaged.
    OtherManifest = 163,
    /// It is for another rig.
    OtherRig = 164,
    /// Its key is retired.
    KeyRetired = 165,
    /// Its version is below the least that may be used.
    VersionTooOld = 166,
}

impl Distrust {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::NotSigned,
        Self::BadManifest,
        Self::BadSignature,
        Self::OtherManifest,
        Self::OtherRig,
        Self::KeyRetired,
        Self::VersionTooOld,
    ];

    /// Its stable code.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The one with this code.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|reason| reason.code() == code)
    }
}

/// In words, with what to do.
impl core::fmt::Display for Distrust {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        out.write_str(match self {
            Self::NotSigned => "it is not signed, and the device has an owner: sign it and flash it again",
            Self::BadManifest => "its manifest cannot be read: flash it again",
            Self::BadSignature => {
                "it was not signed with a key of this device: sign it with the owner's key and flash it again"
            }
            Self::OtherManifest => "its manifest is of other bytes, or they are damaged: flash it again",
            Self::OtherRig => "it was signed for another rig: flash the blob of this one",
            Self::KeyRetired => "the key that signed it is retired: sign it with the key after it",
            Self::VersionTooOld => "its version is below the least that the owner allows",
        })
    }
}
