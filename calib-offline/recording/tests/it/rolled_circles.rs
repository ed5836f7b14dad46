//! A grid of circles that looks the same after a half turn, before two cameras of which one is rolled: the same circle
//! has the same label in both where the poses can tell, and where they cannot, that is said.

use calib_rays::geometry::{RigidTransform, SensorSize, so3};
use calib_rays::print::Circles;
use calib_rays::progress::Silent;
use calib_recording::dataset::Dataset;
use calib_recording::detect::{DetectSettings, detect_dataset};
use calib_simulate::pattern::Pattern;
use calib_simulate::render::{PlateView, RenderSettings};
use calib_simulate::shots::{Shot, ShotSettings};
use nalgebra::Vector3;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::Arc;

const BOARD: &str =
    "[board]\nkind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 12\n";

fn grid() -> Circles {
    Circles {
        rows: 6,
        cols: 8,
        pitch_mm: 20.0,
        diameter_mm: 12.0,
        asymmetric: false,
        direction: Vec::new(),
    }
}

/// Photographs the grid in poses tilted about an axis (degrees about x and y), by a left camera and one 120 mm to
/// its right that is rolled. Where each camera sees each circle.
fn photograph(folder: &Path, tilts_deg: &[(f64, f64)], roll_deg: f64) -> Vec<Vec<Vec<[f64; 2]>>> {
    let settings = ShotSettings {
        sensor: SensorSize::new(640, 480),
        ..ShotSettings::default()
    };
    let art = Arc::new(grid().artwork());
    let middle = Vector3::new(70.0, 50.0, 0.0);
    let right_from_left = RigidTransform::new(
        so3::exp(&Vector3::new(0.0, 0.0, roll_deg.to_radians()))
            * so3::exp(&Vector3::new(0.0, 0.25, 0.0)),
        so3::exp(&Vector3::new(0.0, 0.0, roll_deg.to_radians())) * Vector3::new(-120.0, 0.0, 15.0),
    );
    let mut manifest = BOARD.to_owned();
    let mut seen = Vec::new();
    for (name, from_left) in [
        ("left", RigidTransform::identity()),
        ("right", right_from_left),
    ] {
        let size = "width = 640\nheight = 480";
        let _ = writeln!(
            manifest,
            "[[camera]]\nname = \"{name}\"\n{size}\nimages = \"{name}/*.pgm\""
        );
        fs::create_dir_all(folder.join(name)).unwrap();
        let camera = Shot::camera(&settings, 3);
        let mut of_camera = Vec::new();
        for (pose, &(x, y)) in tilts_deg.iter().enumerate() {
            let turn = so3::exp(&Vector3::new(x.to_radians(), y.to_radians(), 0.0))
                * so3::exp(&Vector3::new(0.0, 0.0, 0.1 * pose as f64));
            let away = Vector3::new(10.0 * pose as f64 - 30.0, 8.0 * (pose % 3) as f64, 420.0);
            let left_from_plate = RigidTransform::new(turn, away - turn * middle);
            let view = PlateView {
                camera: &camera,
                camera_from_plate: from_left * left_from_plate,
                pattern: Pattern::Printed(Arc::clone(&art)),
                bow_mm: 0.0,
                displaced: None,
            };
            let mut bytes = b"P5\n640 480\n255\n".to_vec();
            bytes.extend(view.render(&RenderSettings::default()).to_u8());
            fs::write(folder.join(format!("{name}/{pose}.pgm")), bytes).unwrap();
            let circles = (0..48).map(|k| {
                let [x, y] = grid().center_mm(k / 8, k % 8);
                let point = view.camera_from_plate.point(&Vector3::new(x, y, 0.0));
                let pixel = camera.project(&point).unwrap();
                [pixel.u, pixel.v]
            });
            of_camera.push(circles.collect());
        }
        seen.push(of_camera);
    }
    fs::write(folder.join("dataset.toml"), manifest).unwrap();
    seen
}

#[test]
fn cameras_are_numbered_alike_whatever_their_roll() {
    let tilts = [
        (20.0, 5.0),
        (-20.0, 10.0),
        (5.0, 25.0),
        (0.0, -25.0),
        (15.0, -15.0),
    ];
    for roll_deg in [10.0, 92.0, 150.0, 180.0] {
        let home = tempfile::tempdir().unwrap();
        let truth = photograph(home.path(), &tilts, roll_deg);
        let dataset = Dataset::load(home.path()).unwrap();
        let found = detect_dataset(&dataset, &DetectSettings::default(), &Silent).unwrap();
        assert_eq!(found.views.len(), 2 * tilts.len(), "roll {roll_deg}");
        // Whether a view is numbered from the other end.
        let is_turned: Vec<(usize, bool)> = found
            .views
            .iter()
            .map(|view| {
                let truth = &truth[view.camera_idx][view.pose];
                let off = |turned: bool| {
                    let worst = view.corners.iter().map(|c| {
                        let k = c.row * 8 + c.col;
                        let [u, v] = truth[if turned { 47 - k } else { k }];
                        (c.pixel.u - u).hypot(c.pixel.v - v)
                    });
                    worst.fold(0.0, f64::max)
                };
                let (same, turned) = (off(false), off(true));
                assert!(same.min(turned) < 0.5, "roll {roll_deg}: {same} {turned}");
                (view.pose, turned < same)
            })
            .collect();
        for (pose, turned) in &is_turned {
            let of_pose = is_turned.iter().filter(|(other, _)| other == pose);
            assert!(
                of_pose.clone().all(|(_, t)| t == turned),
                "roll {roll_deg}, pose {pose}"
            );
        }
    }
}

#[test]
fn what_one_pose_cannot_tell_is_said() {
    let home = tempfile::tempdir().unwrap();
    photograph(home.path(), &[(20.0, 5.0)], 90.0);
    let dataset = Dataset::load(home.path()).unwrap();
    let error = detect_dataset(&dataset, &DetectSettings::default(), &Silent).unwrap_err();
    let said = error.to_string();
    assert!(said.contains("from camera left to camera right"), "{said}");
    assert!(said.contains("direction"), "{said}");
}
