//! Bad datasets, given to the real binary: each is refused with the right exit code and a message
//! that names the place and the remedy, and nothing is left half-written.

#![allow(clippy::format_push_string, reason = "shorter than write! in a test")]

use crate::common::{MANIFEST, contents, corners_csv, dataset, run};

/// `calibrate` and `inspect` of a dataset. `inspect` must refuse what is broken (code 2) and
/// describe what is merely not enough (code 3).
#[track_caller]
pub fn refused(manifest: &str, corners: &[u8], code: i32, parts: &[&str]) {
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
    run(folder.path(), &["methods", "set", "-o", "out"])
        .assert_code(code)
        .assert_says(parts)
        .assert_says(&["error:", "try: "]);
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
        for verb in ["calibrate", "methods"] {
            run(folder.path(), &[verb, "set", "-o", place])
                .assert_code(2)
                .assert_says(&["is a file, a folder is needed"]);
        }
    }
    assert_eq!(contents(folder.path()), before);
}

/// The corners of six poses, each changed or left out: camera, pose, row, col, u, v.
type Fields = (String, usize, usize, usize, f64, f64);

fn changed_corners(change: impl Fn(Fields) -> Option<Fields>) -> String {
    let mut text = String::from("camera,pose,row,col,u,v\n");
    for line in corners_csv(6).lines().skip(1) {
        let f: Vec<&str> = line.split(',').collect();
        let count = |k: usize| f[k].parse::<usize>().unwrap();
        let pixel = |k: usize| f[k].parse::<f64>().unwrap();
        let corner = (
            f[0].to_owned(),
            count(1),
            count(2),
            count(3),
            pixel(4),
            pixel(5),
        );
        if let Some((camera, pose, row, col, u, v)) = change(corner) {
            text += &format!("{camera},{pose},{row},{col},{u},{v}\n");
        }
    }
    text
}

#[test]
fn manifests_with_values_that_cannot_be_meant() {
    let too_long = format!("\"{}\"", "l".repeat(65));
    let cases: &[(&str, &str, &[&str])] = &[
        (
            "square_mm = 20.0",
            "square_mm = 1e300",
            &[":5:", "ten meters"],
        ),
        (
            "square_mm = 20.0",
            "square_mm = 1e-9",
            &[":5:", "micrometer"],
        ),
        (
            "square_mm = 20.0",
            "square_mm = \"20 mm\"",
            &[":5:", "square_mm"],
        ),
        (
            "rows = 6",
            "rows = 1",
            &[":3:", "rows = 1", "inner corners"],
        ),
        ("rows = 6", "rows = -6", &[":3:", "rows = -6"]),
        ("cols = 5", "cols = 5.5", &[":4:", "5.5"]),
        ("cols = 5", "cols = 5\ncols = 5", &[":5:", "duplicate"]),
        ("width = 640", "width = 0", &[":9:", "width = 0"]),
        ("width = 640", "width = 40000", &[":9:", "32768"]),
        ("width = 640", "width = 640.5", &[":9:", "640.5"]),
        ("\"left\"", "\"le,ft\"", &[":8:", "letters, digits"]),
        ("\"left\"", "\"le\\nft\"", &[":8:", "letters, digits"]),
        ("\"left\"", "\"\"", &[":8:", "letters, digits"]),
        ("\"left\"", &too_long, &[":8:", "64 letters"]),
        (
            "[board]",
            "[dataset]\nexclude = [-1]\n[board]",
            &[":2:", "-1"],
        ),
        (
            "[board]",
            "[stage]\nangles_deg = [nan]\n[board]",
            &[":2:", "degrees"],
        ),
        (
            "[board]",
            "[stage]\nplacement = [0]\n[board]",
            &["placement", "1 entries"],
        ),
        ("[board]", "[board", &[":1:"]),
        ("[[camera]]", "[camera]", &["dataset.toml:"]),
    ];
    for (from, to, parts) in cases {
        refused_manifest(from, to, parts);
    }
    let camera = |k: usize| format!("\n[[camera]]\nname = \"c{k}\"\nwidth = 9\nheight = 9\n");
    let many = MANIFEST.to_owned() + &(0..63).map(camera).collect::<String>();
    refused(&many, b"", 2, &["65 cameras", "64 are possible"]);
    let deep = format!("a = {}", "[".repeat(100_000));
    refused(&deep, b"", 2, &["dataset.toml:1:"]);
}

#[test]
fn a_manifest_that_is_no_text() {
    let folder = dataset("", b"");
    let bytes: Vec<u8> = (0..=255).collect();
    std::fs::write(folder.path().join("set/dataset.toml"), bytes).unwrap();
    run(folder.path(), &["calibrate", "set", "-o", "out"])
        .assert_code(2)
        .assert_says(&["dataset.toml", "not text", "UTF-8", "try: "]);
}

#[test]
fn places_that_are_no_dataset() {
    let folder = dataset(MANIFEST, corners_csv(6).as_bytes());
    std::fs::create_dir_all(folder.path().join("odd/dataset.toml")).unwrap();
    let before = contents(folder.path());
    for place in ["set/corners.csv", "odd", "/dev/null"] {
        for verb in ["calibrate", "detect"] {
            let output: &[&str] = if verb == "calibrate" {
                &["-o", "out"]
            } else {
                &[]
            };
            run(folder.path(), &[&[verb, place], output].concat())
                .assert_code(2)
                .assert_says(&["there is no dataset.toml here", "try: "]);
        }
    }
    assert_eq!(contents(folder.path()), before);
}

#[test]
fn rows_that_are_no_corners() {
    let long = "x".repeat(3_000_000);
    let digits = format!("left,0,0,2,{},100", "1".repeat(1_000_000));
    let cases: &[(&str, &[&str])] = &[
        (&long, &["corners.csv:4:", "1 fields"]),
        (&digits, &["corners.csv:4:", "finite"]),
        ("left,0,0,2,1e300,100", &["outside camera", "image size"]),
        ("left,0,0,2,-1e300,100", &["outside camera", "image size"]),
        ("left,-1,0,2,100,100", &["corners.csv:4:", "pose", "-1"]),
        (
            "left,18446744073709551616,0,2,100,100",
            &["corners.csv:4:", "pose"],
        ),
        ("left,0,1.5,2,100,100", &["corners.csv:4:", "row", "1.5"]),
        ("left,0,0,\0,100,100", &["corners.csv:4:", "col"]),
        ("left,0,0,2,\"100,100", &["corners.csv:4:", "u is"]),
        ("left,0,0,2,100,5,100,5", &["corners.csv:4:", "8 fields"]),
        ("left;0;0;2;100;100", &["corners.csv:4:", "1 fields"]),
    ];
    for (row, parts) in cases {
        refused_corners(|lines| lines[3] = (*row).to_owned(), parts);
    }
    for sigma in ["0", "-1", "nan", "inf"] {
        refused_corners(
            |lines| {
                for line in lines.iter_mut() {
                    line.push_str(",0.1");
                }
                lines[0] = "camera,pose,row,col,u,v,sigma_px".to_owned();
                lines[3] = format!("left,0,0,2,300,200,{sigma}");
            },
            &["corners.csv:4:", "sigma_px"],
        );
    }
    let semicolons = corners_csv(6).replace(',', ";");
    refused(
        MANIFEST,
        semicolons.as_bytes(),
        2,
        &["corners.csv:1:", "commas"],
    );
    let wide: Vec<u8> = corners_csv(6)
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    refused(MANIFEST, &wide, 2, &["corners.csv:1:"]);
    refused(MANIFEST, b"camera,pose,row,col,u,v\n", 2, &["no corners"]);
}

/// What spreadsheets and editors do to a file is no mistake.
#[test]
fn line_ends_marks_blanks_and_quotes_mean_nothing() {
    let text = corners_csv(6);
    let quoted = text
        .replace("camera,pose", "\"camera\",\"pose\"")
        .replace("left", "\"left\"");
    for corners in [
        text.replace('\n', "\r\n"),
        format!("\u{feff}{text}"),
        text.replace(',', " , "),
        quoted,
        format!("{text}\n\n"),
    ] {
        let manifest = format!("\u{feff}{}", MANIFEST.replace('\n', "\r\n"));
        let folder = dataset(&manifest, corners.as_bytes());
        let object = run(folder.path(), &["inspect", "set", "--json"])
            .assert_code(0)
            .json();
        assert_eq!(object["capture"]["poses_seen_by_all"], 6);
    }
}

#[test]
fn views_that_determine_nothing() {
    let only = |keep: fn(&Fields) -> bool| changed_corners(|f| keep(&f).then_some(f));
    let at = |place: fn(usize, usize) -> (f64, f64)| {
        changed_corners(move |(camera, pose, row, col, _, _)| {
            let (u, v) = place(row, col);
            Some((camera, pose, row, col, u, v))
        })
    };
    let grid = |row: usize, col: usize| (100.0 + 30.0 * col as f64, 80.0 + 30.0 * row as f64);
    let third = format!("{MANIFEST}\n[[camera]]\nname = \"top\"\nwidth = 9\nheight = 9\n");
    let cases: [(&str, String, &[&str]); 7] = [
        (&third, corners_csv(6), &["\"top\"", "0 usable poses"]),
        (
            MANIFEST,
            only(|f| f.0 == "left"),
            &["\"right\"", "0 usable poses"],
        ),
        (
            MANIFEST,
            only(|f| f.0 == "left" || f.1 < 1),
            &["\"right\"", "1 usable pose,"],
        ),
        (
            MANIFEST,
            only(|f| (f.0 == "left") == (f.1 % 2 == 0)),
            &["\"right\" shares no usable pose"],
        ),
        (MANIFEST, only(|f| f.2 == 0), &["\"left\"", "on a line"]),
        (
            MANIFEST,
            at(|_, _| (300.0, 200.0)),
            &["\"left\"", "on a line"],
        ),
        (MANIFEST, at(grid), &["\"left\"", "1 different place,"]),
    ];
    for (manifest, corners, parts) in cases {
        refused(manifest, corners.as_bytes(), 3, parts);
    }
}

/// Labels of which each is possible, and which contradict each other.
#[test]
fn labels_that_do_not_belong_together() {
    let mirrored = changed_corners(|(camera, pose, row, col, u, v)| {
        let u = if camera == "left" { 639.0 - u } else { u };
        Some((camera, pose, row, col, u, v))
    });
    let folder = dataset(MANIFEST, mirrored.as_bytes());
    let says =
        "the views of camera left belong to those of camera right with u counted from the right";
    run(folder.path(), &["calibrate", "set", "-o", "out"])
        .assert_code(3)
        .assert_says(&[says, "try: correct that first"]);
    run(folder.path(), &["methods", "set"])
        .assert_code(3)
        .assert_says(&[says]);
    let refused = run(folder.path(), &["calibrate", "set", "-o", "out", "--json"]).json();
    let inspected = run(folder.path(), &["inspect", "set", "--json"]).json();
    assert_eq!(refused["causes"], inspected["causes"]);
    assert_eq!(refused["causes"][0]["cause"], "labels-mirrored");
    let words = run(folder.path(), &["inspect", "set"]).stdout;
    assert!(words.contains(says), "{words}");
}

/// A camera whose board is numbered from the other end is not refused: the turn is undone, and
/// the result says so.
#[test]
fn labels_turned_in_one_camera_lower_the_verdict() {
    let turned = changed_corners(|(camera, pose, row, col, u, v)| {
        let (row, col) = if camera == "right" {
            (5 - row, 4 - col)
        } else {
            (row, col)
        };
        Some((camera, pose, row, col, u, v))
    });
    let folder = dataset(MANIFEST, turned.as_bytes());
    let object = run(folder.path(), &["calibrate", "set", "-o", "out", "--json"])
        .assert_code(0)
        .json();
    assert_eq!(object["verdict"], "doubtful");
    let reasons = object["reasons"].to_string();
    assert!(
        reasons.contains("6 of 12 views could not be used as recorded"),
        "{reasons}"
    );
}

#[test]
fn a_pose_to_leave_out_that_does_not_exist() {
    let folder = dataset(MANIFEST, corners_csv(6).as_bytes());
    run(
        folder.path(),
        &["calibrate", "set", "-o", "out", "--exclude", "6"],
    )
    .assert_code(2)
    .assert_says(&["no pose 6", "the last is pose 5", "try: "]);
    assert!(!folder.path().join("out").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn output_folder_that_cannot_be_written() {
    let folder = dataset(MANIFEST, corners_csv(6).as_bytes());
    // Not even root makes files there.
    let refusal = run(folder.path(), &["calibrate", "set", "-o", "/proc/results"]);
    refusal
        .assert_code(2)
        .assert_says(&["/proc/results", "cannot be written", "try: "]);
    assert!(
        !refusal.stderr.contains("initialize"),
        "only after the work"
    );
}
