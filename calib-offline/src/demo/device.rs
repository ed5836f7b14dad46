//! A blob flashed to a device, and the same matches on the host and there: the answers must agree to the
//! last bit.

use super::DemoError;
use crate::device::on_wire;
use crate::report::Calibration;
use calib_blob::matches::KnownMatches;
use calib_rays::measure::Sighting;
use firmware_sim::client::{ClientError, DeviceClient, FlashOptions};
use firmware_sim::simulated::host::SimulatedDevice;
use firmware_sim::simulated::qemu::{DEVICE, QemuDevice, QemuError, require_qemu};
use ray_device::protocol::Point;
use ray_runtime::{MeasureError, PixelPoint, RayBlob};
use serde::Serialize;
use std::collections::HashMap;
use std::net::{Ipv4Addr, SocketAddr};

/// A match as a device measures it: two cameras' pixels.
pub type Pair = [Sighting<f32>; 2];

/// The answers of one device beside those of the host.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DeviceCheck {
    /// What the device calls itself.
    pub device: String,
    /// The slot of its flash that the blob went into.
    pub slot: u8,
    /// Self-tests of the blob that gave the host's bits there, of so many.
    pub self_tests: [u16; 2],
    /// Matches asked.
    pub matches: usize,
    /// Matches that gave a point.
    pub points: usize,
    /// Answers that are not those of the host, bit by bit.
    pub different: usize,
}

impl DeviceCheck {
    /// Whether the device computes what the host does.
    pub fn is_equal(&self) -> bool {
        let [equal, tests] = self.self_tests;
        self.different == 0 && equal == tests
    }
}

/// Any free port, reachable from this machine alone.
const ANY_PORT: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// Starts the simulated device with an empty flash, flashes `blob` to it and compares it with the host.
///
/// # Errors
/// [`DemoError`] if it cannot be started, flashed or asked.
pub fn check_simulated(blob: &[u8], pairs: &[Pair]) -> Result<DeviceCheck, DemoError> {
    let device = SimulatedDevice::start(ANY_PORT, &[]).map_err(DemoError::Start)?;
    Ok(check(device.address(), &RayBlob::open(blob)?, blob, pairs)?)
}

/// The same with the Cortex-M image in QEMU, if there is QEMU and the image has been built.
///
/// # Errors
/// In words, why this machine has no such device, and what to do about it.
pub fn check_cortex_m(blob: &[u8], pairs: &[Pair]) -> Result<DeviceCheck, String> {
    require_qemu().map_err(|error| error.to_string())?;
    let image = DEVICE.image_path("device");
    if !image.is_file() {
        return Err(
            "the image is not built: scripts/install-embedded.sh, then firmware-sim qemu, once"
                .to_owned(),
        );
    }
    let stopped = |error: QemuError| error.to_string();
    let device = QemuDevice::start(ANY_PORT, &image, None).map_err(stopped)?;
    let opened = RayBlob::open(blob).map_err(|error| error.to_string())?;
    check(device.address(), &opened, blob, pairs).map_err(|error| error.to_string())
}

/// Flashes a blob to the device at `address`, asks it for every match and compares its answers with
/// those of the blob here.
///
/// # Errors
/// [`ClientError`].
pub fn check(
    address: SocketAddr,
    opened: &RayBlob<'_>,
    blob: &[u8],
    pairs: &[Pair],
) -> Result<DeviceCheck, ClientError> {
    let mut client = DeviceClient::connect(&format!("tcp:{address}"))?;
    let flashed = client.flash(blob, &FlashOptions::default(), &mut |_| {})?;
    let self_test = client.self_test()?;
    let answers = client.measure(&on_wire(pairs))?;
    let different = answers
        .iter()
        .zip(pairs)
        .filter(|(answer, pair)| bits(&answer.outcome) != bits(&on_host(opened, pair)))
        .count();
    Ok(DeviceCheck {
        device: client.greeting().device.to_string(),
        slot: flashed.stored.slot,
        self_tests: [self_test.equal, self_test.tests],
        matches: answers.len(),
        points: answers.iter().filter(|a| a.outcome.is_ok()).count(),
        different,
    })
}

fn on_host(blob: &RayBlob<'_>, pair: &Pair) -> Result<Point, u8> {
    let [first, second] = pair.map(|(camera_idx, [u, v])| (camera_idx, PixelPoint::new(u, v)));
    blob.triangulate_with_covariance(first, second)
        .map(Point::from)
        .map_err(MeasureError::code)
}

fn bits(outcome: &Result<Point, u8>) -> Result<[Option<u32>; 7], u8> {
    outcome.map(|point| point.to_bits())
}

/// The matches of two cameras in files whose truth is known.
pub fn known_pairs(known: &[KnownMatches<f32>]) -> Vec<Pair> {
    let matches = known.iter().flat_map(|file| &file.matches);
    matches
        .filter_map(|sightings| Pair::try_from(&sightings[..]).ok())
        .collect()
}

/// The corners that the first two cameras both saw, as matches.
pub fn corner_pairs(calibration: &Calibration) -> Vec<Pair> {
    let seen = |camera_idx: usize| {
        let corners = calibration.corners.iter();
        corners
            .filter(move |corner| corner.camera_idx == camera_idx)
            .map(|corner| {
                let pixel = [corner.observed.u as f32, corner.observed.v as f32];
                ((corner.pose, corner.row, corner.col), pixel)
            })
    };
    let second: HashMap<_, _> = seen(1).collect();
    seen(0)
        .filter_map(|(label, pixel)| Some([(0, pixel), (1, *second.get(&label)?)]))
        .collect()
}
