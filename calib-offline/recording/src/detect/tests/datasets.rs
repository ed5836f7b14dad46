//! Several poses and cameras: the same corner, the same label.

use super::*;

/// Two cameras side by side that see boards turned and tilted as given (turn, tilt, tilt), the
/// second one mounted turned by `second_turn_deg`.
fn pair(board: &BoardSpec, poses: &[[f64; 3]], second_turn_deg: f64) -> [Vec<Photo>; 2] {
    let camera = |right_mm: f64, turn_deg: f64| {
        poses
            .iter()
            .map(|&[turn, x, y]| {
                // A board in the hand or beside the axis moves with its tilt.
                let (away_mm, down_mm) = (0.6 * y, -0.5 * x);
                let mut photo = tilted(board.clone(), turn, [x, y], right_mm + away_mm, down_mm);
                photo.px_from_board = turned_image(turn_deg) * photo.px_from_board;
                photo
            })
            .collect()
    };
    [camera(15.0, 0.0), camera(-15.0, second_turn_deg)]
}

/// The image of a camera turned about its axis.
fn turned_image(turn_deg: f64) -> nalgebra::Matrix3<f64> {
    let (s, c) = turn_deg.to_radians().sin_cos();
    let (u, v) = (319.5, 239.5);
    nalgebra::Matrix3::new(
        c,
        -s,
        u - c * u + s * v,
        s,
        c,
        v - s * u - c * v,
        0.0,
        0.0,
        1.0,
    )
}

/// Whether all labels are right, or all turned by half a turn: 1 or -1 (0: neither).
fn side(view: &View, photo: &Photo) -> i32 {
    i32::from(worst_px(view, photo) < 0.5) - i32::from(worst_half_turned_px(view, photo) < 0.5)
}

fn sides(found: &Detection, cameras: &[Vec<Photo>]) -> Vec<i32> {
    found
        .views
        .iter()
        .map(|v| side(v, &cameras[v.camera_idx][v.pose]))
        .collect()
}

#[test]
fn a_stage_that_turns_an_odd_by_odd_board_upside_down_keeps_its_labels() {
    let folder = tempfile::tempdir().unwrap();
    let poses: Vec<[f64; 3]> = (0..8)
        .map(|k| [-30.0 + 40.0 * f64::from(k), 15.0, 10.0 - 4.0 * f64::from(k)])
        .collect();
    let cameras = pair(&board(7, 9), &poses, 0.0);
    let found = detect(&dataset(folder.path(), board(7, 9), true, &cameras)).unwrap();
    assert_eq!(sides(&found, &cameras), vec![1; 16]);
    // Six of eight poses are turned by more than 45 degrees against the first one or two.
    assert!(!found.turned.is_empty());
}

#[test]
fn a_camera_mounted_upside_down_is_recognized_by_epipolar_geometry() {
    let folder = tempfile::tempdir().unwrap();
    let poses = [
        [0.0, 20.0, 0.0],
        [10.0, -20.0, 5.0],
        [-5.0, 0.0, 30.0],
        [3.0, 10.0, -30.0],
    ];
    let cameras = pair(&board(7, 9), &poses, 180.0);
    let found = detect(&dataset(folder.path(), board(7, 9), false, &cameras)).unwrap();
    assert_eq!(sides(&found, &cameras), vec![1; 8]);
}

#[test]
fn one_pair_of_upright_cameras_is_taken_as_upright() {
    let folder = tempfile::tempdir().unwrap();
    let cameras = pair(&board(6, 8), &[[20.0, 20.0, 10.0]], 0.0);
    let found = detect(&dataset(folder.path(), board(6, 8), false, &cameras)).unwrap();
    assert_eq!(sides(&found, &cameras), vec![1; 2]);
}

#[test]
fn one_pair_with_a_camera_on_its_side_is_an_error_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let cameras = pair(&board(6, 8), &[[0.0, 0.0, 0.0]], 85.0);
    let error = detect(&dataset(folder.path(), board(6, 8), false, &cameras)).unwrap_err();
    assert!(
        matches!(
            error,
            DetectError::Consistency(ConsistencyError::TurnBetweenCameras { .. })
        ),
        "{error}"
    );
    assert!(error.to_string().contains("corners.csv"));
}

#[test]
fn a_stage_turned_by_a_right_angle_between_poses_is_an_error_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let cameras = pair(
        &board(7, 9),
        &[[0.0, 5.0, 0.0], [20.0, 5.0, 0.0], [108.0, 5.0, 0.0]],
        0.0,
    );
    let set = dataset(folder.path(), board(7, 9), true, &cameras[..1]);
    match detect(&set).unwrap_err() {
        DetectError::Consistency(ConsistencyError::TurnBetweenPoses {
            earlier_pose, pose, ..
        }) => assert_eq!((earlier_pose, pose), (1, 2)),
        other => panic!("{other}"),
    }
}

#[test]
fn a_hand_held_board_at_right_angles_has_the_same_labels_in_both_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let poses = [
        [0.0, 20.0, 0.0],
        [90.0, -20.0, 5.0],
        [180.0, 0.0, 30.0],
        [268.0, 10.0, -30.0],
    ];
    let cameras = pair(&board(7, 9), &poses, 0.0);
    let found = detect(&dataset(folder.path(), board(7, 9), false, &cameras)).unwrap();
    let sides = sides(&found, &cameras);
    assert_eq!(sides[..4], sides[4..]);
    assert!(sides.iter().all(|&s| s != 0));
}

#[test]
fn a_square_even_board_is_followed_through_small_turns() {
    let folder = tempfile::tempdir().unwrap();
    let poses: Vec<[f64; 3]> = (0..7)
        .map(|k| [25.0 * f64::from(k), 15.0, 5.0 * f64::from(k)])
        .collect();
    let cameras = pair(&board(8, 8), &poses, 0.0);
    let found = detect(&dataset(folder.path(), board(8, 8), true, &cameras)).unwrap();
    assert_eq!(sides(&found, &cameras), vec![1; 14]);
}

#[test]
fn a_part_without_borders_is_placed_by_its_neighbors_on_the_stage() {
    let folder = tempfile::tempdir().unwrap();
    let poses: Vec<[f64; 3]> = (0..4).map(|k| [0.0, 5.0 * f64::from(k), 10.0]).collect();
    let mut cameras = pair(&board(7, 9), &poses, 0.0);
    // Only the middle of the board is left in one pose of the first camera.
    let photo = &mut cameras[0][2];
    let (a, b) = (photo.true_corner(1, 1), photo.true_corner(5, 7));
    photo.covers = vec![
        ([0.0, 0.0, a.u - 10.0, 480.0], 60.0),
        ([b.u + 10.0, 0.0, 640.0, 480.0], 60.0),
        ([0.0, 0.0, 640.0, a.v - 12.0], 60.0),
        ([0.0, b.v + 12.0, 640.0, 480.0], 60.0),
    ];
    let found = detect(&dataset(folder.path(), board(7, 9), true, &cameras)).unwrap();
    assert_eq!(sides(&found, &cameras), vec![1; 8]);
    assert!(found.views[2].corners.len() < 40);
    // A free board may have moved by a square between the images: nobody knows.
    let free = dataset(folder.path(), board(7, 9), false, &cameras[..1]);
    let found = detect(&free).unwrap();
    assert_eq!(found.views.len(), 3);
    assert!(matches!(
        found.images[2].outcome,
        Outcome::Refused(Refusal::AmbiguousPlacement { .. })
    ));
}

#[test]
fn a_mirror_before_one_camera_shows_in_the_pair_check() {
    let folder = tempfile::tempdir().unwrap();
    let poses = [
        [0.0, 20.0, 0.0],
        [20.0, -20.0, 5.0],
        [-15.0, 0.0, 30.0],
        [3.0, 10.0, -30.0],
    ];
    let mut cameras = pair(&board(6, 9), &poses, 0.0);
    let straight = detect(&dataset(folder.path(), board(6, 9), false, &cameras)).unwrap();
    assert!(straight.pair_checks[0].median_px < 0.1);
    for photo in &mut cameras[1] {
        photo.mirrored = true;
    }
    let mirrored = detect(&dataset(folder.path(), board(6, 9), false, &cameras)).unwrap();
    assert!(
        mirrored.pair_checks[0].median_px > 1.0,
        "{:?}",
        mirrored.pair_checks
    );
}

#[test]
fn excluded_poses_are_not_looked_at_and_missing_images_leave_gaps() {
    let folder = tempfile::tempdir().unwrap();
    let poses = [[0.0, 20.0, 0.0], [10.0, -20.0, 5.0], [-5.0, 0.0, 30.0]];
    let cameras = pair(&board(6, 9), &poses, 0.0);
    let mut set = dataset(folder.path(), board(6, 9), false, &cameras);
    set.excluded_poses.insert(0);
    set.cameras[1].images[1] = None;
    let found = detect(&set).unwrap();
    let seen: Vec<(usize, usize)> = found.views.iter().map(|v| (v.camera_idx, v.pose)).collect();
    assert_eq!(seen, vec![(0, 1), (0, 2), (1, 2)]);
    assert_eq!(found.images.len(), 3);
}
