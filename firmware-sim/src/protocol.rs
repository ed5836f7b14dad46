//! The messages between a workstation and a device: defined once, here, and used by both.
//!
//! Messages are `postcard` encodings of [`Request`] and [`Reply`] inside the frames of
//! [`crate::frame`]. `postcard` does not describe itself, so the order of variants and fields *is*
//! the protocol: new variants go to the end, and any other change raises [`PROTOCOL_VERSION`]. The
//! exact bytes are pinned by tests below. Every request has exactly one reply, which carries the
//! request's sequence number; a sender may have several requests under way.
//!
//! Pixels have (0, 0) at the center of the top-left pixel; points are in the rig's frame, mm.

use heapless::{String, Vec};
use ray_runtime::Measurement;
use serde::{Deserialize, Serialize};

/// The protocol spoken here. It stands in every frame, and a device refuses any other.
pub const PROTOCOL_VERSION: u8 = 2;

/// Matches in one [`Request::Measure`]: with 28 both messages stay below 1 KiB.
pub const MAX_MATCHES: usize = 28;

/// Cameras listed in a [`Status`]; a blob may hold more, [`BlobStatus::camera_count`] says how
/// many.
pub const MAX_CAMERAS_LISTED: usize = 8;

/// Longest name in a message, bytes. Longer ones are cut at a character.
pub const MAX_NAME: usize = 32;

/// Length of a blob's identity, bytes.
pub const IDENTITY_LENGTH: usize = ray_runtime::format::IDENTITY_LEN;

/// A name as it travels.
pub type Name = String<MAX_NAME>;

/// What a workstation asks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
// There is no heap to box the large variant into, and one request exists at a time.
#[allow(clippy::large_enum_variant)]
pub enum Request {
    /// Who is there? Answered by [`Reply::Hello`].
    Hello,
    /// How is the device? Answered by [`Reply::Status`].
    Status,
    /// Triangulate these. Answered by [`Reply::Measured`], entry by entry in the same order.
    Measure(Vec<Match, MAX_MATCHES>),
}

/// What a device answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)]
pub enum Reply {
    /// The request could not be carried out; nothing on the device changed.
    Refused(Refusal),
    /// Answer to [`Request::Hello`].
    Hello(Hello),
    /// Answer to [`Request::Status`].
    Status(Status),
    /// Answer to [`Request::Measure`].
    Measured(Vec<Measured, MAX_MATCHES>),
}

/// A point seen by two cameras.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Match {
    /// The sender's own number, given back with the answer.
    pub id: u32,
    /// Where the first camera sees it.
    pub first: Sighting,
    /// Where the second camera sees it.
    pub second: Sighting,
}

/// One camera's pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sighting {
    /// Index of the camera in the blob.
    pub camera: u8,
    /// To the right, px.
    pub u_px: f32,
    /// Down, px.
    pub v_px: f32,
}

/// The answer to one [`Match`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The [`Match::id`] it answers.
    pub id: u32,
    /// The point, or the stable code of the runtime's `MeasureError` that says why there is none.
    pub outcome: Result<Point, u8>,
}

/// A triangulated point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// x, y, z in the rig's frame, mm.
    pub point_mm: [f32; 3],
    /// Square of the length of the common perpendicular, mm². The device takes no square root of it.
    pub gap_squared_mm2: f32,
    /// Predicted standard deviation along x, y and z of the rig's frame, mm: what the calibration
    /// leaves uncertain, and pixel noise of the size of its corners'. `None` where the blob does
    /// not say.
    pub sigma_mm: Option<[f32; 3]>,
}

impl From<Measurement> for Point {
    fn from(measured: Measurement) -> Self {
        Self {
            point_mm: measured.found.point_mm.into(),
            gap_squared_mm2: measured.found.gap_squared_mm2,
            sigma_mm: measured.covariance.map(|covariance| covariance.sigma_mm()),
        }
    }
}

impl Point {
    /// The bits of the point, of the gap and, if there are any, of the standard deviations: what two
    /// targets must agree on.
    pub fn to_bits(&self) -> [Option<u32>; 7] {
        let [x, y, z] = self.point_mm.map(|number| Some(number.to_bits()));
        let [sigma_x, sigma_y, sigma_z] = match self.sigma_mm {
            Some(sigma_mm) => sigma_mm.map(|number| Some(number.to_bits())),
            None => [None; 3],
        };
        let gap = Some(self.gap_squared_mm2.to_bits());
        [x, y, z, gap, sigma_x, sigma_y, sigma_z]
    }
}

/// Who the device is and what it takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// What kind of device this is.
    pub device: Name,
    /// Version of its application.
    pub firmware: Name,
    /// [`MAX_MATCHES`] as the device was built with.
    pub max_matches: u8,
}

/// How the device is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Since it started, ms.
    pub uptime_ms: u64,
    /// Requests answered with something other than a refusal, since start; stops at its maximum.
    pub answered: u32,
    /// Frames and requests refused since start; stops at its maximum.
    pub refused: u32,
    /// The blob in use, or the stable code of the runtime's `OpenError` that says why there is
    /// none.
    pub blob: Result<BlobStatus, u8>,
}

/// The blob in use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlobStatus {
    /// Hash of the calibration it was packed from.
    pub identity: [u8; IDENTITY_LENGTH],
    /// Its length, bytes.
    pub length: u32,
    /// How many cameras it holds.
    pub camera_count: u8,
    /// The first of them, in order.
    pub cameras: Vec<CameraStatus, MAX_CAMERAS_LISTED>,
}

/// A camera of the blob in use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraStatus {
    /// Its name.
    pub name: Name,
    /// Width of the sensor it was calibrated for, px.
    pub width_px: u32,
    /// Height of that sensor, px.
    pub height_px: u32,
}

/// Why a frame or a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
}

/// `text` as it travels: cut at the last character that fits.
pub fn name(text: &str) -> Name {
    let mut name = Name::new();
    for character in text.chars() {
        if name.push(character).is_err() {
            break;
        }
    }
    name
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Oversized { limit } => {
                write!(formatter, "the frame is longer than {limit} bytes")
            }
            Self::BadFrame => write!(formatter, "the bytes are no frame"),
            Self::BadChecksum => write!(formatter, "the frame was damaged on its way"),
            Self::WrongVersion { found, supported } => {
                write!(
                    formatter,
                    "the frame is of protocol version {found}, {supported} is spoken"
                )
            }
            Self::UnknownMessage => write!(formatter, "the frame holds no known message"),
            Self::NoBlob { open_error } => {
                // The codes are the runtime's; these are the ones that a user can act upon.
                let reason = match open_error {
                    2 => "its flash holds no blob",
                    3 => "the blob in its flash is of a version that it does not read",
                    5 => "the blob in its flash is damaged",
                    _ => "the blob in its flash cannot be opened",
                };
                write!(formatter, "{reason} (code {open_error})")
            }
        }
    }
}

#[cfg(test)]
mod tests;
