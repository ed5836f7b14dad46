//! `export` to the meshes of chips. What their files mean is tested in `calib-exchange`; here, that the command writes them.

use crate::common::{SENSOR, calibration, contents, run};
use serde_json::Value;
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

fn export<'a>(file: &'a str, format: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["export", file, "--format", format, "-o", "out"], more].concat()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn each_format_is_a_folder_and_its_loss() {
    // Cameras of 640 x 480 px without distortion: the output image is the camera's own, and the loss what its numbers round. TI's offset
    // is as good as 0, and down from just below it is 1/8 px, each way; of NXP's 1/16. Luxonis' pair is turned by 0.12 rad to be rectified, and between nodes
    // a step s apart that is s^2 / 8 times 2 tan(0.12) / f, 0.013 px, along u, and less along v.
    for (format, file, bytes, most_px) in [
        ("mesh-ti", "ldc_left.bin", 4 * 48 * 31, 0.18),
        ("mesh-dw100", "dw100_left.bin", 4 * 41 * 31, 0.09),
        ("mesh-vpi", "vpi_left.f32", 8 * 640 * 480, 1e-4),
        ("mesh-luxonis", "left_mesh.calib", 8 * 41 * 31, 0.02),
        ("mesh", "mesh_left.npy", 128 + 16 * 41 * 31, 1e-6),
    ] {
        let folder = folder();
        let path = folder.path();
        let written = run(path, &export("calibration.json", format, &[]));
        written.assert_code(0).assert_prints(&[
            &format!("4 files of {format}"),
            "px RMS",
            "show nothing calibrated",
            "not tried on the chip",
        ]);
        let out = path.join("out");
        assert_eq!(fs::read(out.join(file)).unwrap().len(), bytes, "{format}");
        let loss = json(&path.join("out.loss.json"));
        let max_px = loss["max_px"].as_f64().unwrap();
        assert!(max_px <= most_px, "{format}: {loss}");
        // A pixel of 600 px at 1000 mm is 1.7 mm.
        assert!(loss["max_mm"].as_f64().unwrap() < 2.0 * max_px + 1e-6);
        assert!(loss["rms_px"].as_f64() <= Some(max_px) && loss["rms_mm"].is_f64());
        let pixels = u64::from(SENSOR.width * SENSOR.height);
        for camera in loss["cameras"].as_array().unwrap() {
            assert_eq!(camera["output_pixels"], pixels);
            // A margin of a tenth all around is not calibrated.
            assert!(camera["outside_pixels"].as_u64().unwrap() > pixels / 5);
        }
        let index = json(&out.join("mesh.json"));
        assert_eq!(index["format"], format);
        assert_eq!(index["is_rectified_pair"], format == "mesh-luxonis");
        let matrix = &index["cameras"][0]["output"]["camera_matrix"];
        if format != "mesh-luxonis" {
            let focal_px = matrix[0][0].as_f64().unwrap();
            assert!((focal_px - 600.0).abs() < 1e-6, "{matrix}");
        }
    }
}

#[test]
fn a_blob_makes_the_same_mesh_to_its_own_error() {
    let folder = folder();
    let path = folder.path();
    let more = ["--camera", "right", "--distance-mm", "400", "--step", "32"];
    for (file, out) in [("calibration.json", "exact"), ("rig.rays", "packed")] {
        let args = ["export", file, "--format", "mesh-ti", "-o", out];
        run(path, &[&args[..], &more].concat()).assert_code(0);
    }
    let table = |out: &str| fs::read(path.join(out).join("ldc_right.bin")).unwrap();
    let (exact, packed) = (table("exact"), table("packed"));
    assert_eq!(exact.len(), packed.len());
    // Offsets near a rounding's edge may take the next eighth.
    for (a, b) in exact.chunks(2).zip(packed.chunks(2)) {
        let number = |bytes: &[u8]| i16::from_le_bytes([bytes[0], bytes[1]]);
        assert!((number(a) - number(b)).abs() <= 1);
    }
    assert!(!path.join("exact/ldc_left.bin").exists());
    assert_eq!(json(&path.join("exact.loss.json"))["distance_mm"], 400.0);
}

#[test]
fn what_cannot_be_made_is_refused_with_the_remedy() {
    let folder = folder();
    let path = folder.path();
    let before = contents(path);
    let cases: [(&str, &[&str], &[&str]); 8] = [
        (
            "mesh-ti",
            &["--step", "12"],
            &["12 px apart", "--step 1, 2, 4"],
        ),
        (
            "mesh-dw100",
            &["--step", "8"],
            &["8 px apart", "leave it out"],
        ),
        ("mesh-vpi", &["--step", "128"], &["128 px apart", "or 64"]),
        (
            "mesh-luxonis",
            &["--step", "7"],
            &["do not divide", "--step"],
        ),
        ("mesh", &["--step", "0"], &["0 px apart"]),
        (
            "mesh",
            &["--camera", "top"],
            &["no camera \"top\"", "left, right"],
        ),
        ("mesh", &["--zoom", "0"], &["above 0"]),
        (
            "opencv",
            &["--step", "16"],
            &["opencv has no place for --step"],
        ),
    ];
    for (format, more, says) in cases {
        run(path, &export("calibration.json", format, more))
            .assert_code(2)
            .assert_says(says);
        assert_eq!(contents(path), before, "{format}");
    }
    // An output image of the spot behind everything that was calibrated.
    run(
        path,
        &export(
            "calibration.json",
            "mesh",
            &["--zoom", "1e-9", "--step", "640"],
        ),
    )
    .assert_code(2)
    .assert_says(&["no node", "--zoom"]);
    assert_eq!(contents(path), before);
}
