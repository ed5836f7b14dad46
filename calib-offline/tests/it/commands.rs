//! The verbs, driven as a user drives them: the real binary in a temporary folder.

#![allow(clippy::format_push_string, reason = "shorter than write! in a test")]

use crate::common::{
    MANIFEST, Run, calibration, contents, corners_csv, dataset, project, rig, run, run_with_input,
};
use calib_offline::report::Calibration;
use nalgebra::Vector3;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

const POINTS_HEADER: &str = "id,x,y,z,gap,sigma_x,sigma_y,sigma_z,status";

/// A folder with `calibration.json`, the blob `rig.rays` packed from it and `matches.csv`.
fn measuring() -> (tempfile::TempDir, Vec<Vector3<f64>>) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("calibration.json"),
        calibration().to_json().unwrap(),
    )
    .unwrap();
    run(
        folder.path(),
        &[
            "pack",
            "calibration.json",
            "-o",
            "rig.rays",
            "--max-error-px",
            "0.002",
        ],
    )
    .assert_code(0);
    let points: Vec<Vector3<f64>> = (0..40)
        .map(|k| {
            let k = f64::from(k);
            Vector3::new(
                60.0 * (0.7 * k).sin(),
                50.0 * (1.1 * k).cos(),
                2.0 * k - 40.0,
            )
        })
        .collect();
    let rig = rig();
    let mut text = String::from("id,u_left,v_left,u_right,v_right\n");
    for (k, point) in points.iter().enumerate() {
        let (l, r) = (project(&rig, 0, point), project(&rig, 1, point));
        text += &format!("p{k},{},{},{},{}\n", l.u, l.v, r.u, r.v);
    }
    // Not calibrated; parallel to within round-off of nothing; crossed: behind the cameras.
    text += "\"out, side\",5,5,300,200\n";
    text += "crossed,100,240,540,240\n";
    fs::write(folder.path().join("matches.csv"), text).unwrap();
    (folder, points)
}

fn rows(folder: &Path, file: &str) -> Vec<String> {
    let text = fs::read_to_string(folder.join(file)).unwrap();
    let mut lines = text.lines().map(str::to_owned);
    assert_eq!(lines.next().as_deref(), Some(POINTS_HEADER));
    lines.collect()
}

fn numbers(row: &str) -> [f64; 4] {
    let fields: Vec<&str> = row.split(',').collect();
    [1, 2, 3, 4].map(|k| fields[k].parse().unwrap())
}

#[test]
fn every_help_starts_with_an_example() {
    let folder = tempfile::tempdir().unwrap();
    let top = run(folder.path(), &["--help"]);
    top.assert_code(0);
    for part in ["  0  done", "  1  done, but", "  2  usage", "  3  the data"] {
        assert!(top.stdout.contains(part), "{part}");
    }
    for verb in [
        "calibrate",
        "compare",
        "demo",
        "detect",
        "inspect",
        "measure",
        "methods",
        "pack",
        "rays",
        "simulate",
        "verify",
    ] {
        for arguments in [[verb, "--help"], ["help", verb], [verb, "-h"]] {
            let help = run(folder.path(), &arguments);
            help.assert_code(0);
            assert!(
                help.stdout.starts_with("Example:\n  calib-offline "),
                "{arguments:?}:\n{}",
                help.stdout
            );
        }
    }
}

#[test]
fn wrong_arguments_are_exit_code_2() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        &["calibrte"][..],
        &[],
        &["calibrate", "set"],
        &["calibrate", "set", "-o", "out", "--exclude", "three"],
        &["measure", "a", "b", "-o", "c", "--frme", "left"],
        &["methods", "set", "--folds", "1"],
        &["methods", "set", "--folds", "-3"],
        &["methods"],
        &["inspect", "x", "-q", "-v"],
    ] {
        run(folder.path(), arguments).assert_code(2);
    }
    let run = run(folder.path(), &["calibrate", "--json"]);
    run.assert_code(2);
    assert_eq!(run.json()["exit_code"], 2);
}

#[test]
fn measure_gives_one_row_per_match_in_order() {
    let (folder, points) = measuring();
    // Single precision at half a meter, and 0.002 px of the blob: some micrometers.
    for (file, tolerance_mm) in [("calibration.json", 1e-9), ("rig.rays", 0.02)] {
        run(
            folder.path(),
            &["measure", file, "matches.csv", "-o", "points.csv"],
        )
        .assert_code(0);
        let rows = rows(folder.path(), "points.csv");
        assert_eq!(rows.len(), 42);
        for (k, point) in points.iter().enumerate() {
            assert!(rows[k].starts_with(&format!("p{k},")), "{}", rows[k]);
            assert!(rows[k].ends_with(",,,,ok"), "{}", rows[k]);
            let [x, y, z, gap] = numbers(&rows[k]);
            let error = (Vector3::new(x, y, z) - point).norm();
            assert!(
                error < tolerance_mm && gap < tolerance_mm,
                "{file}: {error} {}",
                rows[k]
            );
        }
        assert_eq!(rows[40], "\"out, side\",,,,,,,,outside");
        assert_eq!(rows[41], "crossed,,,,,,,,behind");
    }
}

#[test]
fn flags_may_stand_before_between_and_behind_the_files() {
    let (folder, _) = measuring();
    let path = folder.path();
    let (flags, files) = (["-o", "p.csv", "--force"], ["rig.rays", "matches.csv"]);
    let mut all = Vec::new();
    for between in 0..=files.len() {
        let (before, after) = files.split_at(between);
        let arguments = [&["measure"][..], before, &flags, after].concat();
        run(path, &arguments).assert_code(0);
        all.push(fs::read(path.join("p.csv")).unwrap());
    }
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
    let compare = ["calibration.json", "--quiet", "calibration.json"];
    run(path, &[&["compare"][..], &compare].concat()).assert_code(0);
    // These get as far as to look into the files.
    run(
        path,
        &["verify", "calibration.json", "--exclude", "1", "nowhere"],
    )
    .assert_code(2)
    .assert_says(&["nowhere"]);
    let device = ["--device", "tcp:127.0.0.1:1"];
    for arguments in [
        ["matches.csv", device[0], device[1]],
        [device[0], device[1], "matches.csv"],
    ] {
        run(
            path,
            &[&["measure", "-o", "p.csv"][..], &arguments].concat(),
        )
        .assert_code(2)
        .assert_says(&[device[1]]);
    }

    run(path, &["measure", "matches.csv", "-o", "p.csv"])
        .assert_code(2)
        .assert_says(&[
            "not provided",
            "MATCHES.csv",
            "--device <ADDRESS> <MATCHES.csv>",
        ]);
    let both = [&["measure", "-o", "p.csv"][..], &files, &device].concat();
    run(path, &both)
        .assert_code(2)
        .assert_says(&["cannot be used with"]);
}

#[test]
fn measure_prints_one_object_and_writes_the_same_bytes_again() {
    let (folder, _) = measuring();
    let arguments = [
        "measure",
        "rig.rays",
        "matches.csv",
        "-o",
        "points.csv",
        "--json",
    ];
    let first = run(folder.path(), &arguments);
    let object = first.assert_code(0).json();
    assert_eq!(object["schema"], "calib-offline/measure/1");
    assert_eq!(object["rig_kind"], "blob");
    for (key, count) in [
        ("matches", 42),
        ("ok", 40),
        ("outside", 1),
        ("parallel", 0),
        ("behind", 1),
    ] {
        assert_eq!(object[key], count, "{key}");
    }
    let bytes = fs::read(folder.path().join("points.csv")).unwrap();
    let one_thread = [&arguments[..], &["--threads", "1"]].concat();
    run(folder.path(), &one_thread).assert_code(0);
    assert_eq!(fs::read(folder.path().join("points.csv")).unwrap(), bytes);
}

#[test]
fn measure_in_the_frame_of_a_camera() {
    let (folder, points) = measuring();
    let camera_from_rig = rig().cameras[1].rig_from_camera.inverse();
    for (file, tolerance_mm) in [("calibration.json", 1e-9), ("rig.rays", 0.02)] {
        let arguments = [
            "measure",
            file,
            "matches.csv",
            "-o",
            "p.csv",
            "--frame",
            "right",
        ];
        run(folder.path(), &arguments).assert_code(0);
        let [x, y, z, _] = numbers(&rows(folder.path(), "p.csv")[7]);
        let expected = camera_from_rig.point(&points[7]);
        assert!((Vector3::new(x, y, z) - expected).norm() < tolerance_mm);
        let arguments = [
            "measure",
            file,
            "matches.csv",
            "-o",
            "q.csv",
            "--frame",
            "top",
        ];
        run(folder.path(), &arguments)
            .assert_code(2)
            .assert_says(&["\"top\"", "left, right"]);
    }
}

#[test]
fn measure_reads_standard_input() {
    let (folder, _) = measuring();
    let matches = fs::read(folder.path().join("matches.csv")).unwrap();
    let arguments = ["measure", "rig.rays", "-", "-o", "points.csv"];
    run_with_input(folder.path(), &arguments, Some(&matches)).assert_code(0);
    assert_eq!(rows(folder.path(), "points.csv").len(), 42);
}

#[test]
fn measure_refuses_wrong_matches_and_writes_nothing() {
    let (folder, _) = measuring();
    fs::write(
        folder.path().join("points.csv"),
        format!("{POINTS_HEADER}\nold\n"),
    )
    .unwrap();
    let good = fs::read_to_string(folder.path().join("matches.csv")).unwrap();
    let cases = [
        (good.replace("u_right", "u_rght"), "matches.csv:1:"),
        (good.replacen("p3,", "p3,,", 1), "matches.csv:5:"),
        (
            good.replacen("p3,", "p3,nan,1,2,3\np3,", 1),
            "matches.csv:5:",
        ),
        (good.clone() + "last,1,2,3\n", "matches.csv:44:"),
        (good.clone() + "last,1,2,,\n", "matches.csv:44:"),
        (String::new(), "matches.csv:1:"),
        ("\u{0}\u{0}".to_owned(), "matches.csv:1:"),
    ];
    for (text, place) in cases {
        fs::write(folder.path().join("matches.csv"), text).unwrap();
        let before = contents(folder.path());
        run(
            folder.path(),
            &["measure", "rig.rays", "matches.csv", "-o", "points.csv"],
        )
        .assert_code(2)
        .assert_says(&[place, "try: "]);
        assert_eq!(contents(folder.path()), before);
    }
}

#[test]
fn measure_refuses_places_that_are_not_its_own() {
    let (folder, _) = measuring();
    let path = folder.path();
    fs::create_dir(path.join("folder")).unwrap();
    fs::write(path.join("notes.txt"), "mine").unwrap();
    let before = contents(path);
    let measure = |place: &str| run(path, &["measure", "rig.rays", "matches.csv", "-o", place]);
    measure("folder")
        .assert_code(2)
        .assert_says(&["is a folder"]);
    measure("nowhere/p.csv")
        .assert_code(2)
        .assert_says(&["does not exist"]);
    measure("notes.txt")
        .assert_code(2)
        .assert_says(&["exists", "--force"]);
    measure("matches.csv")
        .assert_code(2)
        .assert_says(&["is what the command reads"]);
    measure("rig.rays").assert_code(2);
    assert_eq!(contents(path), before);
    let forced = [
        "measure",
        "rig.rays",
        "matches.csv",
        "-o",
        "notes.txt",
        "--force",
    ];
    run(path, &forced).assert_code(0);
    assert_eq!(rows(path, "notes.txt").len(), 42);
}

#[test]
fn damaged_rigs_are_refused_by_every_verb_that_reads_them() {
    let (folder, _) = measuring();
    let path = folder.path();
    let blob = fs::read(path.join("rig.rays")).unwrap();
    let json = fs::read(path.join("calibration.json")).unwrap();
    let mut flipped = blob.clone();
    flipped[blob.len() / 2] ^= 4;
    let cases: [(&[u8], &str); 7] = [
        (b"", "bad.rays"),
        (b"\x89PNG\r\n\x1a\n", "bad.rays"),
        (&blob[..blob.len() - 1], "cut off"),
        (&flipped, "damaged"),
        (&json[..json.len() / 2], "bad.rays:1:"),
        (b"{}", "schema"),
        (b"{\"schema\": \"something/else\"}", "something/else"),
    ];
    for (bytes, words) in cases {
        fs::write(path.join("bad.rays"), bytes).unwrap();
        let before = contents(path);
        for arguments in [
            &["measure", "bad.rays", "matches.csv", "-o", "p.csv"][..],
            &["inspect", "bad.rays"],
            &["pack", "bad.rays", "-o", "q.rays"],
        ] {
            let run = run(path, arguments);
            run.assert_code(2);
            if arguments[0] != "pack" {
                run.assert_says(&[words, "try: "]);
            }
        }
        assert_eq!(contents(path), before);
    }
    run(
        path,
        &["measure", "none.rays", "matches.csv", "-o", "p.csv"],
    )
    .assert_code(2)
    .assert_says(&["none.rays: does not exist"]);
}

#[test]
fn pack_holds_the_bound_it_states() {
    let (folder, _) = measuring();
    let path = folder.path();
    let mut sizes = Vec::new();
    for bound in ["0.05", "0.0005"] {
        let arguments = [
            "pack",
            "calibration.json",
            "-o",
            "r.rays",
            "--max-error-px",
            bound,
            "--json",
        ];
        let object = run(path, &arguments).assert_code(0).json();
        assert_eq!(object["schema"], "calib-offline/pack/2");
        assert!(object["worst_error_px"].as_f64().unwrap() <= bound.parse().unwrap());
        let bytes = fs::read(path.join("r.rays")).unwrap().len();
        assert_eq!(object["bytes"], bytes);
        sizes.push(bytes);
    }
    assert!(sizes[0] < sizes[1]);
    for bound in ["0", "-1", "nan", "inf"] {
        let flag = format!("--max-error-px={bound}");
        run(path, &["pack", "calibration.json", "-o", "s.rays", &flag]).assert_code(2);
    }
    run(
        path,
        &["pack", "calibration.json", "-o", "calibration.json"],
    )
    .assert_code(2);
    assert!(!path.join("s.rays").exists());
}

#[test]
fn inspect_tells_the_three_kinds_apart() {
    let (folder, _) = measuring();
    let path = folder.path();
    let kind = |file: &str| {
        run(path, &["inspect", file, "--json"])
            .assert_code(0)
            .json()
    };
    let blob = kind("rig.rays");
    assert_eq!(blob["kind"], "blob");
    assert_eq!(blob["cameras"][1]["name"], "right");
    let identity: String = calibration()
        .identity()
        .iter()
        .fold(String::new(), |hex, byte| hex + &format!("{byte:02x}"));
    assert_eq!(blob["identity"], identity.as_str());
    let calibration = kind("calibration.json");
    assert_eq!(calibration["kind"], "calibration");
    assert!((calibration["baseline_mm"][0].as_f64().unwrap() - 120.0).abs() < 1e-9);
    for file in ["rig.rays", "calibration.json"] {
        let words = run(path, &["inspect", file]);
        assert!(words.assert_code(0).stdout.contains("right"));
    }
}

#[test]
fn inspect_describes_a_recording() {
    let folder = dataset(MANIFEST, corners_csv(6).as_bytes());
    for place in ["set", "set/dataset.toml"] {
        let object = run(folder.path(), &["inspect", place, "--json"])
            .assert_code(0)
            .json();
        assert_eq!(object["kind"], "dataset");
        assert_eq!(object["source"], "corners");
        assert_eq!(object["capture"]["poses_seen_by_all"], 6);
        assert_eq!(object["capture"]["cameras"][0]["corners_per_view"][1], 30);
    }
    let words = run(folder.path(), &["inspect", "set"]);
    assert!(words.stdout.contains("6 poses are few"), "{}", words.stdout);
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let (folder, _) = measuring();
    let mut child = Command::new(env!("CARGO_BIN_EXE_calib-offline"))
        .args(["inspect", "calibration.json"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn quiet_says_nothing_and_logs_have_no_colors() {
    let (folder, _) = measuring();
    let pack = ["pack", "calibration.json", "-o", "r.rays"];
    let said = |run: &Run| run.stderr.clone();
    assert!(said(&run(folder.path(), &pack)).contains("packing the blob"));
    let quiet = run(folder.path(), &[&pack[..], &["-q"]].concat());
    assert_eq!(said(quiet.assert_code(0)), "");
    let error = ["inspect", "nowhere"];
    assert!(!said(&run(folder.path(), &error)).contains('\u{1b}'));
    let colored = run(
        folder.path(),
        &[&error[..], &["--color", "always"]].concat(),
    );
    assert!(said(&colored).contains("\u{1b}[1;31merror:"));
}

#[test]
fn what_pack_reads_is_what_calibrate_writes() {
    let (folder, _) = measuring();
    let loaded = Calibration::load(&folder.path().join("calibration.json")).unwrap();
    assert_eq!(loaded, calibration());
}
