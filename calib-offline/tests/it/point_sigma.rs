//! Predicted standard deviations of points: the blob against the calibration, and what `measure`
//! writes with either.

use crate::common::standard::standard;
use crate::common::{project, run, with_uncertainty};
use calib_blob::matches::BlobSource;
use calib_blob::pack::{AlignedBytes, PackSettings, pack};
use calib_rays::field::PairUncertainty;
use calib_rays::field::uncertainty::packed;
use calib_rays::measure::{PointSource, RigSource};
use calib_simulate::{MatchSet, OpticsKind};
use nalgebra::{Matrix4, Vector3};
use ray_runtime::RayBlob;
use std::fs;
use std::path::Path;

/// What `ray-runtime/FORMAT.md` states of smooth lenses: RMS and worst relative deviation of a
/// standard deviation of a point from the calibration's.
const STATED_RMS: f64 = 0.014;
const STATED_WORST: f64 = 0.11;
/// What it states of any lens, where more nodes can reach it.
const MOST_RMS: f64 = 0.05;

/// The points of a match list along each axis, in the rig's frame and in a camera's.
fn assert_agreement(optics: OpticsKind) {
    let found = standard(optics, 1);
    let mut estimate = found.estimate.clone();
    let mut rig = estimate.rig(&["left".to_string(), "right".to_string()]);
    estimate.fill_uncertainty(&mut rig).unwrap();
    let result = pack(&rig, &PackSettings::default()).unwrap();
    let bytes = AlignedBytes::from(result.bytes.as_slice());
    let blob = RayBlob::open(&bytes).unwrap();
    let matches = found.scene.matches(MatchSet::Points, 1500);
    for frame in [None, Some("right")] {
        let ours = RigSource::new(&rig, frame).unwrap();
        let theirs = BlobSource::new(&blob, frame).unwrap();
        let (mut sum, mut worst, mut count) = (0.0, 0.0_f64, 0.0);
        for asked in &matches {
            let [a, b] = [0, 1].map(|k| (k, [asked.pixels[k].u, asked.pixels[k].v]));
            let Ok(exact) = ours.point(&[a, b]) else {
                continue;
            };
            let single = [a, b].map(|(k, pixel)| (k, pixel.map(|x| x as f32)));
            let found = theirs.point(&single).unwrap().sigma_mm.unwrap();
            for (found, exact) in found.into_iter().zip(exact.sigma_mm.unwrap()) {
                let deviation = f64::from(found) / exact - 1.0;
                sum += deviation * deviation;
                worst = worst.max(deviation.abs());
                count += 1.0;
            }
        }
        let rms = f64::sqrt(sum / count);
        println!("{optics:?} {frame:?}: {rms:.5} RMS, {worst:.5} worst of {count}");
        assert!(count > 3000.0, "{count}");
        assert!(rms < STATED_RMS && worst < STATED_WORST, "{rms} {worst}");
    }
    // What the packer says of itself holds as well, and the part without noise is coarser.
    let [pair] = &result.pairs[..] else {
        panic!("{:?}", result.pairs)
    };
    assert!(pair.bytes <= 700, "{}", pair.bytes);
    assert!(pair.sigma_error.rms < STATED_RMS && pair.sigma_error.worst < STATED_WORST);
    assert!(pair.calibration_sigma_error.rms < 0.08);
    // It can be left out, and then costs nothing.
    let without = PackSettings {
        with_uncertainty: false,
        ..PackSettings::default()
    };
    let without = pack(&rig, &without).unwrap();
    assert!(without.pairs.is_empty());
    assert!(without.bytes.len() <= result.bytes.len() - pair.bytes);
}

#[test]
fn a_blob_predicts_what_the_calibration_predicts_for_lenses() {
    assert_agreement(OpticsKind::Brown);
}

#[test]
fn a_blob_predicts_what_the_calibration_predicts_behind_a_port() {
    assert_agreement(OpticsKind::Port);
}

/// A folder with a calibration, a blob of it, a blob without uncertainty, and one match: the point
/// at the origin of the rig's frame, 500 mm from the middle between two cameras 120 mm apart.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let calibration = with_uncertainty();
    fs::write(
        folder.path().join("calibration.json"),
        calibration.to_json().unwrap(),
    )
    .unwrap();
    for (name, flag) in [("rig.rays", "--quiet"), ("bare.rays", "--no-uncertainty")] {
        run(
            folder.path(),
            &["pack", "calibration.json", "-o", name, flag],
        )
        .assert_code(0);
    }
    let [l, r] = [0, 1].map(|k| project(&calibration.rig, k, &Vector3::zeros()));
    let line = format!("a,{},{},{},{}\n", l.u, l.v, r.u, r.v);
    fs::write(
        folder.path().join("m.csv"),
        format!("id,u_left,v_left,u_right,v_right\n{line}"),
    )
    .unwrap();
    folder
}

/// The three fields of the only point.
fn sigma(folder: &Path, rig: &str, frame: &[&str]) -> Vec<String> {
    let arguments = [&["measure", rig, "m.csv", "-o", "p.csv"], frame].concat();
    run(folder, &arguments).assert_code(0);
    let text = fs::read_to_string(folder.join("p.csv")).unwrap();
    let row = text.lines().nth(1).unwrap();
    let fields: Vec<&str> = row.split(',').collect();
    assert_eq!(fields.last(), Some(&"ok"));
    fields[5..8]
        .iter()
        .map(|field| (*field).to_owned())
        .collect()
}

#[test]
fn measure_fills_sigma_from_a_blob_in_the_frame_asked_for() {
    let folder = folder();
    for frame in [&[][..], &["--frame", "left"]] {
        let numbers = |rig: &str| -> Vec<f64> {
            let fields = sigma(folder.path(), rig, frame);
            fields.iter().map(|field| field.parse().unwrap()).collect()
        };
        let (blob, exact) = (numbers("rig.rays"), numbers("calibration.json"));
        for (blob, exact) in blob.iter().zip(&exact) {
            // One part in 127 of a factor, and single precision.
            assert!((blob / exact - 1.0).abs() < 5e-3, "{blob} {exact}");
        }
        if frame.is_empty() {
            // By hand: 0.05 px at 600 px and 503.6 mm are 0.0420 mm across a ray. The mean of two
            // rays halves the variance along y; depth divides it by the sine of half the angle
            // between the rays (60 of 503.6), width by its cosine.
            let across_mm = 0.05 / 600.0 * (500.0f64 * 500.0 + 60.0 * 60.0).sqrt();
            let half_mm = across_mm / 2.0f64.sqrt();
            let tangent = 60.0 / 500.0;
            let depth_mm = half_mm * (1.0f64 + tangent * tangent).sqrt() / tangent;
            assert!((exact[1] / half_mm - 1.0).abs() < 0.01, "{exact:?}");
            assert!((exact[2] / depth_mm - 1.0).abs() < 0.02, "{exact:?}");
        }
    }
    assert_eq!(sigma(folder.path(), "bare.rays", &[]), ["", "", ""]);
}

#[test]
fn inspect_and_pack_say_what_the_uncertainty_is_and_costs() {
    let folder = folder();
    let inspect = |file: &str| {
        run(folder.path(), &["inspect", file, "--json"])
            .assert_code(0)
            .json()
    };
    let pairs = inspect("rig.rays")["pairs"].clone();
    assert_eq!(pairs[0]["cameras"], serde_json::json!(["left", "right"]));
    let noise_px = pairs[0]["noise_px"].as_f64().unwrap();
    assert!((noise_px - 0.04).abs() < 1e-6, "{noise_px}");
    assert_eq!(inspect("bare.rays")["pairs"], serde_json::json!([]));
    let words = run(folder.path(), &["inspect", "bare.rays"]).stdout;
    assert!(words.contains("no sigma"), "{words}");

    let pack = ["pack", "calibration.json", "-o", "again.rays", "--json"];
    let object = run(folder.path(), &pack).assert_code(0).json();
    assert_eq!(object["pairs"][0]["bytes"], pairs[0]["bytes"]);
    let words = run(
        folder.path(),
        &["pack", "calibration.json", "-o", "again.rays"],
    );
    let stated = format!("{} of the bytes", pairs[0]["bytes"]);
    assert!(words.stdout.contains(&stated), "{}", words.stdout);
}

#[test]
fn what_varies_from_node_to_node_gets_more_nodes() {
    let mut rig = with_uncertainty().rig;
    let uncertainty = &mut rig.uncertainty[0];
    (uncertainty.nodes_u, uncertainty.nodes_v) = (9, 7);
    // Nothing but the calibration's part, three times as large along every third column.
    uncertainty.noise_px2 = 0.0;
    uncertainty.calibration_px2 = (0..63)
        .map(|k| if k % 9 % 3 == 0 { 0.0009 } else { 0.0001 })
        .map(|px2| packed(&(Matrix4::identity() * px2)))
        .collect();
    let settings = PackSettings {
        max_error_px: 0.002,
        ..PackSettings::default()
    };
    let result = pack(&rig, &settings).unwrap();
    let pair = &result.pairs[0];
    println!("{pair:?}");
    assert!(pair.nodes[0] > 8, "{pair:?}");
    assert!(pair.sigma_error.rms < MOST_RMS, "{pair:?}");
}

#[test]
fn pairs_of_three_cameras_stand_in_order_and_are_told_apart() {
    let mut rig = with_uncertainty().rig;
    let mut third = rig.cameras[1].clone();
    third.name = "third".to_owned();
    rig.cameras.push(third);
    let mut with_third = rig.uncertainty[0].clone();
    with_third.second = 2;
    // Twice the size of the other pair's standard deviations.
    for node in &mut with_third.calibration_px2 {
        *node = node.map(|x| 4.0 * x);
    }
    with_third.noise_px2 *= 4.0;
    rig.uncertainty.insert(0, with_third);
    let settings = PackSettings {
        max_error_px: 0.002,
        ..PackSettings::default()
    };
    let bytes = pack(&rig, &settings).unwrap().bytes;
    let bytes = AlignedBytes::from(bytes.as_slice());
    let blob = RayBlob::open(&bytes).unwrap();
    let pairs: Vec<_> = blob.uncertain_pairs().map(|pair| pair.cameras).collect();
    assert_eq!(pairs, [[0, 1], [0, 2]]);

    let source = BlobSource::new(&blob, None).unwrap();
    let seen = [0, 1, 1].map(|camera| project(&rig, camera, &Vector3::zeros()));
    let seen = seen.map(|pixel| [pixel.u as f32, pixel.v as f32]);
    let sigma = |cameras: &[usize]| {
        let sightings: Vec<_> = cameras.iter().map(|k| (*k, seen[*k])).collect();
        source.point(&sightings).map(|point| point.sigma_mm)
    };
    let (near, far) = (
        sigma(&[0, 1]).unwrap().unwrap(),
        sigma(&[2, 0]).unwrap().unwrap(),
    );
    for (near, far) in near.into_iter().zip(far) {
        assert!((far / near - 2.0).abs() < 1e-3, "{near} {far}");
    }
    // More than two rays give a point, but of them nothing is known.
    assert_eq!(sigma(&[0, 1, 2]), Ok(None));
}

#[test]
fn an_uncertainty_that_is_none_is_refused() {
    type Spoil = fn(&mut PairUncertainty);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("calibration.json");
    let spoils: [(Spoil, &str); 5] = [
        (|u| u.second = 2, "wrong length"),
        (|u| u.nodes_u = 4, "wrong length"),
        (|u| u.nodes_v = usize::MAX, "wrong length"),
        (|u| u.noise_px2 = -1.0, "not finite"),
        // Well-formed, but more correlated than can be.
        (|u| u.calibration_px2[0][1] = 1.0, "not a covariance"),
    ];
    for (spoil, reason) in spoils {
        let mut calibration = with_uncertainty();
        spoil(&mut calibration.rig.uncertainty[0]);
        fs::write(&path, calibration.to_json().unwrap()).unwrap();
        run(folder.path(), &["pack", "calibration.json", "-o", "r.rays"])
            .assert_code(2)
            .assert_says(&[reason]);
        assert!(!folder.path().join("r.rays").exists());
    }
}
