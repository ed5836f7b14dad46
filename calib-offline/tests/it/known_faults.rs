//! Slips in known places and known poses, each given to the real binary: it says which it is, and where.

use crate::common::{dataset, run};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{RigidTransform, so3};
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;

const BOARD: BoardSpec = BoardSpec::chessboard(6, 5, 20.0);
const POSES: usize = 6;

fn manifest(kind: &str) -> String {
    let mut text = format!("[board]\n{kind}\n");
    for name in ["left", "right"] {
        let _ = write!(
            text,
            "[[camera]]\nname = \"{name}\"\nwidth = 640\nheight = 480\n"
        );
    }
    text
}

/// A hundredth of a pixel, the same every time.
fn noise(k: usize) -> f64 {
    0.01 * (k as f64 * 12.9898).sin()
}

/// Where two cameras 100 mm apart, turned to each other, see a point.
fn seen(point: &Vector3<f64>, camera: usize) -> [f64; 2] {
    let x = point.x - 100.0 * camera as f64;
    let (sine, cosine) = (0.13 * camera as f64).sin_cos();
    let (x, z) = (cosine * x + sine * point.z, cosine * point.z - sine * x);
    [320.0 + 700.0 * x / z, 240.0 + 700.0 * point.y / z]
}

/// A block of points; `places` changes what is written of each.
fn points(places: impl Fn(Vector3<f64>) -> Vector3<f64>) -> String {
    let mut text = "camera,pose,u,v,x_mm,y_mm,z_mm\n".to_owned();
    for (camera, name) in ["left", "right"].iter().enumerate() {
        for k in 0..7 * 7 * 4 {
            let [x, y, z] = [k % 7, k / 7 % 7, k / 49].map(|n| n as f64);
            let place = Vector3::new(30.0 * x - 60.0, 30.0 * y - 90.0, 40.0 * z);
            let [u, v] = seen(&(place + Vector3::new(0.0, 0.0, 600.0)), camera);
            let written = places(place);
            let (u, v) = (u + noise(3 * k), v + noise(3 * k + 1));
            let _ = writeln!(
                text,
                "{name},0,{u},{v},{},{},{}",
                written.x, written.y, written.z
            );
        }
    }
    text
}

fn true_pose(pose: usize) -> RigidTransform {
    let k = pose as f64;
    let turn = Vector3::new(0.3 * (2.1 * k).sin(), 0.3 * (1.3 * k).cos(), 0.2 + 0.05 * k);
    RigidTransform::new(
        so3::exp(&turn),
        Vector3::new(-30.0 + 8.0 * k, -40.0, 420.0 + 25.0 * k),
    )
}

fn corners() -> String {
    let mut text = "camera,pose,row,col,u,v\n".to_owned();
    for (camera, name) in ["left", "right"].iter().enumerate() {
        for pose in 0..POSES {
            for k in 0..BOARD.rows * BOARD.cols {
                let (row, col) = (k / BOARD.cols, k % BOARD.cols);
                let place = true_pose(pose).point(&BOARD.corner_in_board(row, col));
                let [u, v] = seen(&place, camera);
                let (u, v) = (u + noise(5 * k + pose), v + noise(7 * k + pose));
                let _ = writeln!(text, "{name},{pose},{row},{col},{u},{v}");
            }
        }
    }
    text
}

/// `poses.csv`, each pose changed on its way.
fn poses(change: impl Fn(RigidTransform) -> RigidTransform, degrees: f64) -> String {
    let mut text = "pose,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg\n".to_owned();
    for pose in 0..POSES {
        let found = change(true_pose(pose));
        let turn = so3::log(&found.rotation) * degrees;
        let t = found.translation_mm;
        let _ = writeln!(
            text,
            "{pose},{},{},{},{},{},{}",
            t.x, t.y, t.z, turn.x, turn.y, turn.z
        );
    }
    text
}

#[track_caller]
fn refused_known(poses: &str, code: i32, parts: &[&str]) {
    let grid = "kind = \"chessboard\"\nrows = 6\ncols = 5\nsquare_mm = 20.0\n[poses]\nknown = \"poses.csv\"";
    let folder = dataset(&manifest(grid), corners().as_bytes());
    std::fs::write(folder.path().join("set/poses.csv"), poses).unwrap();
    run(folder.path(), &["calibrate", "set", "-o", "out"])
        .assert_code(code)
        .assert_says(parts)
        .assert_says(&["try: "]);
}

#[track_caller]
fn refused_points(corners: &str, code: i32, parts: &[&str]) {
    let folder = dataset(&manifest("kind = \"points\""), corners.as_bytes());
    run(folder.path(), &["calibrate", "set", "-o", "out"])
        .assert_code(code)
        .assert_says(parts)
        .assert_says(&["try: "]);
}

#[test]
fn mirrored_places_are_called_so() {
    for axis in 0..3 {
        let mirrored = points(|mut place| {
            place[axis] = -place[axis];
            place
        });
        refused_points(
            &mirrored,
            3,
            &[
                "corners.csv: the places are those of a mirrored target",
                "reverse the sign",
            ],
        );
    }
}

#[test]
fn places_and_cameras_that_cannot_be_are_named_with_their_line() {
    let whole = points(|place| place);
    let one_camera: String = whole
        .lines()
        .filter(|line| !line.starts_with("right"))
        .collect::<Vec<_>>()
        .join("\n");
    let few: String = whole
        .lines()
        .enumerate()
        .filter(|(k, _)| *k == 0 || [1, 7, 49, 60, 130, 190].contains(&((k - 1) % 196)))
        .map(|(_, line)| line)
        .collect::<Vec<_>>()
        .join("\n");
    let far = whole.replacen(",-60,-90,0\n", ",1e300,-90,0\n", 1);
    let mut numbered = whole.replace("left", "0");
    for (text, code, parts) in [
        (
            &far,
            2,
            &["corners.csv:2:", "x_mm is 1e300", "millimeters"][..],
        ),
        (
            &one_camera,
            3,
            &["camera \"right\" saw nothing", "corners.csv", "[[camera]]"],
        ),
        (&few, 3, &["camera \"left\" saw 6 points", "8"]),
    ] {
        refused_points(text, code, parts);
    }
    numbered = numbered.replace("right", "1");
    refused_points(
        &numbered,
        2,
        &["corners.csv:2:", "camera \"0\"", "0 may be left"],
    );
}

#[test]
fn known_poses_in_another_convention_are_read_in_it() {
    let degrees = 180.0 / PI;
    let same = |pose| pose;
    let quarter = |pose: RigidTransform| {
        let turn = so3::exp(&Vector3::new(0.0, 0.0, FRAC_PI_2));
        RigidTransform::new(pose.rotation * turn, pose.translation_mm)
    };
    let meters =
        |pose: RigidTransform| RigidTransform::new(pose.rotation, pose.translation_mm / 1e3);
    for (text, says) in [
        (poses(meters, degrees), "read in meters"),
        (poses(quarter, degrees), "turned by 90 degrees in its plane"),
        (poses(|pose| pose.inverse(), degrees), "board_from_rig"),
        (poses(same, 1.0), "angles in radians"),
    ] {
        refused_known(
            &text,
            3,
            &["poses.csv: the known poses contradict the corners", says],
        );
    }
    // One that no reading explains.
    let shuffled = poses(same, degrees)
        .replacen("\n0,", "\n9,", 1)
        .replacen("\n3,", "\n0,", 1);
    let shuffled = shuffled
        .replacen("\n9,", "\n3,", 1)
        .replacen("\n1,", "\n9,", 1);
    let shuffled = shuffled
        .replacen("\n5,", "\n1,", 1)
        .replacen("\n9,", "\n5,", 1);
    refused_known(
        &shuffled,
        3,
        &[
            "poses.csv: the known poses contradict",
            "with poses that are free, camera",
        ],
    );
}

#[test]
fn known_poses_beyond_all_bounds_have_their_line() {
    let good = poses(|pose| pose, 180.0 / PI);
    let second = good.lines().nth(2).unwrap();
    let x = second.split(',').nth(1).unwrap();
    let far = good.replacen(second, &second.replacen(x, "1e300", 1), 1);
    refused_known(&far, 2, &["poses.csv:3:", "x_mm is 1e300"]);
}

#[test]
fn a_known_pose_without_corners_is_said() {
    let grid = "kind = \"chessboard\"\nrows = 6\ncols = 5\nsquare_mm = 20.0\n[poses]\nknown = \"poses.csv\"";
    let folder = dataset(&manifest(grid), corners().as_bytes());
    let poses = poses(|pose| pose, 180.0 / PI) + "77,0,0,400,0,0,0\n";
    std::fs::write(folder.path().join("set/poses.csv"), poses).unwrap();
    run(folder.path(), &["calibrate", "set", "-o", "out", "--json"]).assert_code(0);
    let text = std::fs::read_to_string(folder.path().join("out/calibration.json")).unwrap();
    let record: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(record["left_out"][0]["pose"], 77);
    assert!(
        record["left_out"][0]["reason"]
            .as_str()
            .unwrap()
            .contains("no camera has corners")
    );
}
