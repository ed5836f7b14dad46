//! `export` to the forms of other tools: two ideal cameras of 600 px, 120 mm apart and toed in by 0.12 rad each, read back.

use crate::common::{SENSOR, calibration, contents, rig, run};
use calib_rays::geometry::{PixelPoint, so3};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let json = calibration().to_json().unwrap();
    fs::write(path.join("calibration.json"), json).unwrap();
    let pack = ["pack", "calibration.json", "-o", "rig.rays"];
    run(path, &[&pack[..], &["--max-error-px", "0.002"]].concat()).assert_code(0);
    folder
}

/// Every list in brackets of a YAML file, by the last key of the lines before it: `data` counts for the matrix around it.
fn lists(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let mut found = BTreeMap::new();
    let mut outer = String::new();
    for line in text.lines() {
        let Some((key, value)) = line.split_once(':') else {
            continue;
        };
        if !key.starts_with(' ') {
            key.clone_into(&mut outer);
        }
        if let Some(list) = value.trim().strip_prefix('[') {
            let key = if key.trim() == "data" {
                &outer
            } else {
                key.trim()
            };
            let numbers = list.trim_end_matches(']').split(',');
            let numbers = numbers.map(|number| number.trim().parse().unwrap());
            found.insert(key.to_owned(), numbers.collect());
        }
    }
    found
}

/// How far off the numbers of an ideal camera may be, whose pixels are off by so much. Coefficients have the same bound,
/// which is wide: they take each other's place. To move the principal point is all but to turn the camera: of a shift d
/// there remain d x^2 beside the turn, a quarter of it at the edge of this sensor and a tenth on the average.
fn assert_ideal(camera_matrix: &[f64], coefficients: &[f64], most_px: f64) {
    let center = SENSOR.center();
    let truth = [600.0, 0.0, center.u, 0.0, 600.0, center.v, 0.0, 0.0, 1.0];
    for (k, (found, truth)) in camera_matrix.iter().zip(truth).enumerate() {
        let most = if k % 3 == 2 { 10.0 * most_px } else { most_px };
        assert!((found - truth).abs() < most, "{camera_matrix:?}");
    }
    assert!(
        coefficients.iter().all(|k| k.abs() < most_px),
        "{coefficients:?}"
    );
}

/// The right camera from the left.
fn truth() -> (Matrix3<f64>, Vector3<f64>) {
    let cameras = rig().cameras;
    let right_from_left = cameras[1].rig_from_camera.inverse() * cameras[0].rig_from_camera;
    (right_from_left.rotation, right_from_left.translation_mm)
}

#[test]
fn opencv_reads_the_pinholes_and_where_they_stand() {
    let folder = folder();
    let path = folder.path();
    let (rotation, translation_mm) = truth();
    // Round-off; the 0.002 px of a blob, which are 0.003 mm at 1 m.
    for (file, out, most_px, most_mm) in [
        ("calibration.json", "exact", 1e-8, 1e-8),
        ("rig.rays", "packed", 0.002, 0.003),
    ] {
        let run = run(path, &["export", file, "--format", "opencv", "-o", out]);
        run.assert_code(0)
            .assert_prints(&["4 files of opencv", "at 1000 mm", "px RMS"]);
        let loss: serde_json::Value =
            serde_json::from_slice(&fs::read(path.join(format!("{out}.loss.json"))).unwrap())
                .unwrap();
        for key in ["rms_px", "max_px"] {
            assert!(loss[key].as_f64().unwrap() < most_px, "{loss}");
        }
        for key in ["rms_mm", "max_mm"] {
            assert!(loss[key].as_f64().unwrap() < most_mm, "{loss}");
        }
        for name in ["left", "right"] {
            let file = path.join(out).join(format!("{name}.yml"));
            let text = fs::read_to_string(&file).unwrap();
            assert!(text.starts_with("%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"));
            assert!(
                text.contains("camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n")
            );
            let lists = lists(&file);
            let coefficients = &lists["distortion_coefficients"];
            assert_eq!(coefficients.len(), 5);
            assert_ideal(&lists["camera_matrix"], coefficients, most_px);
        }
        let lists = lists(&path.join(out).join("extrinsics.yml"));
        let turned = so3::log(&(Matrix3::from_row_slice(&lists["R"]) * rotation.transpose()));
        assert!(turned.norm() < 10.0 * most_px / 600.0, "{turned}");
        let moved_mm = Vector3::from_column_slice(&lists["T"]) - translation_mm;
        assert!(moved_mm.norm() < most_mm, "{moved_mm}");
    }
}

#[test]
fn a_folder_with_results_is_replaced_only_if_asked() {
    let folder = folder();
    let path = folder.path();
    let export = ["export", "rig.rays", "--format", "opencv", "-o", "out"];
    run(path, &export).assert_code(0);
    let before = contents(path);
    run(path, &export)
        .assert_code(2)
        .assert_says(&["exists", "--force"]);
    fs::remove_dir_all(path.join("out")).unwrap();
    run(path, &export)
        .assert_code(2)
        .assert_says(&["out.loss.json: exists"]);
    run(path, &[&export[..], &["--force"]].concat()).assert_code(0);
    assert_eq!(contents(path), before);
}

#[test]
fn forms_that_are_not_built_are_answered_with_those_that_are() {
    let folder = folder();
    let before = contents(folder.path());
    for form in ["mrcal-cahvor", "matlab", "dice"] {
        let export = ["export", "rig.rays", "--format", form, "-o", "out"];
        run(folder.path(), &export)
            .assert_code(2)
            .assert_says(&[form, "hex", "opencv", "ros", "kalibr", "npy"]);
    }
    let needless = ["--format", "opencv", "-o", "out", "--name", "x"];
    run(
        folder.path(),
        &[&["export", "rig.rays"][..], &needless].concat(),
    )
    .assert_code(2)
    .assert_says(&["opencv has no place for --name"]);
    assert_eq!(contents(folder.path()), before);
}

#[test]
fn names_that_make_no_file_are_refused() {
    let folder = folder();
    let path = folder.path();
    for name in ["extrinsics", "../left"] {
        let mut calibration = calibration();
        name.clone_into(&mut calibration.rig.cameras[0].name);
        let json = calibration.to_json().unwrap();
        fs::write(path.join("calibration.json"), json).unwrap();
        let before = contents(path);
        let export = [
            "export",
            "calibration.json",
            "--format",
            "opencv",
            "-o",
            "out",
        ];
        run(path, &export)
            .assert_code(2)
            .assert_says(&[name, "rename the camera"]);
        assert_eq!(contents(path), before);
    }
}

#[test]
fn ros_has_a_file_a_camera_that_opencv_reads_too() {
    let folder = folder();
    let path = folder.path();
    let export = ["export", "calibration.json", "--format", "ros", "-o", "ros"];
    run(path, &export)
        .assert_code(0)
        .assert_prints(&["3 files of ros", "px RMS"]);
    assert!(path.join("ros.loss.json").is_file());
    for name in ["left", "right"] {
        let file = path.join("ros").join(format!("{name}.yaml"));
        let text = fs::read_to_string(&file).unwrap();
        for part in [
            "image_width: 640\nimage_height: 480\n",
            &format!("camera_name: \"{name}\"\n"),
            "camera_matrix:\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 6",
            "distortion_model: plumb_bob\ndistortion_coefficients:\n   rows: 1\n   cols: 5\n",
            "projection_matrix:\n   rows: 3\n   cols: 4\n",
        ] {
            assert!(text.contains(part), "{part:?} is not in:\n{text}");
        }
        let lists = lists(&file);
        assert_ideal(
            &lists["camera_matrix"],
            &lists["distortion_coefficients"],
            1e-8,
        );
        let p = &lists["projection_matrix"];
        let left: Vec<f64> = [0, 1, 2, 4, 5, 6, 8, 9, 10].map(|k| p[k]).into();
        assert_eq!(left, lists["camera_matrix"]);
        assert_eq!([p[3], p[7], p[11]], [0.0; 3]);
    }
}

#[test]
fn kalibr_has_a_chain_in_meters() {
    let folder = folder();
    let path = folder.path();
    let export = [
        "export",
        "calibration.json",
        "--format",
        "kalibr",
        "-o",
        "kalibr",
    ];
    run(path, &export)
        .assert_code(0)
        .assert_prints(&["2 files of kalibr", "px RMS"]);
    let file = path.join("kalibr/camchain.yaml");
    let text = fs::read_to_string(&file).unwrap();
    let (first, second) = text.split_once("cam1:\n").unwrap();
    assert!(
        first.starts_with("cam0:\n  camera_model: pinhole\n"),
        "{first}"
    );
    assert!(second.starts_with("  T_cn_cnm1:\n    - ["), "{second}");
    for (camera, name) in [(first, "left"), (second, "right")] {
        assert!(camera.contains("  resolution: [ 640, 480 ]\n"));
        assert!(camera.contains(&format!("  rostopic: \"/{name}/image_raw\"\n")));
        let list = |key: &str| numbers_behind(camera, key);
        let [fx, fy, cx, cy] = list("intrinsics: ")[..] else {
            panic!("{camera}");
        };
        let matrix = [fx, 0.0, cx, 0.0, fy, cy];
        assert_ideal(&matrix, &list("distortion_coeffs: "), 1e-8);
        assert_eq!(list("distortion_coeffs: ").len(), 4);
    }
    let rows: Vec<Vec<f64>> = second
        .lines()
        .filter(|line| line.starts_with("    - "))
        .map(|line| numbers_behind(line, "- "))
        .collect();
    let (rotation, translation_mm) = truth();
    for (k, row) in rows[..3].iter().enumerate() {
        for (col, found) in row[..3].iter().enumerate() {
            assert!((found - rotation[(k, col)]).abs() < 1e-10);
        }
        assert!((row[3] - translation_mm[k] / 1000.0).abs() < 1e-10);
    }
    assert_eq!((rows.len(), &rows[3][..]), (4, &[0.0, 0.0, 0.0, 1.0][..]));
}

/// The list in brackets that follows.
fn numbers_behind(text: &str, key: &str) -> Vec<f64> {
    let (_, behind) = text.split_once(key).unwrap();
    let (list, _) = behind.trim_start_matches('[').split_once(']').unwrap();
    let numbers = list.split(',');
    numbers
        .map(|number| number.trim().parse().unwrap())
        .collect()
}

#[test]
fn npy_has_the_ray_of_every_pixel() {
    let folder = folder();
    let path = folder.path();
    let camera = &rig().cameras[1];
    for (file, angle) in [("calibration.json", 1e-15), ("rig.rays", 4e-6)] {
        let export = ["export", file, "--format", "npy", "-o", "dense", "--force"];
        let run = run(path, &[&export[..], &["--json"]].concat());
        run.assert_code(0);
        assert!(run.json()["loss"].is_null() && !path.join("dense.loss.json").exists());
        let index = fs::read(path.join("dense/rays.json")).unwrap();
        let index: serde_json::Value = serde_json::from_slice(&index).unwrap();
        assert_eq!(index["arrays"][1]["camera"], "right");
        assert_eq!(
            index["arrays"][1]["shape"],
            serde_json::json!([480, 640, 6])
        );
        let array = index["arrays"][1]["file"].as_str().unwrap();
        let bytes = fs::read(path.join("dense").join(array)).unwrap();
        let start = bytes.len() - 480 * 640 * 6 * 8;
        assert!(start.is_multiple_of(64) && bytes.starts_with(b"\x93NUMPY"));
        let numbers = |u: usize, v: usize| -> [f64; 6] {
            let at = start + (v * 640 + u) * 48;
            let pixel = bytes[at..at + 48].chunks(8);
            let numbers: Vec<f64> = pixel
                .map(|number| f64::from_le_bytes(number.try_into().unwrap()))
                .collect();
            numbers.try_into().unwrap()
        };
        assert!(numbers(3, 4).iter().all(|number| number.is_nan()));
        let [_, _, _, x, y, z] = numbers(100, 300);
        let truth = camera.ray_in_rig(PixelPoint::new(100.0, 300.0)).unwrap();
        assert!((Vector3::new(x, y, z) - truth.direction.normalize()).norm() < angle);
    }
}
