//! `calibration.json` as others read it: its schema, the readers in its document, and files of the version before.

use crate::common::json_schema::contradictions;
use crate::common::{MANIFEST, calibration, corners_csv, dataset, run};
use calib_offline::report::Calibration;
use calib_offline::report::schema::calibration_schema;
use calib_rays::field::spline::Spline;
use calib_rays::field::spline::SplineGrid;
use calib_rays::field::{Projection, SmoothMap};
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector2;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(file: &Path) -> Value {
    serde_json::from_slice(&fs::read(file).unwrap()).unwrap()
}

#[test]
fn the_schema_is_that_of_the_types() {
    let file = package().join("calibration.schema.json");
    let text = serde_json::to_string_pretty(&calibration_schema()).unwrap() + "\n";
    if std::env::var_os("ACCEPT").is_some_and(|value| value == "1") {
        fs::write(&file, &text).unwrap();
    }
    let committed = fs::read_to_string(&file).unwrap_or_default();
    assert!(
        committed == text,
        "calibration.schema.json is not what the types say; ACCEPT=1 writes it"
    );
}

/// A recording with all that a manifest may say for the record, calibrated.
fn calibrated(arguments: &[&str]) -> (tempfile::TempDir, PathBuf) {
    let declared = MANIFEST.replace(
        "name = \"left\"\n",
        "name = \"left\"\nserial = \"SN-0012\"\noptics = \"plain\"\n",
    ) + "\n[board.certificate]\nscale_ppm_sd = 20.0\nexpansion_ppm_per_k = 9.0\nexpansion_ppm_per_k_sd = 1.0\n\
         calibrated_at_c = 20.0\nused_at_c = 23.0\nused_at_c_sd = 0.5\n\
         [recording]\nname = \"line 3\"\nby = \"A. Person\"\ndate = \"2026-11-30\"\n\
         [stage]\nplacement = [0, 0, 0, 0, 0, 0]\nangles_deg = [0, 15, 30, 45, 60, 75]\n";
    let home = dataset(&declared, corners_csv(6).as_bytes());
    let calibrate = ["calibrate", "set", "-o", "out"];
    let run = run(home.path(), &[&calibrate[..], arguments].concat());
    assert!(run.code <= 1, "{}", run.stderr);
    let file = home.path().join("out/calibration.json");
    (home, file)
}

#[test]
fn what_is_written_is_what_the_schema_says_and_names_who_and_what() {
    let schema = calibration_schema();
    let task = ["--task", "length 20 mm at 500 mm", "--exclude", "5"];
    let (_home, file) = calibrated(&task);
    let written = read(&file);
    assert_eq!(contradictions(&schema, &written), [""; 0]);
    assert_eq!(
        written["command"],
        "calib-offline calibrate set --exclude 5 --task 'length 20 mm at 500 mm'"
    );
    assert_eq!(
        written["recording"],
        json!({"name": "line 3", "by": "A. Person", "date": "2026-11-30"})
    );
    assert_eq!(
        written["cameras"],
        json!([{"name": "left", "serial": "SN-0012", "optics": "plain"}, {"name": "right"}])
    );
    assert_eq!(written["certificate"]["used_at_c"], 23.0);
    let pose = &written["rig"]["cameras"][1]["rig_from_camera"];
    assert_eq!(pose["rotation"].as_array().map(Vec::len), Some(3));

    // The schema refuses what it should.
    let refused = |change: fn(&mut Value)| {
        let mut other = written.clone();
        change(&mut other);
        !contradictions(&schema, &other).is_empty()
    };
    assert!(refused(
        |v| v["schema"] = "calib-offline/calibration/1".into()
    ));
    assert!(refused(
        |v| v["rig"]["cameras"][0]["rig_from_camera"]["rotation"] =
            json!([1, 0, 0, 0, 1, 0, 0, 0, 1])
    ));
    assert!(refused(|v| v["verdict"]["grade"] = "good".into()));
    assert!(refused(|v| v["poses"][0]["pose"] = json!(-1)));
    assert!(refused(|v| drop(v.as_object_mut().unwrap().remove("rig"))));
}

#[test]
fn what_the_published_procedure_writes_is_too() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path();
    let simulate = [
        "simulate",
        "-o",
        "set",
        "--rows",
        "7",
        "--cols",
        "6",
        "--square-mm",
        "22",
        "--angles=-30:15:30",
    ];
    run(path, &simulate).assert_code(0);
    let calibrate = ["calibrate", "set", "-o", "out", "--method", "alternating"];
    assert!(run(path, &calibrate).code <= 1);
    let written = read(&path.join("out/calibration.json"));
    assert!(written["alternating"]["circles"][0]["circles"]["direction"].is_array());
    assert_eq!(contradictions(&calibration_schema(), &written), [""; 0]);
}

#[test]
fn the_same_recording_gives_the_same_file_wherever_it_lies() {
    let (one, other) = (calibrated(&["--threads", "1"]), calibrated(&["--json"]));
    assert!(fs::read(one.1).unwrap() == fs::read(other.1).unwrap());
}

/// The programs in the document, in order.
fn readers() -> Vec<String> {
    let text = fs::read_to_string(package().join("CALIBRATION.md")).unwrap();
    let blocks = text.split("```python\n").skip(1);
    blocks
        .map(|block| block.split("```").next().unwrap().to_owned())
        .collect()
}

fn python(program: &str, arguments: &[&str]) -> Value {
    let output = Command::new("python3")
        .args(["-B", "-c", program])
        .args(arguments)
        .output()
        .expect("python3 is missing: install Python 3, which checks that CALIBRATION.md is right");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A smooth map that uses all that one may have.
fn wavy(calibration: &Calibration, size: f64) -> SmoothMap {
    let sensor = calibration.rig.cameras[0].field.sensor;
    let number = |k: usize| size * Vector2::new((1.3 * k as f64).sin(), (2.1 * k as f64).cos());
    let mut map = SmoothMap::zero(5);
    let mut spline = Spline::zero(SplineGrid {
        sensor,
        cells_u: 4,
        cells_v: 3,
    });
    for (k, c) in map.polynomial.coefficients.iter_mut().enumerate() {
        *c = number(k);
    }
    for (k, c) in spline.coefficients.iter_mut().enumerate() {
        *c = number(k + 7);
    }
    map.spline = Some(spline);
    map
}

#[test]
fn the_readers_in_the_document_find_cameras_and_rays() {
    let mut written = calibration();
    let (direction, offset) = (wavy(&written, 0.003), wavy(&written, 0.4));
    let field = &mut written.rig.cameras[0].field;
    field.direction = direction;
    field.offset = Some(offset);
    field.base.center_px = [7.0, -4.0];
    field.base.radial = [-0.1, 0.03, 0.002, -0.001];
    field.base.reach = 0.4;
    written.rig.cameras[1].field.base.projection = Projection::Equidistant;
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("calibration.json");
    fs::write(&file, written.to_json().unwrap()).unwrap();
    let file = file.to_str().unwrap();

    let [place, ray] = &readers()[..] else {
        panic!("two readers in CALIBRATION.md")
    };
    assert_eq!(place.lines().filter(|line| !line.is_empty()).count(), 9);
    let found = python(place, &[file]);
    for camera in &written.rig.cameras {
        let expected = camera.rig_from_camera;
        for row in 0..3 {
            for col in 0..3 {
                assert_eq!(found[&camera.name][row][col], expected.rotation[(row, col)]);
            }
            assert_eq!(found[&camera.name][row][3], expected.translation_mm[row]);
        }
        assert_eq!(found[&camera.name][3], json!([0, 0, 0, 1]));
    }

    for (camera_idx, u, v) in [
        (0, 320.0, 240.0),
        (0, 120.5, 99.25),
        (0, 551.0, 400.0),
        (1, 130.0, 377.0),
    ] {
        let found = python(
            ray,
            &[
                file,
                &camera_idx.to_string(),
                &u.to_string(),
                &v.to_string(),
            ],
        );
        let camera = &written.rig.cameras[camera_idx];
        let expected = camera.ray_in_rig(PixelPoint::new(u, v)).unwrap();
        let direction = expected.direction.normalize();
        let expected = expected.origin_mm.iter().chain(direction.iter());
        for (found, expected) in found.as_array().unwrap().iter().zip(expected) {
            // Round-off of some hundred sums of numbers up to 1000.
            assert!(
                (found.as_f64().unwrap() - expected).abs() < 1e-11,
                "{u} {v}: {found} {expected}"
            );
        }
    }
    assert_eq!(python(ray, &[file, "0", "3", "3"]), Value::Null);
}

/// What the program that wrote the file measured with it.
const MATCHES: &str = "\
id,u_left,v_left,u_right,v_right
0,213.10692621706102,582.3201958038231,173.20933882369022,548.2790904721
1,857.9709471568763,352.731154906548,839.0728008593771,291.5390891072151
";
const POINTS: [[f64; 7]; 2] = [
    [
        -24.016135361496488,
        118.12092213949677,
        47.86438207943539,
        0.00692213514438816,
        0.011114702219603423,
        0.007122361055079702,
        0.022919036023096747,
    ],
    [
        85.52723406528284,
        59.728575861122295,
        -0.008426800533058554,
        0.008397928096419358,
        0.0160957129771907,
        0.007893180444951456,
        0.021840695926696747,
    ],
];

#[test]
fn a_file_of_the_version_before_serves_every_command() {
    let old = package().join("../data/golden/calibration-v1.json");
    let columns = read(&old)["rig"]["cameras"][1]["rig_from_camera"]["rotation"].clone();
    let loaded = Calibration::load(&old).unwrap();
    let rotation = loaded.rig.cameras[1].rig_from_camera.rotation;
    // Column by column, as nalgebra has them.
    assert!(
        rotation.iter().eq(columns
            .as_array()
            .unwrap()
            .iter()
            .map(|x| x.as_f64().unwrap())
            .collect::<Vec<_>>()
            .iter())
    );
    let home = tempfile::tempdir().unwrap();
    let path = home.path();
    fs::copy(&old, path.join("old.json")).unwrap();
    let newer = loaded.to_json().unwrap();
    fs::write(path.join("new.json"), &newer).unwrap();
    assert_eq!(
        contradictions(&calibration_schema(), &read(&path.join("new.json"))),
        [""; 0]
    );

    fs::write(path.join("matches.csv"), MATCHES).unwrap();
    for file in ["old.json", "new.json"] {
        let points = format!("{file}.csv");
        run(path, &["measure", file, "matches.csv", "-o", &points]).assert_code(0);
        let points = fs::read_to_string(path.join(points)).unwrap();
        for (line, expected) in points.lines().skip(1).zip(&POINTS) {
            let found = line.split(',').skip(1);
            for (found, expected) in found.zip(expected) {
                // Sums in another order, on another machine.
                assert!(
                    (found.parse::<f64>().unwrap() - expected).abs() < 1e-9,
                    "{line}"
                );
            }
        }
        let blob = format!("{file}.rays");
        run(path, &["pack", file, "-o", &blob]).assert_code(0);
        let c = format!("{file}.c");
        run(path, &["export", &blob, "--format", "c", "-o", &c]).assert_code(0);
    }
    let same = |ending: &str| {
        let [a, b] = ["old.json", "new.json"]
            .map(|file| fs::read(path.join(format!("{file}{ending}"))).unwrap());
        a == b
    };
    assert!(same(".csv") && same(".rays"));
    run(path, &["inspect", "old.json"])
        .assert_code(0)
        .assert_prints(&["method joint"]);
    run(path, &["compare", "old.json", "new.json"]).assert_code(0);
    let again = [
        "simulate", "-o", "set", "--optics", "port", "--seed", "3", "--rows", "5", "--cols", "4",
    ];
    let again = [&again[..], &["--square-mm", "30", "--angles=-20:20:20"]].concat();
    run(path, &again).assert_code(0);
    run(path, &["verify", "old.json", "set"])
        .assert_code(0)
        .assert_prints(&["verdict: pass"]);
}

/// The stated places of cameras compare with those of other tools: lens axes, not the gauge of a ray field.
#[test]
fn the_nearest_pinholes_are_the_lenses_that_were_simulated() {
    let home = tempfile::tempdir().unwrap();
    let simulate = "simulate -o set --optics brown --seed 3 --noise-px 0.05 --points 1 --holdout 1";
    let words: Vec<&str> = simulate.split(' ').collect();
    run(home.path(), &words).assert_code(0);
    let calibrate = ["calibrate", "set", "-o", "out", "--json", "-q"];
    let found = run(home.path(), &calibrate).assert_code(0).json();
    let truth = read(&home.path().join("set/truth.json"));
    let number = |value: &Value| value.as_f64().unwrap();
    for (found, truth) in [0, 1].map(|k| (&found["cameras"][k], &truth["cameras"][k])) {
        let lens = &truth["optics"]["lens"];
        // 5481 corners of 0.05 px a camera on boards turned by up to 39 degrees leave less than 0.1 px of the
        // principal point open, and 1 in 10,000 of the focal length; three times that.
        for (axis, name) in ["u", "v"].into_iter().enumerate() {
            let center = number(&found["principal_point_px"][axis]);
            assert!((center - number(&lens["principal"][name])).abs() < 0.3);
            let focal = number(&lens["focal_px"][axis]);
            let share = number(&found["focal_px"][axis]) / focal - 1.0;
            assert!(share.abs() < 3e-4, "{share}");
        }
        assert!(number(&found["pinhole_rms_px"]) < 0.01);
    }
    // Two axes are each off by 0.1 px of 2042.
    let second = &truth["cameras"][1]["left_from_camera"];
    let entry = |k: usize| number(&second["rotation"][k]);
    let angle = ((entry(0) + entry(4) + entry(8) - 1.0) / 2.0)
        .acos()
        .to_degrees();
    let axes = number(&found["axes_angle_deg"][0]);
    assert!((axes - angle).abs() < 0.01, "{axes} and {angle}");
    let place = [0, 1, 2].map(|k| number(&second["translation_mm"][k]));
    let length_mm = place.map(|x| x * x).iter().sum::<f64>().sqrt();
    let baseline_mm = number(&found["baseline_mm"][0]);
    assert!(
        (baseline_mm - length_mm).abs() < 3e-4 * length_mm,
        "{baseline_mm} and {length_mm}"
    );
}
