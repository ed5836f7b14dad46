//! Matches that are noisier than the corners of the calibration: said, written into the blob, or estimated from the
//! gaps, on the host and on a device.

use crate::common::documented::assert_documented;
use crate::common::standard::standard;
use crate::common::{project, run, with_uncertainty};
use calib_blob::matches::{BlobSource, noise_with_blob, noise_with_calibration};
use calib_blob::pack::{AlignedBytes, PackSettings, pack};
use calib_rays::geometry::best_placement;
use calib_rays::measure::{PointSource, RigSource};
use calib_simulate::{MatchSet, OpticsKind, Scene, SceneSettings, TrueMatch};
use firmware_sim::simulated::host::SimulatedDevice;
use nalgebra::Vector3;
use ray_runtime::{MatchNoise, RayBlob};
use std::fmt::Write as _;
use std::fs;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;

/// Five times that of the corners.
const NOISE_PX: f64 = 0.25;
const MATCHES: usize = 1500;

/// Share of errors within two predicted standard deviations, along all axes; the placement of the rig, which sigma
/// is not about, taken out.
fn within_two_sigma<N>(source: &dyn PointSource<Number = N>, matches: &[TrueMatch]) -> f64
where
    N: calib_rays::measure::Number,
{
    let mut points = Vec::new();
    for asked in matches {
        let sightings = [0, 1].map(|k| {
            let pixel = asked.pixels[k];
            (k, [pixel.u, pixel.v].map(nalgebra::convert))
        });
        if let Ok(found) = source.point(&sightings) {
            let [point, sigma] = [found.point_mm, found.sigma_mm.unwrap()]
                .map(|three| Vector3::from(three.map(Into::into)));
            points.push((point, sigma, asked.point_in_datum));
        }
    }
    assert!(points.len() > MATCHES / 2);
    let (from, to): (Vec<Vector3<f64>>, Vec<_>) = points.iter().map(|p| (p.0, p.2)).unzip();
    let placement = best_placement(&from, &to).unwrap();
    let within = points.iter().map(|(point, sigma, truth)| {
        let error = placement.point(point) - truth;
        (0..3).filter(|k| error[*k].abs() < 2.0 * sigma[*k]).count()
    });
    within.sum::<usize>() as f64 / (3 * points.len()) as f64
}

fn as_csv(matches: &[TrueMatch]) -> String {
    let mut text = "id,u_left,v_left,u_right,v_right\n".to_owned();
    for (id, asked) in matches.iter().enumerate() {
        let [l, r] = [0, 1].map(|k| asked.pixels[k]);
        let _ = writeln!(text, "{id},{},{},{},{}", l.u, l.v, r.u, r.v);
    }
    text
}

#[test]
fn sigmas_of_noisy_matches_cover_and_the_gaps_say_how_noisy_they_are() {
    let found = standard(OpticsKind::Brown, 1);
    let mut estimate = found.estimate.clone();
    let mut rig = estimate.rig(&["left".to_string(), "right".to_string()]);
    estimate.fill_uncertainty(&mut rig).unwrap();
    let scene = Scene::new(SceneSettings {
        match_noise_px: NOISE_PX,
        ..found.scene.settings.clone()
    })
    .unwrap();
    let matches = scene.matches(MatchSet::Points, MATCHES);

    let unsaid = within_two_sigma(&RigSource::new(&rig, None).unwrap(), &matches);
    // Of the corners' noise, a fifth, two standard deviations are 0.4: 31 %.
    assert!((0.25..0.4).contains(&unsaid), "{unsaid}");
    let csv = as_csv(&matches);
    let file = Path::new("m.csv");
    let source = RigSource::new(&rig, None).unwrap();
    let noise = noise_with_calibration(&source, file, &mut csv.as_bytes());
    let noise = noise.unwrap().unwrap();
    assert!(
        (noise.low_px..=noise.high_px).contains(&NOISE_PX),
        "{noise:?}"
    );
    // 1.166 / sqrt(1500) = 3 %, a standard deviation.
    assert!((noise.px / NOISE_PX - 1.0).abs() < 0.09, "{noise:?}");

    rig.match_noise_px = Some(NOISE_PX);
    let bytes = pack(&rig, &PackSettings::default()).unwrap().bytes;
    let bytes = AlignedBytes::from(bytes.as_slice());
    let blob = RayBlob::open(&bytes).unwrap();
    let px = blob.match_noise().map(MatchNoise::px);
    assert_eq!(px, Some(NOISE_PX as f32));
    let of_blob = noise_with_blob(
        &BlobSource::new(&blob, None).unwrap(),
        file,
        &mut csv.as_bytes(),
    );
    let of_blob = of_blob.unwrap().unwrap();
    // The blob's own noise is no part of what it is compared with. Its share of the calibration is coarser.
    assert!((of_blob.px / noise.px - 1.0).abs() < 0.01, "{of_blob:?}");

    let of_rig = within_two_sigma(&RigSource::new(&rig, None).unwrap(), &matches);
    let of_blob = within_two_sigma(&BlobSource::new(&blob, None).unwrap(), &matches);
    // 95.4 %; 4500 errors, of which those of a point go together in part: 0.5 %, a standard deviation.
    for share in [of_rig, of_blob] {
        assert!((share - 0.954).abs() < 0.015, "{share}");
    }
}

/// A folder with a calibration, its blobs with and without the noise of matches, and 300 matches of it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let calibration = with_uncertainty();
    fs::write(path.join("c.json"), calibration.to_json().unwrap()).unwrap();
    let pack = |name: &str, more: &[&str]| {
        run(path, &[&["pack", "c.json", "-o", name], more].concat()).assert_code(0);
    };
    pack("plain.rays", &[]);
    pack("noisy.rays", &["--match-noise-px", "0.2"]);
    pack("bare.rays", &["--no-uncertainty"]);
    let mut text = "id,u_left,v_left,u_right,v_right\n".to_owned();
    for k in 0..300_u32 {
        let [x, y, z] = [k % 20, k / 20, k % 7].map(f64::from);
        let point = Vector3::new(4.0 * x - 40.0, 4.0 * y - 30.0, 3.0 * z);
        let [l, r] = [0, 1].map(|camera| project(&calibration.rig, camera, &point));
        // Rows apart by -0.2 to 0.2 px.
        let off = f64::from(k * 7 % 41) / 100.0 - 0.2;
        let _ = writeln!(text, "{k},{},{},{},{}", l.u, l.v, r.u, r.v + off);
    }
    fs::write(path.join("m.csv"), text).unwrap();
    folder
}

fn measured(path: &Path, rig: &[&str], noise: &[&str]) -> String {
    let arguments = [&["measure"], rig, &["m.csv", "-o", "p.csv"], noise].concat();
    run(path, &arguments).assert_code(0);
    fs::read_to_string(path.join("p.csv")).unwrap()
}

#[test]
fn a_device_and_the_host_take_the_noise_from_the_blob_or_the_request() {
    let folder = folder();
    let path = folder.path();
    let any_port = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let device = SimulatedDevice::start(any_port, &[]).unwrap();
    let address = format!("tcp:{}", device.address());
    let given = &["--match-noise-px", "0.2"][..];
    let more = &["--match-noise-px", "0.3"][..];
    let mut answers = Vec::new();
    for blob in ["plain.rays", "noisy.rays"] {
        run(path, &["flash", blob, "--device", &address]).assert_code(0);
        for noise in [&[][..], given, more] {
            let here = measured(path, &[blob], noise);
            let there = measured(path, &["--device", &address], noise);
            assert_eq!(here, there, "{blob} {noise:?}");
            answers.push(here);
        }
    }
    let [
        plain,
        plain_given,
        plain_more,
        noisy,
        noisy_given,
        noisy_more,
    ] = &answers[..]
    else {
        panic!("{}", answers.len());
    };
    // As the blob says or the request: the same bits; what the request says counts.
    assert!(plain_given == noisy && noisy == noisy_given && plain_more == noisy_more);
    assert!(plain != noisy && noisy != noisy_more);
    // The device judges its gaps by the noise that it was told of: rows that are 0.2 px off at most.
    run(path, &["device", "status", "--device", &address])
        .assert_code(0)
        .assert_prints(&["still fits"]);
}

#[test]
fn a_calibration_a_blob_and_inspect_say_the_noise() {
    let folder = folder();
    let path = folder.path();
    let json = |arguments: &[&str]| run(path, arguments).assert_code(0).json();
    let noise = |blob: &str| json(&["inspect", blob, "--json"])["match_noise_px"].clone();
    assert!((noise("noisy.rays").as_f64().unwrap() - 0.2).abs() < 1e-6);
    assert!(noise("plain.rays").is_null());
    run(path, &["inspect", "noisy.rays"])
        .assert_code(0)
        .assert_prints(&["off by 0.2"]);
    let object = json(&["measure", "noisy.rays", "m.csv", "-o", "p.csv", "--json"]);
    assert!((object["match_noise_px"].as_f64().unwrap() - 0.2).abs() < 1e-6);
    assert!(object["estimated_match_noise"].is_null());

    // One that calibrate wrote so.
    let mut noisy = with_uncertainty();
    noisy.rig.match_noise_px = Some(0.2);
    fs::write(path.join("noisy.json"), noisy.to_json().unwrap()).unwrap();
    let object = json(&["measure", "noisy.json", "m.csv", "-o", "p.csv", "--json"]);
    assert_eq!(object["match_noise_px"], 0.2);
    let given = &["--match-noise-px", "0.2"];
    let [stated, asked] = [
        measured(path, &["noisy.json"], &[]),
        measured(path, &["c.json"], given),
    ];
    assert_eq!(stated, asked);
    let pack = ["pack", "noisy.json", "-o", "again.rays", "--json"];
    assert_eq!(json(&pack)["match_noise_px"], 0.2);
    assert_eq!(noise("again.rays"), noise("noisy.rays"));
}

#[test]
fn gaps_are_asked_on_request_and_refuse_what_they_do_not_say() {
    let folder = folder();
    let path = folder.path();
    let estimate = ["--estimate-match-noise", "-o", "p.csv"];
    let with =
        |rig: &str, matches: &str| run(path, &[&["measure", rig, matches], &estimate[..]].concat());
    for rig in ["plain.rays", "noisy.rays", "c.json"] {
        // Half of the rows are apart by less than 0.1 px, the sum of two coordinates: 0.1 / 0.6745 / sqrt(2).
        let found = with(rig, "m.csv");
        found.assert_code(0).assert_prints(&[
            "with 95 % confidence",
            "300 gaps",
            "within it taken to be as much",
        ]);
        assert!(found.stdout.contains("off by 0.1"), "{}", found.stdout);
    }
    fs::write(
        path.join("l.csv"),
        "id_a,id_b,length_mm,limit_mm\n0,19,76,5\n",
    )
    .unwrap();
    let lengths = ["measure", "c.json", "m.csv", "--json", "--lengths", "l.csv"];
    let arguments = [&lengths[..], &estimate].concat();
    let object = run(path, &arguments).assert_code(0).json();
    assert_documented(
        "measure",
        "calib-offline/measure/1",
        std::slice::from_ref(&object),
        &[],
    );
    let noise = &object["estimated_match_noise"];
    assert_eq!(noise["px"], object["match_noise_px"]);
    assert_eq!(noise["gaps"], 300);
    let estimated = fs::read(path.join("p.csv")).unwrap();
    let px = object["match_noise_px"].as_f64().unwrap().to_string();
    let said = measured(path, &["c.json"], &["--match-noise-px", &px]);
    assert!(estimated == said.as_bytes());

    fs::remove_file(path.join("p.csv")).unwrap();
    let text = fs::read_to_string(path.join("m.csv")).unwrap();
    let few: Vec<&str> = text.lines().take(100).collect();
    fs::write(path.join("few.csv"), few.join("\n")).unwrap();
    with("plain.rays", "few.csv").assert_code(3).assert_says(&[
        "99 gaps",
        "it takes 100",
        "--match-noise-px",
    ]);
    with("bare.rays", "m.csv")
        .assert_code(2)
        .assert_says(&["nothing of the uncertainty", "--no-uncertainty"]);
    for bad in ["-1", "nan", "1001", "1e-9", "x"] {
        let noise = format!("--match-noise-px={bad}");
        for command in [
            &["measure", "plain.rays", "m.csv", "-o", "p.csv"][..],
            &["pack", "c.json", "-o", "p.csv"],
        ] {
            run(path, &[command, &[&noise]].concat())
                .assert_code(2)
                .assert_says(&["--match-noise-px"]);
        }
    }
    assert!(!path.join("p.csv").exists());
}

/// Fields of a row, which are numbers but for the status.
fn numbers(row: &str) -> Vec<f64> {
    row.split(',')
        .filter_map(|field| field.parse().ok())
        .collect()
}

#[test]
fn the_readmes_third_command_prints_sigmas_that_cover() {
    let folder = tempfile::tempdir().unwrap();
    let stage = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/stage");
    let dataset = stage.to_str().unwrap();
    run(folder.path(), &["calibrate", dataset, "-o", "out"]).assert_code(0);
    let (mut within, mut count) = (0_usize, 0_usize);
    for name in ["holdout", "matches"] {
        let matches = stage.join(format!("{name}.csv"));
        let measure = ["measure", "out/rig.rays", matches.to_str().unwrap()];
        run(
            folder.path(),
            &[&measure[..], &["-o", "points.csv"]].concat(),
        )
        .assert_code(0);
        let points = fs::read_to_string(folder.path().join("points.csv")).unwrap();
        let truth = fs::read_to_string(stage.join(format!("{name}_truth.csv"))).unwrap();
        for (point, truth) in points.lines().zip(truth.lines()).skip(1) {
            let (point, truth) = (numbers(point), numbers(truth));
            for axis in 1..4 {
                // id, x, y, z, gap, sigmas; id, x, y, z.
                let error = (point[axis] - truth[axis]).abs();
                within += usize::from(error < 2.0 * point[axis + 4]);
                count += 1;
            }
        }
    }
    // 95.4 %; of 1800 errors, of which those of a point go together, 0.8 %, and the calibration's own share.
    let share = within as f64 / count as f64;
    assert!(count == 1800 && (share - 0.954).abs() < 0.025, "{share}");
}
