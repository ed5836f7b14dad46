//! Fixtures of the tests that cross the crates: simulated recordings, their calibration, and
//! devices that hold the blob.

#![allow(
    clippy::missing_panics_doc,
    reason = "a fixture that cannot be made is a failed test"
)]

use calib_blob::pack::{AlignedBytes, PackSettings, Packed, pack};
use calib_judge::known_points::{PointWithTruth, TruthErrors, compare_with_truth};
use calib_offline::demo::device::Pair;
use calib_offline::device::on_wire;
use calib_offline::pipeline::{CalibrateSettings, Checked, calibrate_corners, corners};
use calib_offline::report::Calibration;
use calib_offline::report::facts::Facts;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::SensorSize;
use calib_rays::progress::Silent;
use calib_recording::dataset::Dataset;
use calib_simulate::{
    ImageFiles, MatchSet, OpticsKind, OutputSettings, Scene, SceneSettings, TrueMatch,
    write_dataset,
};
use firmware_sim::client::DeviceClient;
use firmware_sim::simulated::host::SimulatedDevice;
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// The datasets that come with the program.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../data")
        .join(name)
}

/// A rig with small sensors: enough to find corners in rendered images, and quick to render.
pub fn small_scene(optics: OpticsKind, seed: u64) -> Scene {
    let settings = SceneSettings {
        sensor: SensorSize::new(640, 480),
        board: BoardSpec::chessboard(10, 9, 12.0),
        spread: 0.3,
        angles_deg: (-3..=3).map(|k| f64::from(k) * 11.0).collect(),
        ..SceneSettings::standard(optics, seed)
    };
    Scene::new(settings).expect("the settings are in range")
}

/// Writes a scene as a dataset, with images or with corners.
pub fn record(scene: &Scene, with_images: bool, folder: &Path) -> Dataset {
    let output = OutputSettings {
        corners: !with_images,
        images: with_images,
        image_files: ImageFiles::Quick,
        point_count: 10,
        holdout_count: 10,
        ..OutputSettings::default()
    };
    write_dataset(scene, &output, folder, true).expect("the folder can be written");
    Dataset::load(folder).expect("what was written can be read")
}

/// Calibrates a dataset with this many folds of the held-out check.
pub fn calibrate(dataset: &Dataset, folds: usize) -> Checked {
    let settings = CalibrateSettings {
        folds,
        ..CalibrateSettings::default()
    };
    let corners = corners(dataset, &settings.detect, &Silent).expect("the corners are found");
    calibrate_corners(dataset, &corners, &settings, &Silent).expect("the data determine the rig")
}

/// Packs a calibration within 0.001 px.
pub fn packed(calibration: &Calibration) -> Packed {
    let settings = PackSettings {
        working_distance_mm: working_distance_mm(calibration),
        identity: calibration.identity(),
        ..PackSettings::default()
    };
    pack(&calibration.rig, &settings).expect("0.001 px can be held")
}

/// Where the boards were, mm from the cameras.
pub fn working_distance_mm(calibration: &Calibration) -> f64 {
    Facts::of(calibration)
        .working_distance_mm
        .expect("poses were used")
        .median
}

/// Has the simulated device measure a scene's matches with a blob, and compares its points with
/// the truth. Also returns how many matches gave no point.
pub fn measure_on_device(blob: &[u8], scene: &Scene, set: MatchSet) -> (TruthErrors, usize) {
    let asked = scene.matches(set, 500);
    let device = SimulatedDevice::start(loopback(), blob).expect("a port is free");
    let address = format!("tcp:{}", device.address());
    let mut client = DeviceClient::connect(&address).expect("the device answers");
    let measured = client.measure(&on_wire(&sightings(&asked)));
    let measured = measured.expect("it measures");
    let points: Vec<PointWithTruth> = asked
        .iter()
        .zip(&measured)
        .filter_map(|(asked, measured)| {
            let point_mm = measured.outcome.ok()?.point_mm;
            Some(PointWithTruth {
                measured_mm: Vector3::from(point_mm.map(f64::from)),
                true_mm: asked.point_in_datum,
                oracle_mm: asked.oracle_in_datum,
            })
        })
        .collect();
    let without_point = asked.len() - points.len();
    let errors = compare_with_truth(&points).expect("there are points");
    (errors, without_point)
}

/// Any free port of this machine.
pub fn loopback() -> std::net::SocketAddr {
    std::net::SocketAddr::from(([127, 0, 0, 1], 0))
}

/// A scene's matches as pairs of sightings.
pub fn pairs(scene: &Scene, count: usize) -> Vec<Pair> {
    sightings(&scene.matches(MatchSet::Points, count))
}

fn sightings(matches: &[TrueMatch]) -> Vec<Pair> {
    let pixel = |asked: &TrueMatch, k: usize| [asked.pixels[k].u as f32, asked.pixels[k].v as f32];
    matches
        .iter()
        .map(|asked| [(0, pixel(asked, 0)), (1, pixel(asked, 1))])
        .collect()
}

/// Bytes on a multiple of 8, as the runtime asks for.
pub fn aligned(packed: &Packed) -> AlignedBytes {
    AlignedBytes::from(packed.bytes.as_slice())
}
