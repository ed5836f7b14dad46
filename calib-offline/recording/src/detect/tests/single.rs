//! One image: labels, parts of boards, refusals.

use super::*;
use calib_rays::remedy::Remedy;

fn only(photo: Photo) -> Detection {
    let folder = tempfile::tempdir().unwrap();
    let board = photo.board.clone();
    detect(&dataset(folder.path(), board, false, &[vec![photo]])).unwrap()
}

fn refusal(board: BoardSpec, photo: Photo) -> Refusal {
    let folder = tempfile::tempdir().unwrap();
    let found = detect(&dataset(folder.path(), board, false, &[vec![photo]])).unwrap();
    assert!(found.views.is_empty());
    match found.images.into_iter().next().unwrap().outcome {
        Outcome::Refused(refusal) => refusal,
        used @ Outcome::Used { .. } => panic!("not refused: {used:?}"),
    }
}

#[test]
fn every_turn_of_an_odd_by_even_board_gives_the_same_labels() {
    for turn in [0.0, 50.0, 90.0, 140.0, 180.0, -90.0] {
        let photo = tilted(board(6, 9), turn, [10.0, -20.0], 0.0, 0.0);
        let found = only(photo.clone());
        assert_eq!(found.views[0].corners.len(), 54, "turn {turn}");
        assert!(worst_px(&found.views[0], &photo) < 0.1, "turn {turn}");
    }
}

#[test]
fn rows_and_columns_exchanged_number_the_same_board_the_other_way() {
    // 9 x 6 written for a 6 x 9 board is the same board turned by 90 degrees.
    let photo = tilted(board(6, 9), 0.0, [10.0, -20.0], 0.0, 0.0);
    let folder = tempfile::tempdir().unwrap();
    let found = detect(&dataset(
        folder.path(),
        board(9, 6),
        false,
        &[vec![photo.clone()]],
    ))
    .unwrap();
    let view = &found.views[0];
    assert_eq!(view.corners.len(), 54);
    for corner in &view.corners {
        let nearest = photo.true_corner(corner.col, 8 - corner.row);
        let half_turned = photo.true_corner(5 - corner.col, corner.row);
        let off = nearest
            .distance_px(corner.pixel)
            .min(half_turned.distance_px(corner.pixel));
        assert!(off < 0.1);
    }
}

#[test]
fn a_square_odd_board_is_decided_by_its_colors_up_to_half_a_turn() {
    for turn in [0.0, 90.0] {
        let photo = tilted(board(7, 7), turn, [10.0, -20.0], 0.0, 0.0);
        let found = only(photo.clone());
        let view = &found.views[0];
        let off = worst_px(view, &photo).min(worst_half_turned_px(view, &photo));
        assert!(off < 0.1, "turn {turn}: {off}");
    }
}

#[test]
fn a_board_cut_by_the_image_is_placed_by_the_borders_that_are_seen() {
    for (right_mm, down_mm) in [(100.0, 0.0), (-100.0, 0.0), (0.0, 85.0), (95.0, -80.0)] {
        let photo = tilted(board(8, 11), 4.0, [12.0, 15.0], right_mm, down_mm);
        let found = only(photo.clone());
        let view = &found.views[0];
        assert!(view.corners.len() < 88 && view.corners.len() > 30);
        let worst_px = worst_px(view, &photo);
        // Corners at the cut have half a window, blurred by pixels that the renderer repeats there.
        assert!(worst_px < 0.25, "{right_mm} {down_mm}: {worst_px}");
    }
}

#[test]
fn a_covered_corner_of_the_board_is_missing_and_the_others_keep_their_labels() {
    let mut photo = tilted(board(6, 9), 0.0, [10.0, -20.0], 0.0, 0.0);
    let hidden = photo.true_corner(0, 0);
    photo.covers = vec![([0.0, 0.0, hidden.u + 30.0, hidden.v + 30.0], 140.0)];
    let found = only(photo.clone());
    let view = &found.views[0];
    assert!(
        (44..54).contains(&view.corners.len()),
        "{}",
        view.corners.len()
    );
    assert!(view.corners.iter().all(|c| (c.row, c.col) != (0, 0)));
    assert!(worst_px(view, &photo) < 0.1);
    assert!(matches!(
        found.images[0].outcome,
        Outcome::Used { partial: true, .. }
    ));
}

#[test]
fn a_part_without_borders_is_refused_and_not_guessed() {
    // The board is larger than the image on all sides.
    let photo = tilted(board(30, 41), 0.0, [10.0, -20.0], 0.0, 0.0);
    let refused = refusal(photo.board.clone(), photo);
    assert!(
        matches!(refused, Refusal::AmbiguousPlacement { placement_count, .. } if placement_count > 2),
        "{refused:?}"
    );
    assert!(refused.to_string().contains("border"));
}

#[test]
fn a_cover_across_the_board_is_not_taken_for_its_border() {
    for value in [30.0, 100.0, 220.0] {
        let mut photo = tilted(board(8, 11), 8.0, [5.0, 5.0], 0.0, 0.0);
        let until = photo.true_corner(3, 2).u + 9.0;
        photo.covers = vec![([0.0, 0.0, until, 480.0], value)];
        let found = only(photo.clone());
        // The right border is seen, so the labels follow from there.
        assert_eq!(found.views.len(), 1, "cover {value}: {:?}", found.images);
        assert!(worst_px(&found.views[0], &photo) < 0.1, "cover {value}");
        photo
            .covers
            .push(([photo.true_corner(3, 9).u - 9.0, 0.0, 640.0, 480.0], value));
        let refused = refusal(photo.board.clone(), photo);
        assert!(
            matches!(refused, Refusal::AmbiguousPlacement { .. }),
            "cover {value}: {refused:?}"
        );
    }
}

#[test]
fn squares_counted_for_corners_are_named() {
    let photo = tilted(board(6, 9), 0.0, [10.0, -20.0], 0.0, 0.0);
    let message = refusal(board(7, 10), photo.clone()).to_string();
    for part in ["6 x 9", "not squares", "rows = 6", "cols = 9"] {
        assert!(message.contains(part), "{message}");
    }
    let message = refusal(board(5, 8), photo).to_string();
    assert!(message.contains("rows = 6, cols = 9"), "{message}");
}

#[test]
fn images_without_a_board_say_why() {
    let mut photo = tilted(board(6, 9), 0.0, [10.0, -20.0], 0.0, 0.0);
    photo.levels = [30.0, 33.0, 32.0];
    assert!(matches!(
        refusal(photo.board.clone(), photo.clone()),
        Refusal::Illegible(Illegible::LowContrast { .. })
    ));
    photo.levels = [100.0, 100.0, 100.0];
    photo.noise = 25.0;
    assert!(matches!(
        refusal(photo.board.clone(), photo.clone()),
        Refusal::NoBoard { kind: "chessboard" }
    ));
    photo = tilted(board(6, 9), 0.0, [10.0, -20.0], 0.0, 0.0);
    photo.blur_px = 14.0;
    let refused = refusal(photo.board.clone(), photo);
    assert!(
        matches!(refused, Refusal::Illegible(Illegible::Blurred { .. })),
        "{refused:?}"
    );
}

#[test]
fn a_dim_board_is_found_as_well_as_a_bright_one() {
    let mut photo = tilted(board(6, 9), 0.0, [10.0, -20.0], 0.0, 0.0);
    photo.levels = [4.0, 24.0, 12.0];
    photo.noise = 0.5;
    let found = only(photo.clone());
    assert_eq!(found.views[0].corners.len(), 54);
    assert!(worst_px(&found.views[0], &photo) < 0.2);
}

#[test]
fn a_blurred_board_is_found_in_the_smaller_image() {
    let mut photo = tilted(board(6, 9), 0.0, [10.0, -20.0], 0.0, 0.0);
    photo.blur_px = 5.0;
    let found = only(photo.clone());
    assert_eq!(found.views[0].corners.len(), 54);
    assert!(worst_px(&found.views[0], &photo) < 0.2);
    assert!(found.images[0].figures.unwrap().edge_px > 10.0);
}

#[test]
fn a_mirrored_image_is_numbered_right_handed() {
    let mut photo = tilted(board(6, 9), 0.0, [10.0, -20.0], 0.0, 0.0);
    photo.mirrored = true;
    let found = only(photo);
    let at = |row, col| {
        let label = |c: &&Corner| (c.row, c.col) == (row, col);
        found.views[0].corners.iter().find(label).unwrap().pixel
    };
    let (origin, x, y) = (at(0, 0), at(0, 8), at(5, 0));
    let cross = (x.u - origin.u) * (y.v - origin.v) - (x.v - origin.v) * (y.u - origin.u);
    assert!(cross > 0.0);
}

#[test]
fn an_image_of_another_size_or_no_image_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let photo = tilted(board(6, 9), 0.0, [0.0, 0.0], 0.0, 0.0);
    let mut set = dataset(
        folder.path(),
        photo.board.clone(),
        false,
        &[vec![photo.clone(), photo]],
    );
    set.cameras[0].sensor = SensorSize::new(1280, 480);
    std::fs::write(folder.path().join("0_1.png"), b"no image").unwrap();
    match detect(&set).unwrap_err() {
        DetectError::WrongSizes { images, are_all } => {
            // The file that is none has no size; loading names it.
            assert_eq!((images.len(), are_all), (1, false));
            assert_eq!((images[0].pose, images[0].file.as_str()), (0, "0_0.png"));
        }
        other => panic!("{other}"),
    }
    set.cameras[0].sensor = SENSOR;
    match detect(&set).unwrap_err() {
        DetectError::BrokenImage {
            pose, more, source, ..
        } => {
            assert_eq!((pose, more), (1, 0));
            assert!(source.to_string().contains("0_1.png"));
        }
        other => panic!("{other}"),
    }
    set.cameras.clear();
    assert!(matches!(detect(&set).unwrap_err(), DetectError::NoImages));
}

#[test]
fn every_image_of_another_size_is_named_before_any_is_searched() {
    let folder = tempfile::tempdir().unwrap();
    let photo = tilted(board(6, 9), 0.0, [0.0, 0.0], 0.0, 0.0);
    let photos = vec![photo.clone(), photo.clone(), photo];
    let set = dataset(folder.path(), board(6, 9), false, &[photos]);
    for pose in [0, 2] {
        let odd = image::GrayImage::new(641, 481);
        odd.save(folder.path().join(format!("0_{pose}.png")))
            .unwrap();
    }
    let error = detect(&set).unwrap_err();
    for part in ["0_0.png", "0_2.png", "641x481", "640x480"] {
        assert!(error.to_string().contains(part), "{error}");
    }
    let remedy = error.remedy().unwrap();
    assert!(remedy.contains("exclude = [0, 2]"), "{remedy}");
}

#[test]
fn several_whole_boards_of_another_size_stop_the_search() {
    let folder = tempfile::tempdir().unwrap();
    let photos: Vec<Photo> = [[10.0, 15.0], [-15.0, 5.0], [5.0, -20.0]]
        .map(|tilt| tilted(board(6, 9), 4.0, tilt, 0.0, 0.0))
        .into();
    let set = dataset(folder.path(), board(7, 10), false, &[photos]);
    let error = detect(&set).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("3 of 3 images show a whole board of 6 x 9"),
        "{error}"
    );
    assert!(error.remedy().unwrap().contains("rows = 6, cols = 9"));
}
