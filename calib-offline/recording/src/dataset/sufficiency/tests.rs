use super::*;
use crate::dataset::{BoardKind, CameraSpec};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, SensorSize};

fn dataset(names: &[&str]) -> Dataset {
    Dataset {
        folder: ".".into(),
        kind: BoardKind::Chessboard,
        board: BoardSpec::chessboard(5, 4, 10.0),
        cameras: names
            .iter()
            .map(|name| CameraSpec {
                name: (*name).to_owned(),
                sensor: SensorSize::new(640, 480),
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
    }
}

fn view(camera_idx: usize, pose: usize, at: impl Fn(f64, f64) -> (f64, f64)) -> View {
    let corners = (0..5)
        .flat_map(|row| (0..4).map(move |col| (row, col)))
        .map(|(row, col)| {
            let (u, v) = at(col as f64, row as f64);
            Corner {
                row,
                col,
                pixel: PixelPoint::new(u, v),
                sigma_px: None,
            }
        })
        .collect();
    View {
        camera_idx,
        pose,
        corners,
    }
}

fn face(x: f64, y: f64) -> (f64, f64) {
    (100.0 + 20.0 * x, 50.0 + 20.0 * y)
}

/// Faces further and further to the right.
fn moved(pose: usize) -> impl Fn(f64, f64) -> (f64, f64) {
    move |x, y| (face(x, y).0 + 5.0 * pose as f64, face(x, y).1)
}

fn edge_on(x: f64, y: f64) -> (f64, f64) {
    (100.0 + 20.0 * x + y, 50.0 + 10.0 * x + 0.5 * y)
}

#[test]
fn three_good_poses_are_enough() {
    let views: Vec<View> = (0..3).map(|pose| view(0, pose, moved(pose))).collect();
    assert_eq!(check_sufficiency(&dataset(&["a"]), &views), Ok(()));
}

#[test]
fn a_board_that_never_moves_says_nothing_new() {
    let shaken =
        |pose: usize| move |x: f64, y: f64| (face(x, y).0 + 0.1 * pose as f64, face(x, y).1);
    let views: Vec<View> = (0..8).map(|pose| view(0, pose, shaken(pose))).collect();
    let error = check_sufficiency(&dataset(&["a"]), &views).unwrap_err();
    assert_eq!(
        error,
        SufficiencyError::SameView {
            camera: "a".to_owned(),
            views: 8,
            different: 1,
            need: 3
        }
    );
}

#[test]
fn one_or_two_poses_only() {
    for have in 1..3 {
        let views: Vec<View> = (0..have).map(|pose| view(0, pose, moved(pose))).collect();
        let error = check_sufficiency(&dataset(&["a"]), &views).unwrap_err();
        assert!(matches!(error, SufficiencyError::TooFewPoses { have: h, .. } if h == have));
        assert!(error.to_string().contains("at least 3"));
    }
}

#[test]
fn all_corners_on_a_line() {
    let views: Vec<View> = (0..9).map(|pose| view(0, pose, edge_on)).collect();
    let error = check_sufficiency(&dataset(&["a"]), &views).unwrap_err();
    assert!(matches!(error, SufficiencyError::OnALine { views: 9, .. }));

    // One row of the board only: a line on the board, whatever the image.
    let mut views: Vec<View> = (0..9).map(|pose| view(0, pose, moved(pose))).collect();
    for view in &mut views {
        view.corners.retain(|corner| corner.row == 2);
    }
    let error = check_sufficiency(&dataset(&["a"]), &views).unwrap_err();
    assert!(matches!(error, SufficiencyError::OnALine { .. }));
}

#[test]
fn a_view_on_a_line_does_not_count_as_a_pose() {
    let mut views: Vec<View> = (0..2).map(|pose| view(0, pose, moved(pose))).collect();
    views.extend((2..8).map(|pose| view(0, pose, edge_on)));
    let error = check_sufficiency(&dataset(&["a"]), &views).unwrap_err();
    assert!(matches!(
        error,
        SufficiencyError::TooFewPoses {
            have: 2,
            unusable: 6,
            ..
        }
    ));
}

#[test]
fn cameras_without_a_common_pose_are_not_connected() {
    let mut views: Vec<View> = (0..3).map(|pose| view(0, pose, moved(pose))).collect();
    views.extend((3..6).map(|pose| view(1, pose, moved(pose))));
    let error = check_sufficiency(&dataset(&["a", "b"]), &views).unwrap_err();
    assert!(matches!(error, SufficiencyError::NotConnected { camera, .. } if camera == "b"));

    // A third camera that shares poses with both connects them.
    views.extend((2..5).map(|pose| view(2, pose, moved(pose))));
    assert_eq!(
        check_sufficiency(&dataset(&["a", "b", "c"]), &views),
        Ok(())
    );
}

#[test]
fn nothing_at_all() {
    assert_eq!(
        check_sufficiency(&dataset(&["a"]), &[]),
        Err(SufficiencyError::NoCorners)
    );
}
