//! Faults planted into simulated recordings, and recordings without any.

use super::Sheet;
use crate::cause::Code;
use crate::verdict::Grade;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{RigidTransform, SensorSize, so3};
use calib_rays::observed::{Corner, View};
use calib_recording::dataset::{BoardKind, CameraSpec, Dataset, ExpectedOptics};
use calib_simulate::{OpticsKind, Scene, SceneSettings};
use nalgebra::Vector3;

/// A recording on a stage: two placements of seven angles.
fn recording(optics: OpticsKind, seed: u64) -> (Dataset, Vec<View>) {
    let board = BoardSpec::chessboard(8, 10, 12.0);
    let scene = Scene::new(SceneSettings {
        board: board.clone(),
        placements: 2,
        angles_deg: (-3..=3).map(|k| 12.0 * f64::from(k)).collect(),
        ..SceneSettings::standard_noisy(optics, seed)
    })
    .unwrap();
    let cameras = scene.cameras.iter().zip(&scene.names);
    let dataset = Dataset {
        folder: ".".into(),
        kind: BoardKind::Chessboard,
        board,
        cameras: cameras
            .map(|(camera, name)| CameraSpec {
                name: (*name).to_owned(),
                sensor: camera.sensor(),
                images: Vec::new(),
                optics: None,
                serial: None,
            })
            .collect(),
        stage: None,
        known_poses: [].into(),
        known_poses_file: None,
        excluded_poses: [].into(),
        target: None,
        certificate: None,
        recording: None,
    };
    (dataset, scene.observe_corners())
}

/// A board held by hand: tilts up to an angle in all directions, distances over a share to either side.
fn hand_held(count: usize, tilt_deg: f64, depth_share: f64, across: f64) -> (Dataset, Vec<View>) {
    let (mut dataset, _) = brown();
    dataset.board.square_mm = 10.0;
    let mut scene = Scene::new(SceneSettings {
        board: dataset.board.clone(),
        placements: 1,
        angles_deg: vec![0.0; count],
        ..SceneSettings::standard_noisy(OpticsKind::Brown, 7)
    })
    .unwrap();
    let usual = scene.true_poses[0];
    let middle = dataset.board.center_in_board();
    for (k, pose) in scene.true_poses.iter_mut().enumerate() {
        let kf = k as f64;
        let tilt = (tilt_deg * ((kf + 0.5) / count as f64).sqrt()).to_radians();
        let turn = Vector3::new(
            (2.4 * kf).cos() * tilt,
            (2.4 * kf).sin() * tilt,
            0.05 * kf.sin(),
        );
        let rotation = so3::exp(&turn) * usual.rotation;
        let share = 1.0 + depth_share * (2.0 * (0.618 * kf).fract() - 1.0);
        let aside = Vector3::new((1.9 * kf).sin(), (3.1 * kf).cos(), 0.0) * across;
        let place = usual.point(&middle) * share + aside;
        *pose = RigidTransform::new(rotation, place - rotation * middle);
    }
    (dataset, scene.observe_corners())
}

/// Codes of what lowers the grade, but that the small board is not shown everywhere.
fn lowering(dataset: &Dataset, views: &[View]) -> Vec<Code> {
    let causes = Sheet::of(dataset, views).causes;
    let lowering = causes.iter().filter(|c| c.grade > Grade::Pass);
    let codes = lowering.map(|c| c.code);
    codes.filter(|code| *code != Code::Coverage).collect()
}

#[test]
fn boards_that_lie_alike_and_boards_that_do_not() {
    let of = |count, tilt_deg, depth_share, across| {
        let (dataset, views) = hand_held(count, tilt_deg, depth_share, across);
        lowering(&dataset, &views)
    };
    assert_eq!(of(12, 25.0, 0.15, 20.0), []);
    assert_eq!(of(8, 15.0, 0.05, 20.0), []);
    // One distance does no harm where tilts give depth.
    assert_eq!(of(12, 25.0, 0.0, 20.0), []);
    assert_eq!(of(12, 3.0, 0.1, 20.0), [Code::FewTilts]);
    assert_eq!(of(12, 2.0, 0.0, 0.0), [Code::OneDepth, Code::FewTilts]);
    assert_eq!(of(5, 25.0, 0.15, 20.0), [Code::FewPoses]);
}

fn brown() -> (Dataset, Vec<View>) {
    recording(OpticsKind::Brown, 5)
}

const RIGHT: usize = 1;

fn change(views: &mut [View], which: impl Fn(&View) -> bool, change: impl Fn(&mut Corner)) {
    for view in views.iter_mut().filter(|view| which(view)) {
        for corner in &mut view.corners {
            change(corner);
        }
        view.corners.sort_by_key(|c| (c.row, c.col));
    }
}

/// The first cause, which must be the only one that lowers the grade.
fn only_cause(dataset: &Dataset, views: &[View]) -> (Code, String) {
    let sheet = Sheet::of(dataset, views);
    let lowering = |c: &&crate::Cause| c.grade > Grade::Pass;
    let all: Vec<_> = sheet.causes.iter().filter(lowering).collect();
    assert_eq!(all.len(), 1, "{:#?}", sheet.causes);
    (all[0].code, all[0].text.clone())
}

#[test]
fn faultless_recordings_of_all_optics_have_no_cause() {
    for optics in OpticsKind::ALL {
        if optics == OpticsKind::Telecentric {
            continue;
        }
        let (dataset, views) = recording(optics, 3);
        let sheet = Sheet::of(&dataset, &views);
        assert!(sheet.causes.is_empty(), "{optics:?}: {:#?}", sheet.causes);
    }
}

#[test]
fn units_that_are_no_millimeters() {
    for factor in [0.1, 1.0 / 25.4, 0.001] {
        let (mut dataset, views) = brown();
        dataset.board.square_mm *= factor / 2.0;
        let (code, text) = only_cause(&dataset, &views);
        assert_eq!(code, Code::SquareUnit, "{factor}: {text}");
    }
    let (mut dataset, views) = brown();
    dataset.board.square_mm *= 0.05;
    let one: Vec<View> = views
        .iter()
        .filter(|v| v.camera_idx == 0)
        .cloned()
        .collect();
    dataset.cameras.truncate(1);
    // A small board before one camera is nothing special, a board of a third of a millimeter is.
    assert!(Sheet::of(&dataset, &one).causes.is_empty());
    dataset.board.square_mm *= 0.02;
    assert_eq!(only_cause(&dataset, &one).0, Code::SquareUnit);
}

#[test]
fn cameras_exchanged_throughout_and_in_some_poses() {
    let (dataset, mut views) = brown();
    let faultless = views.clone();
    for view in &mut views {
        view.camera_idx = 1 - view.camera_idx;
    }
    views.sort_by_key(|view| (view.pose, view.camera_idx));
    let (code, text) = only_cause(&dataset, &views);
    assert_eq!(code, Code::CamerasExchanged, "{text}");

    let mut views = faultless;
    for view in views.iter_mut().filter(|view| [3, 8].contains(&view.pose)) {
        view.camera_idx = 1 - view.camera_idx;
    }
    let (code, text) = only_cause(&dataset, &views);
    assert_eq!(code, Code::CamerasExchanged, "{text}");
    assert!(text.contains("poses 3 and 8"), "{text}");
}

#[test]
fn v_upwards_in_both_cameras_and_in_one() {
    let (dataset, views) = brown();
    let height = f64::from(dataset.cameras[0].sensor.height);
    let upwards = |c: &mut Corner| c.pixel.v = height - 1.0 - c.pixel.v;
    let mut both = views.clone();
    change(&mut both, |_| true, upwards);
    assert_eq!(only_cause(&dataset, &both).0, Code::VUpwards);
    let mut one = views;
    change(&mut one, |view| view.camera_idx == RIGHT, upwards);
    let (code, text) = only_cause(&dataset, &one);
    assert_eq!(code, Code::VUpwards, "{text}");
    assert!(text.contains("camera right"), "{text}");
}

#[test]
fn u_and_v_exchanged() {
    let (mut dataset, mut views) = brown();
    change(
        &mut views,
        |_| true,
        |c| {
            (c.pixel.u, c.pixel.v) = (c.pixel.v, c.pixel.u);
        },
    );
    for camera in &mut dataset.cameras {
        camera.sensor = SensorSize::new(1280, 1280);
    }
    assert_eq!(only_cause(&dataset, &views).0, Code::UvExchanged);
}

#[test]
fn labels_mirrored_in_some_views() {
    let (dataset, mut views) = brown();
    let cols = dataset.board.cols;
    let some = |view: &View| view.camera_idx == RIGHT && view.pose >= 10;
    change(&mut views, some, |c| c.col = cols - 1 - c.col);
    let (code, text) = only_cause(&dataset, &views);
    assert_eq!(code, Code::LabelsMirrored, "{text}");
    assert!(text.contains("poses 10 to 13"), "{text}");
}

/// Labels one row too large; the last row falls off.
fn shift(views: &mut [View], rows: usize, which: impl Fn(&View) -> bool) {
    for view in views.iter_mut().filter(|view| which(view)) {
        view.corners.retain(|c| c.row + 1 < rows);
        for corner in &mut view.corners {
            corner.row += 1;
        }
    }
}

#[test]
fn labels_shifted_in_one_view_and_in_all_of_a_camera() {
    let (dataset, views) = brown();
    let mut one = views.clone();
    shift(&mut one, 8, |view| {
        view.camera_idx == RIGHT && view.pose == 4
    });
    let (code, text) = only_cause(&dataset, &one);
    assert_eq!(code, Code::LabelsShifted, "{text}");
    assert!(text.contains("camera right in pose 4"), "{text}");
    let mut all = views;
    shift(&mut all, 8, |view| view.camera_idx == RIGHT);
    let (code, text) = only_cause(&dataset, &all);
    assert_eq!(code, Code::LabelsShifted, "{text}");
    assert!(text.contains("camera right"), "{text}");
}

#[test]
fn a_camera_that_is_one_pose_late() {
    let (dataset, mut views) = brown();
    for view in views.iter_mut().filter(|view| view.camera_idx == RIGHT) {
        view.pose += 1;
    }
    let (code, text) = only_cause(&dataset, &views);
    assert_eq!(code, Code::PoseNumbering, "{text}");
}

#[test]
fn copies_and_boards_that_stand_still() {
    let (dataset, views) = brown();
    let mut copies = views.clone();
    for camera_idx in 0..2 {
        let at = |pose: usize| {
            let same = |view: &View| view.camera_idx == camera_idx && view.pose == pose;
            copies.iter().position(same).unwrap()
        };
        let (from, to) = (at(2), at(9));
        copies[to].corners = copies[from].corners.clone();
    }
    let (code, text) = only_cause(&dataset, &copies);
    assert_eq!(code, Code::Duplicates, "{text}");
    assert!(text.contains("13 different poses"), "{text}");
    // The same place with other noise does no harm, and is said.
    let mut standing = views;
    for camera_idx in 0..2 {
        let of = |pose: usize| move |v: &View| v.camera_idx == camera_idx && v.pose == pose;
        let from = standing.iter().find(|v| of(2)(v)).unwrap().corners.clone();
        let to = standing.iter_mut().find(|v| of(9)(v)).unwrap();
        to.corners = from;
        for (k, corner) in to.corners.iter_mut().enumerate() {
            corner.pixel.u += 0.05 * [1.0, -1.0, 0.5][k % 3];
        }
    }
    let sheet = Sheet::of(&dataset, &standing);
    let found: Vec<_> = sheet.causes.iter().map(|c| (c.code, c.grade)).collect();
    assert_eq!(found, [(Code::Duplicates, Grade::Pass)]);
}

#[test]
fn copies_come_before_what_they_leave_to_be_few() {
    let (dataset, mut views) = brown();
    let all = views.clone();
    for view in &mut views {
        let of = view.pose % 4;
        let same = |other: &&View| (other.camera_idx, other.pose) == (view.camera_idx, of);
        view.corners = all.iter().find(same).unwrap().corners.clone();
    }
    assert_eq!(
        lowering(&dataset, &views)[..2],
        [Code::Duplicates, Code::FewPoses]
    );
}

#[test]
fn half_size_from_some_pose_on() {
    let (dataset, mut views) = brown();
    change(
        &mut views,
        |view| view.pose >= 7,
        |c| {
            c.pixel.u = (c.pixel.u + 0.5) / 2.0 - 0.5;
            c.pixel.v = (c.pixel.v + 0.5) / 2.0 - 0.5;
        },
    );
    let sheet = Sheet::of(&dataset, &views);
    assert_eq!(sheet.causes.len(), 1, "{:#?}", sheet.causes);
    let found = &sheet.causes[0];
    assert_eq!((found.code, found.since_pose), (Code::ImageSize, Some(7)));
    assert!(found.text.contains("left and right"), "{}", found.text);
}

#[test]
fn noise_and_wrong_corners() {
    let (dataset, mut views) = brown();
    let few = views.clone();
    for (k, corner) in views.iter_mut().flat_map(|v| &mut v.corners).enumerate() {
        corner.pixel.u += if k % 11 == 5 { 6.0 } else { 0.0 };
    }
    assert_eq!(lowering(&dataset, &views), [Code::Outliers; 2]);
    let mut views = few;
    for (k, corner) in views.iter_mut().flat_map(|v| &mut v.corners).enumerate() {
        // Even between -1 and 1, in no order.
        corner.pixel.v += (31 * k * k % 101) as f64 / 50.0 - 1.0;
        corner.pixel.u += (47 * k * k % 103) as f64 / 51.0 - 1.0;
    }
    assert_eq!(lowering(&dataset, &views), [Code::Noise; 2]);
}

#[test]
fn two_poses_and_no_corner() {
    let (dataset, mut views) = brown();
    views.retain(|view| view.pose < 2);
    let sheet = Sheet::of(&dataset, &views);
    assert_eq!(sheet.causes[0].code, Code::FewPoses);
    assert_eq!(sheet.causes[0].grade, Grade::Fail);
    assert_eq!(Sheet::of(&dataset, &[]), Sheet::default());
}

#[test]
fn a_mirror_that_is_declared_is_no_fault() {
    let (mut dataset, mut views) = brown();
    let width = f64::from(dataset.cameras[0].sensor.width);
    change(
        &mut views,
        |_| true,
        |c| c.pixel.u = width - 1.0 - c.pixel.u,
    );
    for camera in &mut dataset.cameras {
        camera.optics = Some(ExpectedOptics::Mirror);
    }
    // What is left on the right in a mirror is for the user to say; the labels are right.
    let codes = lowering(&dataset, &views);
    assert!(!codes.contains(&Code::LabelsMirrored), "{codes:?}");
}
