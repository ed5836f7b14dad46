//! What a device says of itself, as an object for JSON.

use calib_recording::dataset::identity::hex;
use ray_device::health::{GapReport, Verdict};
use ray_device::protocol::{self, Arithmetic, CameraStatus, Hello, Status};
use serde::Serialize;

/// The answer to `status`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceState {
    /// What it calls itself.
    pub device: String,
    /// Version of its application.
    pub firmware: String,
    /// Since it started, ms.
    pub uptime_ms: u64,
    /// Requests answered and refused since then.
    pub answered: u32,
    /// Frames and requests refused since then.
    pub refused: u32,
    /// Blobs made active by an update since then.
    pub updates: u32,
    /// Rollbacks since then.
    pub rollbacks: u32,
    /// Longest blob that it takes, bytes.
    pub max_blob_bytes: u32,
    /// The blob in use.
    pub blob: Option<BlobState>,
    /// The runtime's code of why there is none.
    pub open_error: Option<u8>,
    /// Its two slots.
    pub slots: [SlotState; 2],
    /// The update under way.
    pub update: Option<UpdateState>,
    /// The cameras that it is built with, if it knows them.
    pub rig: Option<RigState>,
    /// Gaps of what it has measured; `None` before the first point.
    pub gaps: Option<GapState>,
    /// What it computes points in: f32 or integer.
    pub arithmetic: &'static str,
}

/// The blob in use.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct BlobState {
    /// Hash of the calibration it was packed from.
    pub identity: String,
    /// Its length.
    pub bytes: u32,
    /// Cameras in it.
    pub camera_count: u8,
    /// The first of them.
    pub cameras: Vec<CameraState>,
}

/// A camera.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CameraState {
    /// Its name.
    pub name: String,
    /// Width of its sensor, px.
    pub width_px: u32,
    /// Height of its sensor, px.
    pub height_px: u32,
}

/// What a slot holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum SlotState {
    /// Nothing that was ever finished.
    Empty,
    /// The blob under way.
    Receiving,
    /// A whole blob.
    Holds {
        /// Whether it is the one in use.
        is_active: bool,
        /// Of its commit record: the highest is in use.
        sequence: u32,
        /// Its length.
        bytes: u32,
        /// CRC-32 of all its bytes.
        checksum: String,
        /// Hash of the calibration it was packed from.
        identity: String,
    },
    /// A blob that was whole once.
    Unusable {
        /// Of its commit record.
        sequence: u32,
        /// The runtime's code of why.
        open_error: u8,
    },
}

/// A blob on its way.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UpdateState {
    /// Its identity, as announced.
    pub identity: String,
    /// Its length.
    pub bytes: u32,
    /// How much of it has been stored.
    pub received_bytes: u32,
}

/// The cameras that a device is built with.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RigState {
    /// Serial number; empty if it has none.
    pub serial: String,
    /// In the order of the blob.
    pub cameras: Vec<CameraState>,
}

/// Gaps beside their prediction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GapState {
    /// `fits`, `shifted`, `scattered`, `too_few_points` or `nothing_predicted`.
    pub verdict: &'static str,
    /// The figures.
    #[serde(flatten)]
    pub report: GapReport,
}

impl DeviceState {
    /// What the device said.
    pub fn new(hello: &Hello, status: &Status) -> Self {
        let blob = status.blob.as_ref();
        Self {
            device: hello.device.to_string(),
            firmware: hello.firmware.to_string(),
            uptime_ms: status.uptime_ms,
            answered: status.answered,
            refused: status.refused,
            updates: status.updates,
            rollbacks: status.rollbacks,
            max_blob_bytes: status.max_blob,
            open_error: blob.err().copied(),
            blob: blob.ok().map(|blob| BlobState {
                identity: hex(&blob.identity),
                bytes: blob.length,
                camera_count: blob.camera_count,
                cameras: cameras(&blob.cameras),
            }),
            slots: status.slots.map(|slot| slot_state(&slot, status)),
            update: status.update.map(|update| UpdateState {
                identity: hex(&update.identity),
                bytes: update.length,
                received_bytes: update.received,
            }),
            rig: status.rig.as_ref().map(|rig| RigState {
                serial: rig.serial.to_string(),
                cameras: cameras(&rig.cameras),
            }),
            arithmetic: match status.arithmetic {
                Arithmetic::Float => "f32",
                Arithmetic::Integer => "integer",
            },
            gaps: status.gaps.map(|report| GapState {
                verdict: verdict_word(report.verdict()),
                report,
            }),
        }
    }

    /// Whether the gaps say that the calibration no longer fits.
    pub fn is_shifted(&self) -> bool {
        self.gaps
            .is_some_and(|gaps| gaps.report.verdict() == Verdict::Shifted)
    }
}

fn cameras(cameras: &[CameraStatus]) -> Vec<CameraState> {
    let of_one = |camera: &CameraStatus| CameraState {
        name: camera.name.to_string(),
        width_px: camera.width_px,
        height_px: camera.height_px,
    };
    cameras.iter().map(of_one).collect()
}

fn slot_state(slot: &protocol::SlotState, status: &Status) -> SlotState {
    match slot {
        protocol::SlotState::Empty => SlotState::Empty,
        protocol::SlotState::Receiving => SlotState::Receiving,
        protocol::SlotState::Holds(stored) => SlotState::Holds {
            is_active: status.active_slot == Some(stored.slot),
            sequence: stored.sequence,
            bytes: stored.length,
            checksum: format!("{:08x}", stored.checksum),
            identity: hex(&stored.identity),
        },
        protocol::SlotState::Unusable {
            sequence,
            open_error,
        } => SlotState::Unusable {
            sequence: *sequence,
            open_error: *open_error,
        },
    }
}

const fn verdict_word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::NothingPredicted => "nothing_predicted",
        Verdict::TooFewPoints => "too_few_points",
        Verdict::Fits => "fits",
        Verdict::Scattered => "scattered",
        Verdict::Shifted => "shifted",
    }
}
