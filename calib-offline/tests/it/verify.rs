//! `verify` and `compare`, as a user runs them.

use crate::common::documented::assert_documented;
use crate::common::{MANIFEST, calibration, noisy_corners_csv, rig, run};
use calib_rays::field::Rig;
use calib_rays::geometry::{RigidTransform, so3};
use nalgebra::Vector3;
use std::fs;
use std::path::Path;

/// Standard deviation of the noise, px.
const NOISE_PX: f64 = 0.05;
/// Poses of a calibration.
const POSES: usize = 10;

/// The sum of twelve even numbers by a seed and a count is normal enough.
fn noise(seed: u64) -> impl Fn(u64) -> f64 {
    move |count| {
        let even = |k: u64| {
            // The finalizer of splitmix64, on numbers that no two draws share.
            let mut x = (seed << 40) + 12 * count + k;
            x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            (x ^ (x >> 31)) as f64 / u64::MAX as f64
        };
        NOISE_PX * ((0..12).map(even).sum::<f64>() - 6.0)
    }
}

fn record(folder: &Path, name: &str, rig: &Rig, poses: usize, seed: u64) {
    let set = folder.join(name);
    fs::create_dir(&set).unwrap();
    fs::write(set.join("dataset.toml"), MANIFEST).unwrap();
    let corners = noisy_corners_csv(rig, poses, noise(seed));
    fs::write(set.join("corners.csv"), corners).unwrap();
}

/// A folder with a recording `old` and its calibration in `out`.
fn calibrated() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "old", &rig(), POSES, 1);
    run(folder.path(), &["calibrate", "old", "-o", "out"]);
    assert!(folder.path().join("out/calibration.json").exists());
    folder
}

const VERIFY: [&str; 3] = ["verify", "out/calibration.json", "new"];

#[test]
fn a_rig_as_it_was_passes_and_a_knocked_one_fails_with_words() {
    let folder = calibrated();
    record(folder.path(), "new", &rig(), 4, 2);
    run(folder.path(), &VERIFY).assert_code(0).assert_prints(&[
        "verdict: pass",
        "nothing changed that the new boards show",
        "its own",
    ]);

    let mut knocked = rig();
    let right = &mut knocked.cameras[1].rig_from_camera;
    let turn = so3::exp(&Vector3::new(0.0, 0.12_f64.to_radians(), 0.0));
    *right = *right * RigidTransform::new(turn, Vector3::zeros());
    record(folder.path(), "later", &knocked, 4, 3);
    let verify = ["verify", "out/calibration.json", "later"];
    run(folder.path(), &verify).assert_code(1).assert_prints(&[
        "verdict: fail",
        "camera right turned against camera left since the calibration: turned right by +0.",
        "a change of one looks like the contrary change of the other",
    ]);
    let json = run(folder.path(), &[&verify[..], &["--json"]].concat());
    let object = json.assert_code(1).json();
    assert_eq!(object["verdict"], "fail");
    assert_eq!(object["cause"], "camera-moved");
    assert!(object["cost_mm"].as_f64().unwrap() > object["limit_mm"].as_f64().unwrap());
    assert_documented("verify", "calib-offline/verify/1", &[object], &[]);
}

#[test]
fn what_cannot_be_verified_is_said_with_what_to_do() {
    let folder = calibrated();
    let path = folder.path();
    record(path, "new", &rig(), 3, 2);
    let manifest = |from: &str, to: &str| {
        fs::write(path.join("new/dataset.toml"), MANIFEST.replace(from, to)).unwrap();
    };
    manifest("square_mm = 20.0", "square_mm = 25.0");
    run(path, &VERIFY).assert_code(2).assert_says(&[
        "25 mm squares",
        "20 mm squares",
        "try: show the board",
    ]);
    manifest(
        "width = 640\nheight = 480\n\n",
        "width = 1280\nheight = 960\n\n",
    );
    run(path, &VERIFY).assert_code(2).assert_says(&[
        "camera left has 1280 x 960 px",
        "640 x 480",
        "resolution",
    ]);
    manifest("name = \"left\"", "name = \"front\"");
    fs::remove_file(path.join("new/corners.csv")).unwrap();
    let corners = noisy_corners_csv(&rig(), 3, noise(2)).replace("left,", "front,");
    fs::write(path.join("new/corners.csv"), corners).unwrap();
    run(path, &VERIFY).assert_code(2).assert_says(&[
        "has a camera \"front\"",
        "left, right",
        "under their names",
    ]);

    fs::write(path.join("bare.json"), calibration().to_json().unwrap()).unwrap();
    manifest("x", "x");
    let corners = noisy_corners_csv(&rig(), 3, noise(2));
    fs::write(path.join("new/corners.csv"), corners).unwrap();
    run(path, &["verify", "bare.json", "new"])
        .assert_code(2)
        .assert_says(&["holds no corners", "calib-offline calibrate"]);
    run(path, &["verify", "out/rig.rays", "new"])
        .assert_code(2)
        .assert_says(&["is a blob", "calibration.json"]);
    run(path, &["verify", "none.json", "new"]).assert_code(2);
}

#[test]
fn two_calibrations_of_one_rig_are_as_different_as_predicted_and_a_changed_one_more() {
    let folder = calibrated();
    let path = folder.path();
    record(path, "again", &rig(), POSES, 5);
    run(path, &["calibrate", "again", "-o", "second"]);
    let compare = ["compare", "out/calibration.json", "second/calibration.json"];
    run(path, &compare).assert_code(0).assert_prints(&[
        "as different as their uncertainties predict",
        "after the best rigid placement",
        "camera right",
    ]);
    // One percent of the baseline.
    let mut longer = rig();
    longer.cameras[1].rig_from_camera.translation_mm.x += 1.2;
    record(path, "later", &longer, POSES, 6);
    run(path, &["calibrate", "later", "-o", "third"]);
    let more = ["compare", compare[1], "third/calibration.json", "--json"];
    let object = run(path, &more).assert_code(0).json();
    assert_eq!(object["judgement"], "more");
    // One percent of the distance of points from their middle, 50 to 200 mm.
    let most_mm = object["max_mm"].as_f64().unwrap();
    assert!((0.5..4.0).contains(&most_mm), "{most_mm}");

    let mut changed = calibration();
    changed.rig.cameras[1].name = "other".to_owned();
    fs::write(path.join("other.json"), changed.to_json().unwrap()).unwrap();
    fs::write(path.join("bare.json"), calibration().to_json().unwrap()).unwrap();
    run(path, &["compare", "out/calibration.json", "bare.json"])
        .assert_code(0)
        .assert_prints(&["not predicted"]);
    run(path, &["compare", "out/calibration.json", "other.json"])
        .assert_code(2)
        .assert_says(&["different cameras", "other (640 x 480)"]);
    run(path, &["compare", "out/calibration.json", "out/rig.rays"])
        .assert_code(2)
        .assert_says(&["is a blob"]);
}
