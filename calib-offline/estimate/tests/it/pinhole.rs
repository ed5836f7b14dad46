//! The baseline against `OpenCV` on the same corners; how the figures came about is said in
//! `data/opencv-figures/README.md`.

use calib_estimate::adjust::Observations;
use calib_estimate::pinhole::{PinholeRig, Refine, RigSettings, calibrate_rig};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::so3;
use calib_rays::observed::View;
use calib_recording::dataset::Dataset;
use calib_recording::dataset::corners::read_corners;
use calib_simulate::{CameraOptics, OpticsKind, Scene, SceneSettings};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// How far apart minima may be, in standard deviations of the parameter. Both searches stop where a
/// cost changes by less than a share e of itself, 1e-12 here; that leaves a parameter up to
/// sqrt(e N) standard deviations off, N being the 1000 to 1400 numbers observed.
const TOLERANCE_SIGMA: f64 = 4e-5;
/// Of an RMS, as a share: half of the cost's, and round-off of sums of 1000 numbers.
const TOLERANCE_RMS: f64 = 1e-11;
/// `stereoCalibrate` with everything free ends before its minimum: its RMS may be higher than ours by
/// this share, and the parameters are held against what that leaves.
const EXCESS_RMS: f64 = 4e-9;
/// With intrinsics held, what each camera alone left them off by acts on the common minimum in full:
/// on its cost by more than the square, on the extrinsics by more than their own deviations, which
/// are those for exact intrinsics.
const HELD_TOLERANCE_RMS: f64 = 1e-7;
const HELD_TOLERANCE_SIGMA: f64 = 10.0 * TOLERANCE_SIGMA;
/// The order of [`calib_estimate::pinhole::BrownCamera::intrinsics`].
const NAMES: [&str; 9] = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"];

#[derive(Deserialize)]
struct Figures {
    cameras: BTreeMap<String, CameraFigures>,
    stereo_fixed_intrinsics: StereoFigures,
    stereo_everything: StereoFigures,
}

#[derive(Deserialize)]
struct CameraFigures {
    corners: usize,
    rms_px: f64,
    intrinsics: BTreeMap<String, f64>,
    standard_deviations: BTreeMap<String, f64>,
}

#[derive(Deserialize)]
struct StereoFigures {
    corners: usize,
    rms_px: f64,
    baseline_mm: f64,
    translation_mm: [f64; 3],
    rotation_rad: [f64; 3],
    intrinsics: [BTreeMap<String, f64>; 2],
}

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data")
}

fn figures(name: &str) -> Figures {
    let path = data().join("opencv-figures").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// `OpenCV` keeps corners as 32-bit floats.
fn rounded(mut views: Vec<View>) -> Vec<View> {
    for corner in views.iter_mut().flat_map(|view| &mut view.corners) {
        corner.pixel.u = f64::from(corner.pixel.u as f32);
        corner.pixel.v = f64::from(corner.pixel.v as f32);
    }
    views
}

/// The set that `data/opencv-figures/README.md` gives the command for.
fn simulated(optics: OpticsKind) -> Observations {
    let mut settings = SceneSettings::standard_noisy(optics, 2022);
    settings.board = BoardSpec::chessboard(7, 6, 20.0);
    settings.angles_deg = (-3..=3).map(|k| f64::from(k) * 12.0).collect();
    settings.spread = 0.3;
    let scene = Scene::new(settings).unwrap();
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    Observations::new(
        scene.settings.board.clone(),
        sensors,
        &rounded(scene.observe_corners()),
    )
}

fn real() -> Observations {
    let folder = data().join("opencv-stereo");
    let dataset = Dataset::load(&folder).unwrap();
    let views = read_corners(&dataset, &folder.join("corners_opencv.csv")).unwrap();
    let sensors = dataset.cameras.iter().map(|camera| camera.sensor).collect();
    Observations::new(dataset.board, sensors, &rounded(views))
}

#[track_caller]
fn assert_near(what: &str, found: f64, expected: f64, tolerance: f64) {
    let off = (found - expected).abs();
    assert!(
        off <= tolerance,
        "{what}: {found}, OpenCV has {expected}; off by {off:.2e}, allowed are {tolerance:.2e}"
    );
}

fn compare_stereo(rig: &PinholeRig, figures: &StereoFigures, refine: Refine) {
    assert_eq!(rig.corner_count, figures.corners);
    let excess = figures.rms_px / rig.rms_px - 1.0;
    let tolerance_sigma = match refine {
        Refine::Extrinsics => {
            assert!(excess.abs() <= HELD_TOLERANCE_RMS, "{excess:e}");
            HELD_TOLERANCE_SIGMA
        }
        Refine::Everything => {
            assert!(
                (-TOLERANCE_RMS..=EXCESS_RMS).contains(&excess),
                "{excess:e}"
            );
            // Twice the share in cost, two numbers per corner.
            let left_over = 2.0 * excess.max(0.0) * 2.0 * rig.corner_count as f64;
            TOLERANCE_SIGMA + left_over.sqrt()
        }
    };
    let deviations = rig.deviations.as_ref().unwrap();
    let place = deviations[1].place.map(|d| d * tolerance_sigma);
    let right_from_left = &rig.camera_from_first[1];
    let rotation = so3::log(&right_from_left.rotation);
    for k in 0..3 {
        assert_near("rotation", rotation[k], figures.rotation_rad[k], place[k]);
        let found = right_from_left.translation_mm[k];
        assert_near(
            "translation",
            found,
            figures.translation_mm[k],
            place[3 + k],
        );
    }
    assert_near(
        "baseline",
        rig.baseline_mm(1),
        figures.baseline_mm,
        place[3],
    );
    for (camera, (expected, deviations)) in rig
        .cameras
        .iter()
        .zip(figures.intrinsics.iter().zip(deviations))
    {
        for ((name, found), deviation) in NAMES
            .iter()
            .zip(camera.intrinsics())
            .zip(deviations.intrinsics)
        {
            // What is held carries the other fit's difference.
            if deviation > 0.0 {
                assert_near(name, found, expected[*name], deviation * tolerance_sigma);
            }
        }
    }
}

fn compare(observations: &Observations, figures: &Figures) {
    for refine in [Refine::Extrinsics, Refine::Everything] {
        let settings = RigSettings {
            refine,
            ..RigSettings::default()
        };
        let rig = calibrate_rig(observations, &settings).unwrap();
        for (fit, name) in rig.fits.iter().zip(["left", "right"]) {
            let expected = &figures.cameras[name];
            assert_eq!(fit.corner_count, expected.corners);
            let tolerance_px = TOLERANCE_RMS * fit.rms_px;
            assert_near("RMS", fit.rms_px, expected.rms_px, tolerance_px);
            let deviations = fit.standard_deviations.unwrap();
            for ((name, found), own) in NAMES.iter().zip(fit.camera.intrinsics()).zip(deviations) {
                let deviation = expected.standard_deviations[*name];
                let tolerance = deviation * TOLERANCE_SIGMA;
                assert_near(name, found, expected.intrinsics[*name], tolerance);
                // Quadratic at the minimum like the parameters themselves, so near the same share.
                assert_near("its deviation", own, deviation, 1e-4 * deviation);
            }
        }
        let expected = match refine {
            Refine::Extrinsics => &figures.stereo_fixed_intrinsics,
            Refine::Everything => &figures.stereo_everything,
        };
        compare_stereo(&rig, expected, refine);
    }
}

#[test]
fn real_corners_give_the_figures_of_opencv() {
    compare(&real(), &figures("opencv-stereo.json"));
}

#[test]
fn simulated_corners_of_the_model_give_the_figures_of_opencv() {
    compare(&simulated(OpticsKind::Brown), &figures("brown.json"));
}

#[test]
fn corners_that_no_pinhole_explains_give_the_figures_of_opencv() {
    compare(&simulated(OpticsKind::Port), &figures("port.json"));
}
