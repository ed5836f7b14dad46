//! From rendered images to points out of the simulated device, against the truth: with optics
//! whose rays all meet, and with optics whose rays do not. The blob is flashed to the host's device and to
//! the Cortex-M in QEMU, which keep it through a restart and give the host's bits.

use calib_blob::pack::AlignedBytes;
use calib_estimate::adjust::residual::linearize;
use calib_offline::demo::DeviceCheck;
use calib_offline::demo::device::check;
use calib_offline::report::Calibration;
use calib_rays::geometry::PixelPoint;
use calib_simulate::{MatchSet, OpticsKind, Scene};
use firmware_sim::client::DeviceClient;
use firmware_sim::simulated::flash_file::FlashFile;
use firmware_sim::simulated::host::SimulatedDevice;
use firmware_sim::simulated::qemu::{QemuDevice, build_image};
use ray_runtime::RayBlob;
use workspace_tests::{
    aligned, calibrate, loopback, measure_on_device, packed, pairs, record, small_scene,
    working_distance_mm,
};

/// How much worse than the true rays the calibrated ones may be.
///
/// The matches carry 0.05 px; corners of clean images are found to 0.01 px or so. What the
/// calibration adds is the corners' error, averaged over some thousand of them for some dozens of
/// parameters: a fifth of it at worst, which makes sqrt(1 + (0.002 / 0.05)^2). The rest of the room
/// is for what the detector gets wrong in the same way everywhere.
const MOST_RATIO: f64 = 1.03;

/// The chain up to the device; the scene, its calibration and the blob for further questions.
fn chain(optics: OpticsKind) -> (Scene, Calibration, AlignedBytes) {
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(optics, 11);
    let dataset = record(&scene, true, &folder.path().join("set"));
    let calibration = calibrate(&dataset, 0).calibration;
    let blob = aligned(&packed(&calibration));
    for set in [MatchSet::Points, MatchSet::Holdout] {
        let (errors, without_point) = measure_on_device(&blob, &scene, set);
        println!("{optics:?} {set:?}: {errors:?}, {without_point} without a point");
        assert!(errors.placed_ratio < MOST_RATIO, "{set:?}: {errors:?}");
        // The datum frame is that of one board, placed by some hundred corners: its own error, a
        // small part of a match's, is in every point.
        assert!(
            errors.direct_ratio < MOST_RATIO + 0.05,
            "{set:?}: {errors:?}"
        );
        // The corners that were found reach as far as the true ones, but for those at the border.
        assert!(without_point < 500 / 20, "{set:?}: {without_point}");
    }
    (scene, calibration, blob)
}

#[test]
fn central_optics() {
    let (scene, calibration, blob) = chain(OpticsKind::Brown);
    let cameras = &calibration.rig.cameras;
    assert!(cameras.iter().all(|camera| camera.field.is_central()));
    every_pixel_has_the_ray_of_the_field(&calibration, &blob);
    devices_keep_the_blob_and_give_the_bits_of_the_host(&scene, &blob);
}

#[test]
fn rays_that_do_not_meet() {
    let (scene, calibration, blob) = chain(OpticsKind::Port);
    let cameras = &calibration.rig.cameras;
    assert!(cameras.iter().all(|camera| !camera.field.is_central()));
    every_pixel_has_the_ray_of_the_field(&calibration, &blob);
    devices_keep_the_blob_and_give_the_bits_of_the_host(&scene, &blob);
}

/// The blob on its way through a file and the runtime, against the calibration on its way through
/// JSON: at the working distance no ray is 0.001 px off, by a yardstick that is not the packer's.
fn every_pixel_has_the_ray_of_the_field(calibration: &Calibration, bytes: &[u8]) {
    let distance_mm = working_distance_mm(calibration);
    let blob = RayBlob::open(bytes).unwrap();
    for (idx, camera) in calibration.rig.cameras.iter().enumerate() {
        let camera_from_rig = camera.rig_from_camera.inverse();
        let sensor = camera.field.sensor;
        let (mut worst_px, mut count) = (0.0_f64, 0);
        for v in 0..sensor.height {
            for u in 0..sensor.width {
                let ray = blob.lookup(idx, ray_runtime::PixelPoint::new(u as f32, v as f32));
                let pixel = PixelPoint::new(f64::from(u), f64::from(v));
                assert_eq!(ray.is_ok(), camera.coverage.contains(pixel), "{pixel:?}");
                let Ok(ray) = ray else { continue };
                let in_f64 = |of_ray: [f32; 3]| nalgebra::Vector3::from(of_ray.map(f64::from));
                let direction = in_f64(ray.direction).normalize();
                let point_in_rig = in_f64(ray.origin_mm) + direction * distance_mm;
                let seen = linearize(
                    &camera.field.sample(pixel),
                    &camera_from_rig.point(&point_in_rig),
                );
                worst_px = worst_px.max(seen.unwrap().residual_px.norm());
                count += 1;
            }
        }
        println!("camera {idx}: {count} pixels, {worst_px:.6} px at worst");
        assert!(worst_px < 0.001, "{worst_px}");
        assert!(count > 100_000, "{count}");
    }
}

/// Flashes the blob to both devices, switches them off and on, and compares their answers with the
/// runtime's here. Needs QEMU and a bare-metal toolchain; `tests/run` installs them first.
fn devices_keep_the_blob_and_give_the_bits_of_the_host(scene: &Scene, bytes: &[u8]) {
    let blob = RayBlob::open(bytes).unwrap();
    // So what is compared are standard deviations as well.
    assert_eq!(blob.uncertain_pairs().count(), 1);
    let asked = pairs(scene, 500);
    let image = build_image("device").unwrap();
    // Either device goes on with what the other left in the same file.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.flash");
    let expect = |checked: DeviceCheck, device: &str| {
        assert_eq!(checked.device, device);
        assert_eq!((checked.matches, checked.different), (500, 0));
        assert!(checked.points > 400 && checked.is_equal(), "{checked:?}");
    };
    let in_qemu = |is_new: bool| {
        let device = QemuDevice::start(loopback(), &image, Some(&file)).unwrap();
        let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
        assert_eq!(client.status().unwrap().blob.is_err(), is_new);
        drop(client);
        expect(
            check(device.address(), &blob, bytes, &asked).unwrap(),
            "firmware-sim cortex-m",
        );
    };
    in_qemu(true);
    in_qemu(false);
    let FlashFile { flash, kept_in } = FlashFile::open(&file, None).unwrap();
    let device = SimulatedDevice::start_with(loopback(), flash).unwrap();
    expect(
        check(device.address(), &blob, bytes, &asked).unwrap(),
        "firmware-sim host",
    );
    drop(kept_in);
}
