//! `audit` of `OpenCV`'s own calibration of the real pairs (`scripts/audit_opencv.py` wrote the files) finds `OpenCV`'s own figures.

use crate::common::documented::assert_documented;
use crate::common::run;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A dataset of `OpenCV`'s corners of the real pairs, poses counted from 0, and its calibration's files.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let stereo = root().join("data/opencv-stereo");
    fs::create_dir(path.join("set")).unwrap();
    fs::copy(stereo.join("dataset.toml"), path.join("set/dataset.toml")).unwrap();
    let corners = fs::read_to_string(stereo.join("corners_opencv.csv")).unwrap();
    fs::write(path.join("set/corners.csv"), corners).unwrap();
    for entry in fs::read_dir(root().join("calib-offline/exchange/golden/opencv-stereo")).unwrap() {
        let file = entry.unwrap().path();
        fs::copy(&file, path.join(file.file_name().unwrap())).unwrap();
    }
    folder
}

#[test]
fn opencvs_own_calibration_has_opencvs_own_rms() {
    let folder = folder();
    let path = folder.path();
    let figures = fs::read(root().join("data/opencv-figures/opencv-stereo.json")).unwrap();
    let figures: Value = serde_json::from_slice(&figures).unwrap();
    let files = ["left.yml", "right.yml", "extrinsics.yml"];
    let audit = [&["audit"], &files[..], &["set", "--unit", "mm", "--json"]].concat();
    let found = run(path, &audit);
    found.assert_code(0);
    let found = found.json();
    let theirs = &found["calibrations"][0];
    let number = |value: &Value| value.as_f64().unwrap();
    // Four digits.
    let agrees = |found: &Value, figure: &Value| {
        let (found, figure) = (number(found), number(figure));
        println!("audit {found:.6} px, OpenCV {figure:.6} px");
        assert!((found - figure).abs() < 5e-5 * figure, "{found} {figure}");
    };
    for camera in theirs["cameras"].as_array().unwrap() {
        let name = camera["name"].as_str().unwrap();
        agrees(&camera["rms_px"], &figures["cameras"][name]["rms_px"]);
        let regions = camera["regions"].as_array().unwrap();
        let counted: f64 = regions
            .iter()
            .map(|region| number(&region["corners"]))
            .sum();
        assert_eq!(counted, number(&camera["corners"]));
        assert_eq!(number(&camera["unanswered"]), 0.0);
    }
    agrees(
        &theirs["together_rms_px"],
        &figures["stereo_fixed_intrinsics"]["rms_px"],
    );
    assert_eq!(theirs["saw_these"], Value::Null);
    // Ours on boards that it never saw, beside theirs on the same corners.
    let (ours, common) = (&found["ours"]["common"], &theirs["common"]);
    for figure in ["rms_px", "neighbor_rms_mm", "rigid_rms_mm"] {
        println!("{figure}: theirs {}, ours {}", common[figure], ours[figure]);
        assert!(number(&common[figure]) > 0.0 && number(&ours[figure]) > 0.0);
    }
    assert!(number(&found["common_corners"]) > 0.9 * number(&found["corners"]));
    let conclusion = found["conclusion"].to_string();
    assert!(
        conclusion.contains("only if these images are new"),
        "{conclusion}"
    );

    // A calibration a percent too large is named as that, and ours is told from it.
    let places = fs::read_to_string(path.join("extrinsics.yml")).unwrap();
    let scaled = with_longer_baseline(&places, 1.01);
    fs::write(path.join("extrinsics.yml"), scaled).unwrap();
    let wrong = run(path, &audit).json();
    let theirs = &wrong["calibrations"][0];
    let scale = number(&theirs["points"]["scale_percent"]);
    assert!((scale - 1.0).abs() < 0.1, "{scale}");
    assert!(
        wrong["conclusion"].to_string().contains("too long"),
        "{}",
        wrong["conclusion"]
    );
    let low = number(&theirs["against_ours"]["neighbor"]["low"]);
    assert!(low > 1.0, "{low}");
    let parts = ["residual", "neighbor", "rigid"].map(|part| {
        let key = |of: &str| format!("ours.against_ours.{part}{of}");
        ["", ".ratio", ".low", ".high", ".boards"].map(key)
    });
    let never: Vec<(&str, &str)> = parts
        .as_flattened()
        .iter()
        .map(|key| (key.as_str(), "ours is not held against itself"))
        .collect();
    assert_documented("audit", "calib-offline/audit/1", &[found, wrong], &never);
}

/// `T` times a factor.
fn with_longer_baseline(text: &str, factor: f64) -> String {
    let (before, matrix) = text.split_once("T:").unwrap();
    let (head, list) = matrix.split_once('[').unwrap();
    let (list, behind) = list.split_once(']').unwrap();
    let scaled: Vec<String> = list
        .split(',')
        .map(|number| format!("{:?}", factor * number.trim().parse::<f64>().unwrap()))
        .collect();
    format!("{before}T:{head}[ {} ]{behind}", scaled.join(", "))
}

#[test]
fn cameras_of_other_names_and_sizes_are_refused() {
    let folder = folder();
    let path = folder.path();
    fs::rename(path.join("left.yml"), path.join("first.yml")).unwrap();
    let audit = ["audit", "first.yml", "right.yml", "set"];
    run(path, &audit).assert_code(2).assert_says(&[
        "first.yml",
        "first, right",
        "left, right",
        "--names",
    ]);
    // Nobody says where the cameras stand: pixels are judged all the same, points are not.
    let named = [&audit[..], &["--names", "left,right", "--json"]].concat();
    let found = run(path, &named);
    found.assert_code(0);
    let theirs = &found.json()["calibrations"][0];
    assert!(theirs["rms_px"].is_number() && theirs["points"].is_null());
    let wide = fs::read_to_string(path.join("first.yml")).unwrap();
    fs::write(
        path.join("first.yml"),
        wide.replace("image_width: 640", "image_width: 800"),
    )
    .unwrap();
    run(path, &[&audit[..], &["--names", "left,right"]].concat())
        .assert_code(2)
        .assert_says(&["800 x 480", "640 x 480"]);
}

#[test]
fn exchanged_files_are_no_match_for_ours_and_a_unit_is_that_of_the_files_that_need_it() {
    let folder = folder();
    let path = folder.path();
    // The second camera's file first: with these R and T every corner lies behind the cameras.
    let exchanged = ["audit", "right.yml", "left.yml", "extrinsics.yml", "set"];
    let found = run(
        path,
        &[&exchanged[..], &["--unit", "mm", "--json"]].concat(),
    );
    let found = found.assert_code(0).json();
    assert_eq!(found["calibrations"][0]["points"]["points"], 0);
    let conclusion = found["conclusion"].to_string();
    assert!(conclusion.contains("wrong order"), "{conclusion}");
    assert!(!conclusion.contains("as good as"), "{conclusion}");

    // The same cameras once more, in meters.
    let own = ["left.yml", "right.yml", "extrinsics.yml"];
    let unit = ["--unit", "mm"];
    let import = [&["import"], &own[..], &unit, &["-o", "own.json"]].concat();
    run(path, &import).assert_code(0);
    let export = ["export", "own.json", "-o", "kalibr", "--format", "kalibr"];
    run(path, &export).assert_code(0);
    let rest = ["kalibr/camchain.yaml", "set", "--json"];
    let names = ["--names", "left,right"];
    let both = [&["audit"], &own[..], &rest, &unit, &names].concat();
    let found = run(path, &both).assert_code(0).json();
    for calibration in found["calibrations"].as_array().unwrap() {
        let scale = calibration["points"]["scale_percent"].as_f64().unwrap();
        // In millimeters taken for meters it is 1e5.
        assert!(scale.abs() < 1.0, "{scale}");
    }
    assert_eq!(found["calibrations"].as_array().unwrap().len(), 2);
}
