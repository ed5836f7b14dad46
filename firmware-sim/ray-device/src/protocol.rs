//! The messages between a workstation and a device: defined once, here, and used by both.
//!
//! Messages are `postcard` encodings of [`Request`] and [`Reply`] inside the frames of
//! [`crate::frame`]. `postcard` does not describe itself, so the order of variants and fields *is*
//! the protocol: new variants go to the end, and any other change raises [`PROTOCOL_VERSION`]. The
//! exact bytes are pinned by tests below. Every request has exactly one reply, which carries the
//! request's sequence number; a sender may have several requests under way.
//!
//! Pixels have (0, 0) at the center of the top-left pixel; points are in the rig's frame, mm.

mod name;
mod owner;
mod refusal;
mod unusable;

use heapless::Vec;
use ray_runtime::{Measurement, Triangulation};
use serde::{Deserialize, Serialize};

use crate::health::GapReport;
use crate::manifest::{Link, MANIFEST_LENGTH, PIECE_LENGTH};

pub use crate::manifest::Signature;
pub use name::{MAX_NAME, Name, name};
pub use owner::{Claims, KeyId, Order, OwnerStatus};
pub use refusal::{FlashOperation, Refusal, RigPart};
pub use unusable::{Distrust, OTHER_PART, OTHER_PART_WORDS};

/// The protocol spoken here. It stands in every frame, and a device refuses any other.
pub const PROTOCOL_VERSION: u8 = 4;

/// Matches in one [`Request::Measure`]: with 28 both messages stay below 1 KiB.
pub const MAX_MATCHES: usize = 28;

/// Bytes of a blob in one [`Request::Chunk`]: a multiple of every program unit that the storage takes.
pub const MAX_CHUNK: usize = 512;
const _: () = assert!(
    MAX_CHUNK == PIECE_LENGTH,
    "a piece of a signed blob travels as one chunk"
);

/// Cameras listed in a [`Status`]; a blob may hold more, [`BlobStatus::camera_count`] says how
/// many.
pub const MAX_CAMERAS_LISTED: usize = 8;

/// Length of a blob's identity, bytes.
pub const IDENTITY_LENGTH: usize = ray_runtime::format::IDENTITY_LEN;

/// What a workstation asks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
// There is no heap to box the large variant into, and one request exists at a time.
#[allow(clippy::large_enum_variant)]
pub enum Request {
    /// Who is there? Answered by [`Reply::Hello`].
    Hello,
    /// How is the device? Answered by [`Reply::Status`].
    Status,
    /// Triangulate these. Answered by [`Reply::Measured`], entry by entry in the same order.
    Measure(Vec<Match, MAX_MATCHES>),
    /// A new blob is coming. Answered by [`Reply::Receiving`], or by [`Reply::Active`] if this very
    /// blob is active already and nothing needs to be sent.
    ///
    /// If this very blob is under way, from whichever peer, its transfer goes on where it stopped:
    /// the answer says how much has arrived. Any other transfer of the same peer is given up, and
    /// that of another peer once no chunk of it has been stored for a while. On a device with an owner the
    /// peer does not matter: a newer version takes over at once, an older one once the newer is silent.
    ///
    /// Nothing is erased before the first chunk was accepted.
    BeginUpdate(NewBlob),
    /// The next bytes of the new blob. Answered by [`Reply::Receiving`].
    ///
    /// Chunks come in order. A repeat of the last one is acknowledged again; any other place is
    /// refused with the one expected.
    Chunk(Chunk),
    /// All bytes were sent: check the new blob and make it active. Answered by [`Reply::Active`].
    FinishUpdate,
    /// Give the transfer up. Answered by [`Reply::Aborted`], also if there is none; a device with an owner
    /// refuses it and takes a [`Request::Order`].
    AbortUpdate,
    /// Make the other slot's blob active, after a check of all of it. Answered by [`Reply::Active`]; a device
    /// with an owner refuses it and takes a [`Request::Order`].
    Rollback,
    /// Compare the active blob's self-tests. Answered by [`Reply::SelfTested`].
    SelfTest,
    /// Triangulate these, whose pixels are as noisy as said here. Answered by [`Reply::Measured`], or refused with
    /// [`Refusal::BadNoise`]. A device that does not know it answers [`Refusal::UnknownMessage`].
    MeasureNoisy(NoisyMatches),
    /// Triangulate these without their standard deviations, which take four times as long as the points. Answered by
    /// [`Reply::Measured`]; such points do not count into [`Status::gaps`].
    MeasurePoints(Vec<Match, MAX_MATCHES>),
    /// What the owner of the device orders, such as a rollback. Answered as the same without an order. A
    /// device without an owner refuses it.
    Order(Order),
}

/// What a device answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(clippy::large_enum_variant)]
pub enum Reply {
    /// The request could not be carried out. Which blob is active did not change.
    Refused(Refusal),
    /// Answer to [`Request::Hello`].
    Hello(Hello),
    /// Answer to [`Request::Status`].
    Status(Status),
    /// Answer to [`Request::Measure`].
    Measured(Vec<Measured, MAX_MATCHES>),
    /// A blob is under way: how many of its bytes have been stored.
    Receiving {
        /// From the first on; the next chunk starts here.
        received: u32,
    },
    /// This blob is active, now and after any restart.
    Active(StoredBlob),
    /// Nothing is under way any more.
    Aborted,
    /// Answer to [`Request::SelfTest`].
    SelfTested(SelfTestReport),
}

/// A blob to be sent.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NewBlob {
    /// Its length, bytes.
    pub length: u32,
    /// CRC-32/ISO-HDLC of all its bytes (zlib's): [`crate::frame::checksum`].
    pub checksum: u32,
    /// Its identity, which must be the one that it states itself.
    pub identity: [u8; IDENTITY_LENGTH],
    /// Serial number of the rig it was calibrated on, if known: a device that knows its own takes
    /// no other. One with an owner goes by the manifest instead.
    pub rig_serial: Option<Name>,
    /// The [`Manifest`](crate::manifest::Manifest) of its owner, empty without one:
    /// [`Hello::needs_signature`] says whether there must be one. Stored with the blob, asked for or not.
    pub manifest: Vec<u8, MANIFEST_LENGTH>,
}

/// A piece of a blob on its way.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Chunk {
    /// Where in the blob it starts.
    pub offset: u32,
    /// A multiple of [`Hello::unit`] bytes, unless it is the last: whole units are programmed as chunks come. On a
    /// device with an owner, [`MAX_CHUNK`] bytes, unless it is the last.
    pub bytes: Vec<u8, MAX_CHUNK>,
    /// Link of the next piece in the chain of the [manifest](crate::manifest), on a device with an owner.
    pub next: Option<Link>,
}

/// A blob in a slot, with a valid commit record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StoredBlob {
    /// Which slot, 0 or 1; 2: none, the device's factory blob is in use.
    pub slot: u8,
    /// Of its commit record: the highest is the active one.
    pub sequence: u32,
    /// Its length, bytes.
    pub length: u32,
    /// CRC-32 of all its bytes.
    pub checksum: u32,
    /// Hash of the calibration it was packed from.
    pub identity: [u8; IDENTITY_LENGTH],
    /// Of its manifest, as a device with an owner has verified it; 0 on others.
    pub version: u32,
}

/// What the self-tests of the active blob gave on this device.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SelfTestReport {
    /// How many the blob holds.
    pub tests: u16,
    /// How many gave the very bits of the host that packed it.
    pub equal: u16,
    /// How many gave no answer at all where there should be one.
    pub unanswered: u16,
    /// Largest difference of a coordinate of a ray's origin, of a point or of a standard deviation,
    /// mm.
    pub worst_mm: f32,
    /// Largest difference of a component of a ray's direction.
    pub worst_direction: f32,
}

/// Matches with the noise of their pixels, in place of what the blob says of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NoisyMatches {
    /// Standard deviation of each pixel coordinate, px, in the range of the runtime's `MatchNoise`.
    pub noise_px: f32,
    /// The matches.
    pub matches: Vec<Match, MAX_MATCHES>,
}

/// A point seen by two cameras.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Measured {
    /// The [`Match::id`] it answers.
    pub id: u32,
    /// The point, or the stable code of the runtime's `MeasureError` that says why there is none.
    pub outcome: Result<Point, u8>,
}

/// A triangulated point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Point {
    /// x, y, z in the rig's frame, mm.
    pub point_mm: [f32; 3],
    /// Square of the length of the common perpendicular, mm². The device takes no square root of it.
    pub gap_squared_mm2: f32,
    /// Predicted standard deviation along x, y and z of the rig's frame, mm: what the calibration
    /// leaves uncertain, and the pixels' noise, which is that of the request, else that of the blob's matches, else
    /// that of the calibration's corners. `None` where the blob does not say, of [`Request::MeasurePoints`] and from a
    /// device that computes in integers.
    pub sigma_mm: Option<[f32; 3]>,
}

impl From<Measurement> for Point {
    fn from(measured: Measurement) -> Self {
        Self {
            point_mm: measured.found.point_mm,
            gap_squared_mm2: measured.found.gap_squared_mm2,
            sigma_mm: measured.covariance.map(|covariance| covariance.sigma_mm()),
        }
    }
}

impl From<Triangulation> for Point {
    fn from(found: Triangulation) -> Self {
        Self {
            point_mm: found.point_mm,
            gap_squared_mm2: found.gap_squared_mm2,
            sigma_mm: None,
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Hello {
    /// What kind of device this is.
    pub device: Name,
    /// Version of its application.
    pub firmware: Name,
    /// [`MAX_MATCHES`] as the device was built with.
    pub max_matches: u8,
    /// [`MAX_CHUNK`] as the device was built with, bytes.
    pub max_chunk: u16,
    /// Longest blob that a slot of its flash holds, bytes.
    pub max_blob: u32,
    /// What its flash programs in one go, bytes: a power of two from 1 to [`MAX_CHUNK`].
    pub unit: u16,
    /// Whether it has an owner, and so takes signed blobs only.
    pub needs_signature: bool,
}

/// How the device is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
    /// Which slot it is in; 2: the device's factory blob.
    pub active_slot: Option<u8>,
    /// What each slot holds.
    pub slots: [SlotState; 2],
    /// The blob under way, if any.
    pub update: Option<UpdateStatus>,
    /// Longest blob that a slot holds, bytes.
    pub max_blob: u32,
    /// Blobs made active by an update since start; stops at its maximum.
    pub updates: u32,
    /// Rollbacks since start; stops at its maximum.
    pub rollbacks: u32,
    /// What the device knows of its own cameras; without it, any blob is taken.
    pub rig: Option<Rig>,
    /// The gaps of what it has measured with this blob; `None` before the first point.
    pub gaps: Option<GapReport>,
    /// What it computes points in.
    pub arithmetic: Arithmetic,
    /// Whose it is; `None`: anybody may change it.
    pub owner: Option<OwnerStatus>,
}

/// What a device computes rays and points in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Arithmetic {
    /// Numbers of f32.
    #[default]
    Float,
    /// Integers. Its points have no standard deviations, and do not count into [`Status::gaps`].
    Integer,
}

/// What a slot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SlotState {
    /// Nothing that was ever finished.
    Empty,
    /// The blob under way goes here.
    Receiving,
    /// A whole blob.
    Holds(StoredBlob),
    /// There is a commit record, but the blob behind it cannot be used.
    Unusable {
        /// Of its commit record.
        sequence: u32,
        /// The stable code of the runtime's `OpenError`, or of the device's own: [`OTHER_PART`]
        /// or that of a [`Distrust`].
        open_error: u8,
    },
}

/// How far an update has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct UpdateStatus {
    /// Length of the new blob, bytes.
    pub length: u32,
    /// How much of it has been stored, bytes.
    pub received: u32,
    /// Its identity, as announced.
    pub identity: [u8; IDENTITY_LENGTH],
    /// Its checksum, as announced.
    pub checksum: u32,
    /// Updates begun since the device started, this one included.
    pub number: u32,
}

/// What a device knows of the cameras it is built with, from its factory record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rig {
    /// Serial number of the rig; empty if it has none.
    pub serial: Name,
    /// Its cameras, in the order of the blob.
    pub cameras: Vec<CameraStatus, MAX_CAMERAS_LISTED>,
}

/// The blob in use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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

/// A camera, of the blob in use or of the device itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CameraStatus {
    /// Its name.
    pub name: Name,
    /// Width of the sensor, px.
    pub width_px: u32,
    /// Height of that sensor, px.
    pub height_px: u32,
}

#[cfg(test)]
mod tests;
