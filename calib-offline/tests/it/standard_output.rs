//! Results on standard output: files by `-o -`, readers that go away, and places that take nothing more.

use crate::common::{MANIFEST, corners_csv, packed_rig, run};
use std::fs;
use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// A folder with `calibration.json`, `rig.rays`, `matches.csv` and `pixels.csv`.
fn folder() -> tempfile::TempDir {
    let folder = packed_rig();
    let path = folder.path();
    let matches = "id,u_left,v_left,u_right,v_right\na,320,240,300,240\nb,330,250,310,250\n";
    fs::write(path.join("matches.csv"), matches).unwrap();
    fs::write(path.join("pixels.csv"), "id,u,v\na,320,240\n").unwrap();
    folder
}

fn output(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_calib-offline"))
        .current_dir(folder)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

#[test]
fn a_file_on_standard_output_has_the_bytes_of_one_with_a_name() {
    let folder = folder();
    let path = folder.path();
    for arguments in [
        &["measure", "rig.rays", "matches.csv"][..],
        &["rays", "rig.rays", "pixels.csv", "--camera", "left"],
        &["pack", "calibration.json"],
        &[
            "export",
            "rig.rays",
            "--format",
            "hex",
            "--base-address",
            "0x08000000",
        ],
        &[
            "target",
            "--kind",
            "chessboard",
            "--rows",
            "5",
            "--cols",
            "6",
            "--square-mm",
            "20",
        ],
    ] {
        let to = |place| [arguments, &["-o", place]].concat();
        let named = output(path, &to("named.svg"));
        assert!(named.status.success(), "{arguments:?}: {named:?}");
        let piped = output(path, &to("-"));
        assert!(piped.status.success(), "{arguments:?}: {piped:?}");
        assert_eq!(
            piped.stdout,
            fs::read(path.join("named.svg")).unwrap(),
            "{arguments:?}"
        );
        assert!(!path.join("-").exists());
        let words = String::from_utf8(piped.stderr).unwrap();
        assert!(!words.contains("written to -"), "{words}");
        fs::remove_file(path.join("named.svg")).unwrap();
    }
}

#[test]
fn an_object_and_a_file_are_one_too_many_and_so_are_many_files() {
    let folder = folder();
    let path = folder.path();
    let measure = ["measure", "rig.rays", "matches.csv", "-o", "-", "--json"];
    let said = run(path, &measure);
    said.assert_code(2).assert_says(&["leave --json out"]);
    assert_eq!(said.json()["exit_code"], 2);
    let corners = corners_csv(4);
    fs::write(path.join("dataset.toml"), MANIFEST).unwrap();
    fs::write(path.join("corners.csv"), corners).unwrap();
    let said = run(path, &["calibrate", ".", "-o", "-"]);
    said.assert_code(2)
        .assert_says(&["standard output", "several files", "./-"]);
    assert!(said.stdout.is_empty());
    assert!(!path.join("-").exists());
}

#[test]
fn a_reader_that_has_read_enough_is_no_error() {
    let folder = folder();
    let path = folder.path();
    let mut long = String::from("id,u_left,v_left,u_right,v_right\n");
    long.extend((0..20_000).map(|k| format!("p{k},320,240,300,240\n")));
    fs::write(path.join("matches.csv"), long).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_calib-offline"))
        .current_dir(path)
        .args(["measure", "rig.rays", "matches.csv", "-o", "-"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = [0; 3];
    let mut stdout = child.stdout.take().unwrap();
    stdout.read_exact(&mut first).unwrap();
    drop(stdout);
    assert_eq!(first, *b"id,");
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(0), "{ended:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_result_that_does_not_reach_a_full_place_is_an_error() {
    let folder = folder();
    let result = "the result does not reach standard output";
    for (arguments, told) in [
        (&["inspect", "rig.rays"][..], result),
        (&["inspect", "rig.rays", "--json"], result),
        (
            &["measure", "rig.rays", "matches.csv", "-o", "-"],
            "-: cannot be written",
        ),
    ] {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let ended = Command::new(env!("CARGO_BIN_EXE_calib-offline"))
            .current_dir(folder.path())
            .args(arguments)
            .stdout(full)
            .stderr(Stdio::piped())
            .output()
            .unwrap();
        assert_eq!(ended.status.code(), Some(2), "{arguments:?}: {ended:?}");
        let words = String::from_utf8(ended.stderr).unwrap();
        assert!(words.contains(told), "{words}");
    }
}
