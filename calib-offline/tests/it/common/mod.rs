//! What the tests that drive the real binary share: running it, and inputs for it.

#![allow(clippy::format_push_string, reason = "shorter than write! in a test")]
#![allow(dead_code, reason = "each test file uses its part")]

use calib_offline::report::Calibration;
use calib_offline::report::record::{BoardShape, EstimateRecord, Grade, SCHEMA, Verdict};
use calib_rays::board::BoardSpec;
use calib_rays::field::uncertainty::packed;
use calib_rays::field::{
    BaseLens, CalibratedCamera, CoverageMask, PairUncertainty, Projection, RayField, Rig,
};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use nalgebra::{Matrix4, Vector3};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

pub mod against_truth;
pub mod documented;
pub mod halves;
pub mod json_schema;
pub mod snapshot;
pub mod standard;

pub const BOARD: BoardSpec = BoardSpec::chessboard(6, 5, 20.0);
pub const SENSOR: SensorSize = SensorSize::new(640, 480);
const FOCAL_PX: f64 = 600.0;

/// What a run of the binary gave.
#[derive(Debug)]
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Run {
    /// The one object on standard output.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|error| panic!("{error} in {:?}, {}", self.stdout, self.stderr))
    }

    #[track_caller]
    pub fn assert_code(&self, code: i32) -> &Self {
        assert_eq!(self.code, code, "{}\n{}", self.stdout, self.stderr);
        self
    }

    /// On standard error.
    #[track_caller]
    pub fn assert_says(&self, parts: &[&str]) -> &Self {
        assert_contains(&self.stderr, parts);
        self
    }

    /// On standard output.
    #[track_caller]
    pub fn assert_prints(&self, parts: &[&str]) -> &Self {
        assert_contains(&self.stdout, parts);
        self
    }
}

#[track_caller]
fn assert_contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part:?} is not in:\n{text}");
    }
}

/// Runs the binary in a folder.
pub fn run(folder: &Path, arguments: &[&str]) -> Run {
    run_with_input(folder, arguments, None)
}

/// The same, with something on its standard input.
pub fn run_with_input(folder: &Path, arguments: &[&str], input: Option<&[u8]>) -> Run {
    let mut child = Command::new(env!("CARGO_BIN_EXE_calib-offline"))
        .args(arguments)
        .current_dir(folder)
        .stdin(if input.is_some() {
            Stdio::piped()
        } else {
            Stdio::null()
        })
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    if let (Some(input), Some(mut stdin)) = (input, child.stdin.take()) {
        std::io::Write::write_all(&mut stdin, input).unwrap();
    }
    let output = child.wait_with_output().unwrap();
    Run {
        code: output.status.code().expect("it was not killed"),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Every file below a folder with its content.
pub fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.display().to_string();
            if path.is_dir() {
                found.insert(format!("{name}/"), Vec::new());
                open.push(path);
            } else {
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

/// Two ideal cameras 120 mm apart that look at a place 500 mm away.
pub fn rig() -> Rig {
    let cameras = [("left", -1.0), ("right", 1.0)].map(|(name, side)| CalibratedCamera {
        name: name.to_owned(),
        field: RayField::ideal(
            SENSOR,
            BaseLens::ideal(Projection::Perspective, FOCAL_PX),
            3,
        ),
        coverage: calibrated_middle(),
        rig_from_camera: RigidTransform::new(
            so3::exp(&Vector3::new(0.0, -side * 0.12, 0.0)),
            Vector3::new(side * 60.0, 0.0, -500.0),
        ),
    });
    Rig {
        uncertainty: Vec::new(),
        cameras: cameras.into(),
        datum_pose: 0,
        frame_is_known: false,
        match_noise_px: None,
    }
}

/// All but a margin of a tenth of the sensor.
fn calibrated_middle() -> CoverageMask {
    let at = |u, v| PixelPoint::new(f64::from(SENSOR.width) * u, f64::from(SENSOR.height) * v);
    let corners = [at(0.1, 0.1), at(0.9, 0.1), at(0.9, 0.9), at(0.1, 0.9)];
    CoverageMask::from_corners(SENSOR, corners.into_iter())
}

/// Where an ideal camera sees a point of the rig frame.
pub fn project(rig: &Rig, camera_idx: usize, point_in_rig: &Vector3<f64>) -> PixelPoint {
    let p = rig.cameras[camera_idx]
        .rig_from_camera
        .inverse()
        .point(point_in_rig);
    let center = SENSOR.center();
    PixelPoint::new(
        center.u + FOCAL_PX * p.x / p.z,
        center.v + FOCAL_PX * p.y / p.z,
    )
}

/// A calibration whose pixels are uncertain by 0.03 px alike, all four by themselves, with noise
/// of 0.04 px: together 0.05 px.
pub fn with_uncertainty() -> Calibration {
    let mut calibration = calibration();
    calibration.rig.uncertainty = vec![PairUncertainty {
        first: 0,
        second: 1,
        sensor: SENSOR,
        nodes_u: 3,
        nodes_v: 2,
        calibration_px2: vec![packed(&(Matrix4::identity() * 0.0009)); 6],
        noise_px2: 0.0016,
    }];
    calibration
}

/// A calibration that says no more than what the rig is.
pub fn calibration() -> Calibration {
    Calibration {
        nearest_pinholes: Vec::new(),
        schema: SCHEMA.to_owned(),
        tool_version: "0.0.0".to_owned(),
        command: None,
        cameras: Vec::new(),
        method: "joint".to_owned(),
        input_sha256: "0".repeat(64),
        board: BOARD,
        known_poses: [].into(),
        board_shape: BoardShape::default(),
        rig: rig(),
        poses: Vec::new(),
        stage_axes: Vec::new(),
        corners: Vec::new(),
        left_out: Vec::new(),
        renumbered: Vec::new(),
        estimate: EstimateRecord {
            cost_per_iteration: Vec::new(),
            stop_reason: "it was never begun".to_owned(),
            sigma_px: 0.1,
            rms_px: 0.14,
            corners_used: 0,
            corners_rejected: 0,
        },
        choices: None,
        alternating: None,
        held_out: None,
        checks: None,
        causes: Vec::new(),
        certificate: None,
        recording: None,
        task: None,
        imported: None,
        verdict: Verdict {
            grade: Grade::Pass,
            reasons: Vec::new(),
        },
    }
}

pub const MANIFEST: &str = "\
[board]
kind = \"chessboard\"
rows = 6
cols = 5
square_mm = 20.0

[[camera]]
name = \"left\"
width = 640
height = 480

[[camera]]
name = \"right\"
width = 640
height = 480
";

/// The corners of so many poses, seen by both cameras.
pub fn corners_csv(pose_count: usize) -> String {
    noisy_corners_csv(&rig(), pose_count, |_| 0.0)
}

/// The same of a rig, each coordinate with an error by its number, px.
pub fn noisy_corners_csv(rig: &Rig, pose_count: usize, error_px: impl Fn(u64) -> f64) -> String {
    let mut count = 0;
    let mut error = || {
        count += 1;
        error_px(count)
    };
    let mut text = String::from("camera,pose,row,col,u,v\n");
    for pose in 0..pose_count {
        let tilt = 0.25 * (pose as f64 - 2.0);
        let rig_from_board = RigidTransform::new(
            so3::exp(&Vector3::new(tilt, 0.4 - tilt, 0.1)),
            Vector3::new(-40.0, -50.0, 10.0 * pose as f64),
        );
        for (camera_idx, camera) in rig.cameras.iter().enumerate() {
            for row in 0..BOARD.rows {
                for col in 0..BOARD.cols {
                    let point = rig_from_board.point(&BOARD.corner_in_board(row, col));
                    let pixel = project(rig, camera_idx, &point);
                    let (name, u, v) = (&camera.name, pixel.u + error(), pixel.v + error());
                    text += &format!("{name},{pose},{row},{col},{u},{v}\n");
                }
            }
        }
    }
    text
}

/// A folder with `calibration.json` and the blob `rig.rays` packed from it.
pub fn packed_rig() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let json = calibration().to_json().unwrap();
    std::fs::write(folder.path().join("calibration.json"), json).unwrap();
    run(
        folder.path(),
        &["pack", "calibration.json", "-o", "rig.rays"],
    )
    .assert_code(0);
    folder
}

/// A folder with a dataset of six poses in `set`.
pub fn dataset(manifest: &str, corners: &[u8]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    std::fs::create_dir(&set).unwrap();
    std::fs::write(set.join("dataset.toml"), manifest).unwrap();
    std::fs::write(set.join("corners.csv"), corners).unwrap();
    folder
}
