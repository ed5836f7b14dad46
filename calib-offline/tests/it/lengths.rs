//! Lengths between measured points: their predicted standard deviations against the truth and by hand, known
//! lengths in `measure`, and the expected error of a task.

use crate::common::against_truth::MATCHES;
use crate::common::standard::standard;
use crate::common::{MANIFEST, corners_csv, dataset, project, run, with_uncertainty};
use calib_estimate::joint::Ends;
use calib_judge::{Declared, Task, expected_error};
use calib_rays::field::Rig;
use calib_rays::geometry::PixelPoint;
use calib_simulate::{MatchSet, OpticsKind, TrueMatch};
use nalgebra::Vector3;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Draws of the noise of the calibration's corners.
const DRAWS: u64 = 16;
/// Lengths of each.
const LENGTHS: usize = 120;

fn names() -> [String; 2] {
    ["left", "right"].map(str::to_owned)
}

fn sightings(pixels: &[PixelPoint]) -> [(usize, PixelPoint); 2] {
    [(0, pixels[0]), (1, pixels[1])]
}

/// A length, with noisy pixels and with exact ones, and how long it is.
fn known(rig: &Rig, matches: &[TrueMatch]) -> Vec<(Ends, Ends, f64)> {
    let measured = |m: &&TrueMatch| {
        [&m.pixels, &m.true_pixels]
            .iter()
            .all(|pixels| rig.triangulate(&sightings(pixels)).is_ok())
    };
    let measured: Vec<&TrueMatch> = matches.iter().filter(measured).collect();
    let pairs = measured.chunks_exact(2).take(LENGTHS);
    pairs
        .map(|pair| {
            (
                [0, 1].map(|k| sightings(&pair[k].pixels)),
                [0, 1].map(|k| sightings(&pair[k].true_pixels)),
                (pair[1].point_in_datum - pair[0].point_in_datum).norm(),
            )
        })
        .collect()
}

fn length_mm(rig: &Rig, ends: &Ends) -> f64 {
    let [a, b] = ends.map(|end| rig.triangulate(&end).unwrap().point_mm);
    (b - a).norm()
}

/// Mean of some, and three standard deviations of it as their scatter says.
fn mean_and_three_sigma(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, 3.0 * (variance / count).sqrt())
}

#[test]
fn predicted_standard_deviations_of_lengths_are_those_of_their_errors() {
    let (mut totals, mut calibrations) = (Vec::new(), Vec::new());
    for seed in 1..=DRAWS {
        let found = standard(OpticsKind::Brown, seed);
        let rig = found.estimate.rig(&names());
        let lengths = known(&rig, &found.scene.matches(MatchSet::Points, MATCHES));
        assert_eq!(lengths.len(), LENGTHS);
        let noise_px2 = found.estimate.pixel_variance_px2();
        let ends: Vec<Ends> = lengths.iter().map(|(noisy, ..)| *noisy).collect();
        let variances = found.estimate.length_variances(&rig, &ends).unwrap();
        let (mut total, mut calibration, mut predicted) = (0.0, 0.0, 0.0);
        for ((noisy, exact, true_mm), variance) in lengths.iter().zip(variances) {
            let variance = variance.unwrap();
            let open_mm2 = variance.calibration_mm2 + variance.board_shape_mm2;
            let all_mm2 = open_mm2 + variance.per_px2 * noise_px2;
            total += (length_mm(&rig, noisy) - true_mm).powi(2) / all_mm2;
            calibration += (length_mm(&rig, exact) - true_mm).powi(2);
            predicted += open_mm2;
        }
        totals.push(total / LENGTHS as f64);
        calibrations.push(calibration / predicted);
    }
    // All lengths of a draw share its calibration: what is independent are the draws.
    let (all, three_sigma) = mean_and_three_sigma(&totals);
    println!("all: {all:.3} +- {three_sigma:.3} of the predicted square {totals:.2?}");
    assert!((all - 1.0).abs() < three_sigma, "{all} {totals:?}");
    let (part, three_sigma) = mean_and_three_sigma(&calibrations);
    println!("calibration: {part:.3} +- {three_sigma:.3} {calibrations:.2?}");
    assert!((part - 1.0).abs() < three_sigma, "{part} {calibrations:?}");
}

/// The joint covariance of both points with the best motion taken out has the same length in it.
#[test]
fn the_variance_of_a_length_is_that_of_its_two_points_together() {
    let found = standard(OpticsKind::Brown, 1);
    let rig = found.estimate.rig(&names());
    let lengths = known(&rig, &found.scene.matches(MatchSet::Points, MATCHES));
    let ends: Vec<Ends> = lengths.iter().map(|(noisy, ..)| *noisy).take(9).collect();
    let variances = found.estimate.length_variances(&rig, &ends).unwrap();
    for (ends, variance) in ends.iter().zip(variances) {
        let variance = variance.unwrap();
        let points = ends.map(|end| rig.triangulate(&end).unwrap().point_mm);
        let along = (points[1] - points[0]).normalize();
        let joint = found.estimate.clone().point_covariance(&rig, ends);
        let joint = joint.unwrap().unwrap();
        let mut form = nalgebra::DVector::zeros(6);
        form.fixed_rows_mut::<3>(0).copy_from(&-along);
        form.fixed_rows_mut::<3>(3).copy_from(&along);
        let expected = form.dot(&(&joint * &form));
        let sum = variance.calibration_mm2 + variance.board_shape_mm2;
        assert!((sum / expected - 1.0).abs() < 1e-6, "{sum} {expected}");
        assert!(variance.calibration_mm2 > 0.0 && variance.board_shape_mm2 > 0.0);
    }
}

#[test]
fn the_shares_of_a_task_add_up_in_squares() {
    let found = standard(OpticsKind::Brown, 1);
    let rig = found.estimate.rig(&names());
    let distances = found.estimate.board_distances_mm(&rig);
    let task = Task {
        length_mm: 40.0,
        distance_mm: distances[distances.len() / 2],
    };
    let board = Declared {
        scale_ppm_sd: Some(150.0),
        temperature_ppm_sd: None,
        match_noise_px: None,
    };
    let expected = expected_error(&found.estimate, &rig, &task, &board).unwrap();
    println!("{expected:?}");
    let shares = &expected.shares_mm;
    assert!((shares.board_scale.unwrap() - 40.0 * 150e-6).abs() < 1e-12);
    assert_eq!(shares.temperature, None);
    let sum = shares.pixel_noise.powi(2)
        + shares.calibration.powi(2)
        + shares.board_shape.powi(2)
        + shares.board_scale.unwrap().powi(2);
    assert!((sum.sqrt() / expected.sd_mm - 1.0).abs() < 1e-12);
    assert!((expected.error95_mm / expected.sd_mm - 1.96).abs() < 1e-12);
    assert!(expected.worst.sd_mm >= expected.sd_mm);
    let lines: usize = expected.directions.iter().map(|own| own.lines).sum();
    assert_eq!(lines, expected.lines);
    // The errors of the two ends go together, and that helps a length shorter than the field is smooth.
    assert!(expected.if_ends_independent_mm > expected.sd_mm);
    // Noisier matches cost their share, and no other.
    let declared = Declared {
        match_noise_px: Some(3.0 * expected.pixel_noise_px),
        ..board
    };
    let noisier = expected_error(&found.estimate, &rig, &task, &declared).unwrap();
    let ratio = noisier.shares_mm.pixel_noise / shares.pixel_noise;
    assert!((ratio - 3.0).abs() < 1e-9, "{ratio}");
    assert_eq!(noisier.shares_mm.calibration, shares.calibration);
}

/// What `calibrate --task` says of the standard recording with a manifest.
fn task_of(manifest: &str) -> Value {
    let home = dataset(manifest, corners_csv(6).as_bytes());
    let task = ["--task", "length 50 mm at 500 mm"];
    let arguments = [&["calibrate", "set", "-o", "out", "--json"][..], &task].concat();
    let run = run(home.path(), &arguments);
    // A verdict of so small a recording may be fail.
    assert!(run.code <= 1, "{}", run.stderr);
    let page = fs::read_to_string(home.path().join("out/report.html")).unwrap();
    assert!(page.contains("Length of 50 mm at 500 mm") && page.contains("Signature"));
    run.json()
}

#[test]
fn a_certificate_corrects_squares_and_adds_its_shares() {
    let certified = MANIFEST.replacen(
        "[[camera]]",
        "[board.certificate]\nscale_ppm_sd = 60.0\nexpansion_ppm_per_k = 100.0\nexpansion_ppm_per_k_sd = 6.0\n\
         calibrated_at_c = 20.0\nused_at_c = 30.0\nused_at_c_sd = 0.8\n\n[[camera]]",
        1,
    );
    let (without, with) = (task_of(MANIFEST), task_of(&certified));
    let number = |object: &Value, path: &str| object.pointer(path).unwrap().as_f64().unwrap();
    // 10 K of 100 ppm: all lengths are a thousandth larger. The estimate converges to 1e-8.
    let ratio = number(&with, "/baseline_mm/0") / number(&without, "/baseline_mm/0");
    assert!((ratio - 1.001).abs() < 1e-6, "{ratio}");
    // 10 K of 6 ppm/K and 0.8 K of 100 ppm/K: 100 ppm of 50 mm.
    let temperature = number(&with, "/task/shares_mm/temperature");
    assert!((temperature - 50.0 * 100e-6).abs() < 1e-12);
    let scale = number(&with, "/task/shares_mm/board_scale");
    assert!((scale - 50.0 * 60e-6).abs() < 1e-12);
    for key in ["board_scale", "temperature"] {
        assert_eq!(without["task"]["shares_mm"][key], Value::Null);
    }
}

#[test]
fn a_task_that_cannot_be_answered_says_why() {
    let home = dataset(MANIFEST, corners_csv(6).as_bytes());
    let calibrate = |task: &str, method: &str| {
        run(
            home.path(),
            &[
                "calibrate",
                "set",
                "-o",
                "out",
                "--task",
                task,
                "--method",
                method,
            ],
        )
    };
    calibrate("length 50 at 500 mm", "joint")
        .assert_code(2)
        .assert_says(&["\"50\" has no unit", "length 100 mm at 800 mm"]);
    calibrate("length 50 mm at 5000 mm", "joint")
        .assert_code(3)
        .assert_says(&["no board was recorded at 5000 mm", "ask for a distance"]);
    calibrate("length 900 mm at 500 mm", "joint")
        .assert_code(3)
        .assert_says(&["no length of 900 mm", "shorter"]);
    calibrate("length 50 mm at 500 mm", "alternating")
        .assert_code(2)
        .assert_says(&["does not know how uncertain", "--method"]);
    assert!(!home.path().join("out").exists());
}

/// A calibration and its blob, with matches of points at known places.
fn measured() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let calibration = with_uncertainty();
    let path = folder.path();
    fs::write(
        path.join("calibration.json"),
        calibration.to_json().unwrap(),
    )
    .unwrap();
    run(path, &["pack", "calibration.json", "-o", "rig.rays"]).assert_code(0);
    let mut matches = "id,u_left,v_left,u_right,v_right\n".to_owned();
    for (id, point) in [
        ("a", [0.0, 0.0, 0.0]),
        ("\"b,1\"", [30.0, 40.0, 0.0]),
        ("c", [0.0, 0.0, 20.0]),
    ] {
        let [l, r] = [0, 1].map(|k| project(&calibration.rig, k, &Vector3::from(point)));
        let _ = writeln!(matches, "{id},{},{},{},{}", l.u, l.v, r.u, r.v);
    }
    fs::write(path.join("m.csv"), matches + "off,-900,0,0,0\n").unwrap();
    folder
}

fn check(folder: &Path, rig: &str, lengths: &str, code: i32) -> Value {
    fs::write(folder.join("l.csv"), lengths).unwrap();
    let arguments = [
        "measure",
        rig,
        "m.csv",
        "-o",
        "p.csv",
        "--lengths",
        "l.csv",
        "--json",
    ];
    run(folder, &arguments).assert_code(code).json()["known_lengths"].clone()
}

#[test]
fn known_lengths_are_held_against_their_limits() {
    let folder = measured();
    let header = "id_a,id_b,length_mm,limit_mm\n";
    let rows = format!("{header}a,\"b,1\",50.01,0.02\na,c,20,0.01\n");
    for (rig, round_off_mm) in [("calibration.json", 1e-9), ("rig.rays", 2e-3)] {
        let found = check(folder.path(), rig, &rows, 0);
        assert_eq!(found["verdict"], "pass");
        let first = &found["lengths"][0];
        assert!(
            (first["error_mm"].as_f64().unwrap() + 0.01).abs() < round_off_mm,
            "{first}"
        );
        assert_eq!(first["inside"], true);
        // As in the test of sigma: 0.05 px are 0.0420 mm across a ray, the mean of two halves the variance,
        // and depth divides by the sine of half their angle. Two ends double it.
        let depth = found["lengths"][1]["sd_mm"].as_f64().unwrap();
        let tangent: f64 = 60.0 / 500.0;
        let across_mm = 0.05 / 600.0 * f64::hypot(500.0, 60.0);
        let by_hand = across_mm * (1.0 + tangent * tangent).sqrt() / tangent;
        // The far end is 4 % farther.
        assert!((depth / by_hand - 1.0).abs() < 0.06, "{depth} {by_hand}");
    }
    let beyond = check(
        folder.path(),
        "rig.rays",
        &format!("{header}a,\"b,1\",50.1,0.02\n"),
        1,
    );
    assert_eq!(beyond["verdict"], "fail");
    let untested = check(
        folder.path(),
        "rig.rays",
        &format!("{header}a,off,50,0.02\n"),
        0,
    );
    assert_eq!(untested["verdict"], "doubtful");
    assert_eq!(untested["lengths"][0]["measured_mm"], Value::Null);
    let free = check(
        folder.path(),
        "rig.rays",
        "id_a,id_b,length_mm\na,c,21\n",
        0,
    );
    assert_eq!(free["verdict"], Value::Null);

    let words = run(
        folder.path(),
        &[
            "measure",
            "rig.rays",
            "m.csv",
            "-o",
            "p.csv",
            "--lengths",
            "l.csv",
        ],
    );
    for part in [
        "length measurement errors",
        "no limit is given",
        "no acceptance test",
    ] {
        assert!(words.stdout.contains(part), "{}", words.stdout);
    }
}

#[test]
fn lengths_that_cannot_be_checked_are_errors_with_their_line() {
    let folder = measured();
    let path = folder.path();
    let refused = |lengths: &str, reasons: &[&str]| {
        fs::write(path.join("l.csv"), lengths).unwrap();
        run(
            path,
            &[
                "measure",
                "rig.rays",
                "m.csv",
                "-o",
                "p.csv",
                "--lengths",
                "l.csv",
            ],
        )
        .assert_code(2)
        .assert_says(reasons);
        assert!(!path.join("p.csv").exists());
    };
    let header = "id_a,id_b,length_mm\n";
    refused(
        &format!("{header}a,c,20\na,z,20\n"),
        &["l.csv:3: no match has the id \"z\"", "first column"],
    );
    refused(
        &format!("{header}a,c,-20\n"),
        &["l.csv:2: length_mm is \"-20\""],
    );
    refused(
        &format!("{header}a,c,20\nc,a,20\n"),
        &["l.csv:3: the length from \"c\" to \"a\" stands in line 2 already"],
    );
    refused("a,c,20\n", &["l.csv:1: the header is \"a,c,20\""]);
    let twice = fs::read_to_string(path.join("m.csv")).unwrap() + "c,1,1,1,1\n";
    fs::write(path.join("m.csv"), twice).unwrap();
    refused(
        &format!("{header}a,c,20\n"),
        &["m.csv:6: the id \"c\" stands in line 4 already"],
    );
}
