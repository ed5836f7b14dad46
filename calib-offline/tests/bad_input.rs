//! Bad datasets, given to the real binary: each is refused with the right exit code and a message
//! that names the place and the remedy, and nothing is left half-written.

#![allow(clippy::format_push_string, reason = "shorter than write! in a test")]

mod common;

use common::{MANIFEST, contents, corners_csv, dataset, run};

/// `calibrate` and `inspect` of a dataset. `inspect` must refuse what is broken (code 2) and
/// describe what is merely not enough (code 3).
#[track_caller]
fn refused(manifest: &str, corners: &[u8], code: i32, parts: &[&str]) {
    let folder = dataset(manifest, corners);
    let before = contents(folder.path());
    run(folder.path(), &["calibrate", "set", "-o", "out"])
        .assert_code(code)
        .assert_says(parts)
        .assert_says(&["error:", "try: "]);
    let json = run(folder.path(), &["calibrate", "set", "-o", "out", "--json"]);
    json.assert_code(code);
    let object = json.json();
    assert_eq!(object["schema"], "calib-offline/error/1");
    assert_eq!(object["exit_code"], code);
    assert!(object["remedy"].is_string());
    let inspected = run(folder.path(), &["inspect", "set"]);
    if code == 2 {
        inspected.assert_code(2).assert_says(parts);
    } else {
        inspected.assert_code(0);
        assert!(inspected.stdout.contains("cannot be calibrated"));
    }
    assert_eq!(contents(folder.path()), before, "something was written");
}

#[track_caller]
fn refused_manifest(from: &str, to: &str, parts: &[&str]) {
    assert!(MANIFEST.contains(from));
    let manifest = MANIFEST.replacen(from, to, 1);
    refused(&manifest, corners_csv(6).as_bytes(), 2, parts);
}

#[track_caller]
fn refused_corners(change: impl Fn(&mut Vec<String>), parts: &[&str]) {
    let mut lines: Vec<String> = corners_csv(6).lines().map(str::to_owned).collect();
    change(&mut lines);
    refused(MANIFEST, lines.join("\n").as_bytes(), 2, parts);
}

#[test]
fn square_size() {
    refused_manifest(
        "square_mm = 20.0\n",
        "",
        &["dataset.toml:1:", "no default", "square_mm = 10.0"],
    );
    for (value, word) in [
        ("0", "zero"),
        ("-20.0", "negative"),
        ("nan", "not a number"),
        ("inf", "infinite"),
    ] {
        let to = format!("square_mm = {value}");
        refused_manifest("square_mm = 20.0", &to, &["dataset.toml:5:", word]);
    }
}

#[test]
fn unknown_key() {
    refused_manifest("kind", "knd", &["dataset.toml:2:", "knd"]);
}

#[test]
fn duplicate_camera() {
    refused_manifest(
        "\"right\"",
        "\"left\"",
        &["dataset.toml:13:", "line 8", "own name"],
    );
}

#[test]
fn rows_and_columns_swapped() {
    let manifest = MANIFEST
        .replace("rows = 6", "rows = 5")
        .replace("cols = 5", "cols = 6");
    refused(
        &manifest,
        corners_csv(6).as_bytes(),
        2,
        &["corners.csv:27:", "rows and columns swapped?"],
    );
}

#[test]
fn image_size_that_does_not_fit() {
    refused_manifest(
        "width = 640",
        "width = 320",
        &["corners.csv:", "320x480", "image size"],
    );
}

#[test]
fn corners_that_cannot_be() {
    refused_corners(
        |lines| lines.push(lines[7].clone()),
        &["corners.csv:362:", "line 8"],
    );
    refused_corners(
        |lines| lines[3] = lines[3].replace("left", "middle"),
        &["corners.csv:4:", "middle", "left, right"],
    );
    refused_corners(
        |lines| lines[3] = "left,0,6,0,100,100".to_owned(),
        &["corners.csv:4:", "row 6, col 0", "inner corners"],
    );
    for text in ["nan", "inf"] {
        refused_corners(
            |lines| lines[3] = format!("left,0,0,2,{text},100"),
            &["corners.csv:4:", "finite"],
        );
    }
}

#[test]
fn empty_and_binary_files() {
    refused(MANIFEST, b"", 2, &["corners.csv:1:", "no corners"]);
    refused(MANIFEST, b"\x00\x01\xff\xfe", 2, &["corners.csv:1:"]);
    refused(
        "",
        corners_csv(6).as_bytes(),
        2,
        &["dataset.toml:1:", "[board] is missing"],
    );
    refused("\u{0}\u{1}", b"", 2, &["dataset.toml:1:"]);
}

#[test]
fn one_or_two_poses_only() {
    for (count, words) in [(1, "1 usable pose,"), (2, "2 usable poses,")] {
        let corners = corners_csv(count);
        refused(MANIFEST, corners.as_bytes(), 3, &[words, "at least 3"]);
    }
}

#[test]
fn all_corners_on_a_line() {
    let mut text = String::from("camera,pose,row,col,u,v\n");
    for camera in ["left", "right"] {
        for pose in 0..6 {
            for row in 0..6 {
                for col in 0..5 {
                    let along = f64::from(30 * col + 7 * row + pose);
                    let (u, v) = (100.0 + along, 50.0 + along / 3.0);
                    text += &format!("{camera},{pose},{row},{col},{u},{v}\n");
                }
            }
        }
    }
    refused(
        MANIFEST,
        text.as_bytes(),
        3,
        &["\"left\"", "on a line", "6 views"],
    );
}

#[test]
fn no_dataset_at_all() {
    let folder = tempfile::tempdir().unwrap();
    for path in ["nowhere", "."] {
        run(folder.path(), &["calibrate", path, "-o", "out"])
            .assert_code(2)
            .assert_says(&["dataset.toml", "try: "]);
    }
    assert!(contents(folder.path()).is_empty());
}

#[test]
fn output_path_that_is_a_file() {
    let folder = dataset(MANIFEST, corners_csv(6).as_bytes());
    std::fs::write(folder.path().join("notes"), "mine").unwrap();
    let before = contents(folder.path());
    for place in ["notes", "notes/below", "set/corners.csv"] {
        run(folder.path(), &["calibrate", "set", "-o", place])
            .assert_code(2)
            .assert_says(&["is a file, a folder is needed"]);
    }
    assert_eq!(contents(folder.path()), before);
}
