use super::*;
use crate::dataset::{BoardKind, CameraSpec, StageSpec};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::SensorSize;
use calib_rays::observed::poses;
use calib_rays::remedy::Remedy as _;
use std::collections::BTreeSet;

fn dataset() -> Dataset {
    Dataset {
        folder: "set".into(),
        kind: BoardKind::Chessboard,
        board: BoardSpec::chessboard(15, 13, 10.0),
        cameras: ["left", "right"]
            .map(|name| CameraSpec {
                name: name.to_owned(),
                sensor: SensorSize::new(1280, 1024),
                images: Vec::new(),
                optics: None,
                serial: None,
            })
            .into(),
        stage: None,
        known_poses: [].into(),
        known_poses_file: None,
        excluded_poses: BTreeSet::new(),
        target: None,
        certificate: None,
        recording: None,
    }
}

fn parse(rows: &str) -> Result<Vec<View>, CornersError> {
    parse_corners(
        &dataset(),
        Path::new("set/corners.csv"),
        &format!("{HEADER}\n{rows}"),
    )
}

/// The error of these rows: message and remedy.
fn refused(rows: &str) -> String {
    let error = parse(rows).expect_err(rows);
    let remedy = error.remedy().expect("every error has a remedy");
    format!("{error}\n{remedy}")
}

fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

#[test]
fn views_come_by_pose_then_camera_and_corners_by_row_and_column() {
    let views = parse(
        "right,1000,1,0,5,6\nleft,1003,0,1,3,4\nright,1000,0,12,1.5,2.5\nleft,1000,14,0,7,8\n\n",
    )
    .unwrap();
    let order: Vec<_> = views.iter().map(|v| (v.pose, v.camera_idx)).collect();
    assert_eq!(order, [(1000, 0), (1000, 1), (1003, 0)]);
    let corners: Vec<_> = views[1].corners.iter().map(|c| (c.row, c.col)).collect();
    assert_eq!(corners, [(0, 12), (1, 0)]);
    assert_eq!(views[1].corners[0].pixel, PixelPoint::new(1.5, 2.5));
}

#[test]
fn what_is_written_reads_back_to_the_same_bits() {
    let numbers = [
        0.1 + 0.2,
        -0.49999999999999994,
        1e-300,
        1023.0000000000001,
        std::f64::consts::PI,
    ];
    for sigma in [None, Some(0.05), Some(f64::MIN_POSITIVE)] {
        let views: Vec<View> = (0..2)
            .map(|camera_idx| View {
                camera_idx,
                pose: 1003,
                corners: numbers
                    .iter()
                    .enumerate()
                    .map(|(col, u)| Corner {
                        row: 3,
                        col,
                        pixel: PixelPoint::new(*u, 7.0 / 3.0),
                        // One corner without a noise of its own among others with one.
                        sigma_px: if col == 2 { None } else { sigma },
                    })
                    .collect(),
            })
            .collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("corners.csv");
        write_corners(&path, &dataset(), &views).unwrap();
        assert_eq!(read_corners(&dataset(), &path).unwrap(), views);
    }
}

#[test]
fn windows_line_ends_and_a_byte_order_mark_are_read() {
    let text = format!("\u{feff}{HEADER_WITH_SIGMA}\r\nleft,0,0,0,1,2,0.5\r\nleft,0,0,1,2,2,\r\n");
    let views = parse_corners(&dataset(), Path::new("c"), &text).unwrap();
    assert_eq!(views[0].corners[0].sigma_px, Some(0.5));
    assert_eq!(views[0].corners[1].sigma_px, None);
}

#[test]
fn unknown_camera() {
    let message = refused("left,0,0,0,1,1\nmiddle,0,0,0,1,1\n");
    assert_says(
        &message,
        &["corners.csv:3:", "middle", "left, right", "[[camera]]"],
    );
}

#[test]
fn duplicate_corner_names_both_lines() {
    let message = refused("left,2,0,0,1,1\nleft,2,0,1,1,1\nleft,2,0,0,1,1\n");
    assert_says(
        &message,
        &["corners.csv:4:", "line 2", "pose 2", "row 0, col 0"],
    );
}

#[test]
fn corner_off_the_board() {
    // Reaches row 12, col 14: fits the board with rows and columns swapped.
    let message = refused("left,0,12,3,1,1\nleft,0,3,14,1,1\n");
    assert_says(
        &message,
        &[
            "corners.csv:3:",
            "row 3, col 14",
            "rows and columns swapped?",
            "rows = 13, cols = 15",
        ],
    );
    // Reaches row 15, col 13: does not.
    let message = refused("left,0,15,13,1,1\n");
    assert_says(
        &message,
        &["corners.csv:2:", "inner corners", "rows = 16, cols = 14"],
    );
    assert!(!message.contains("swapped"));
}

#[test]
fn pixels_that_are_not_finite() {
    for text in ["nan", "NaN", "inf", "-inf"] {
        let message = refused(&format!("left,0,0,0,1,1\nleft,0,0,1,{text},1\n"));
        assert_says(&message, &["corners.csv:3:", "u is", "finite"]);
        assert_says(
            &refused(&format!("left,0,0,1,1,{text}\n")),
            &["corners.csv:2:", "v is"],
        );
    }
}

#[test]
fn pixels_off_the_sensor_speak_of_the_image_size() {
    let message = refused("left,0,0,0,1,1\nleft,0,0,1,1279.5,2\nleft,0,0,2,1500,1020\n");
    assert_says(
        &message,
        &[
            "corners.csv:4:",
            "(1500, 1020)",
            "1280x1024",
            "image size in dataset.toml does not fit",
        ],
    );
    let message = refused("left,0,0,0,1,1\nleft,0,0,1,1000,1100\n");
    assert_says(&message, &["corners.csv:3:", "width and height swapped?"]);
}

#[test]
fn fields_that_are_no_numbers() {
    assert_says(
        &refused("left,0,0,0,1\n"),
        &["corners.csv:2:", "5 fields", "header has 6"],
    );
    assert_says(
        &refused("left,0,0,0,1,5,1,5\n"),
        &["corners.csv:2:", "8 fields", "not commas"],
    );
    assert_says(
        &refused("left,-1,0,0,1,1\n"),
        &["corners.csv:2:", "pose is \"-1\"", "count from 0"],
    );
    assert_says(
        &refused("left,0,1.5,0,1,1\n"),
        &["corners.csv:2:", "row is \"1.5\""],
    );
    assert_says(
        &refused("left,0,0,,1,1\n"),
        &["corners.csv:2:", "col is \"\""],
    );
    assert_says(
        &refused("left,0,0,0,x,1\n"),
        &["corners.csv:2:", "u is \"x\""],
    );
}

#[test]
fn a_noise_must_be_above_zero() {
    for sigma in ["0", "-1", "nan", "inf"] {
        let text = format!("{HEADER_WITH_SIGMA}\nleft,0,0,0,1,1,{sigma}\n");
        let error = parse_corners(&dataset(), Path::new("corners.csv"), &text).unwrap_err();
        assert_says(&error.to_string(), &["corners.csv:2:", "sigma_px"]);
    }
}

#[test]
fn wrong_header() {
    let refused = |text: &str| {
        let error = parse_corners(&dataset(), Path::new("corners.csv"), text).unwrap_err();
        format!("{error}\n{}", error.remedy().unwrap())
    };
    assert_says(
        &refused("pose,camera,row,col,u,v\n"),
        &["corners.csv:1:", HEADER],
    );
    assert_says(
        &refused("left,0,0,0,1,1\n"),
        &["corners.csv:1:", "names the columns"],
    );
    assert_says(
        &refused("camera;pose;row;col;u;v\n"),
        &["corners.csv:1:", "with commas"],
    );
}

#[test]
fn empty_and_binary_files() {
    for text in ["", "\n\n", &format!("{HEADER}\n"), HEADER] {
        let error = parse_corners(&dataset(), Path::new("corners.csv"), text).unwrap_err();
        assert!(
            matches!(error, CornersError::Empty { .. }),
            "{text:?}: {error}"
        );
        assert_says(&error.remedy().unwrap(), &["detect"]);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("corners.csv");
    std::fs::write(&path, b"camera,pose,row,col,u,v\nleft\x80\xff\x00,1\n").unwrap();
    let error = read_corners(&dataset(), &path).unwrap_err();
    assert!(matches!(error, CornersError::NotText { line: 2, .. }));
    // A picture under that name.
    std::fs::write(&path, b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR").unwrap();
    assert!(read_corners(&dataset(), &path).is_err());
}

#[test]
fn stage_lists_are_checked_against_the_poses() {
    let folder = tempfile::tempdir().unwrap();
    let mut dataset = dataset();
    dataset.folder = folder.path().to_owned();
    assert_eq!(load_corners(&dataset).unwrap(), None);
    std::fs::write(
        dataset.corners_path(),
        format!("{HEADER}\nleft,1000,0,0,1,1\nleft,1003,0,0,1,1\n"),
    )
    .unwrap();
    let mut with_angles = |count: usize| {
        dataset.stage = Some(StageSpec {
            angles_deg: Some((0..count).map(|k| 3.0 * k as f64).collect()),
            placement: None,
        });
        load_corners(&dataset).map(|views| {
            let poses = poses(&views.unwrap());
            crate::dataset::stage::entry(&dataset, &poses, 1003).angle_deg
        })
    };
    assert_eq!(with_angles(2).unwrap(), Some(3.0));
    assert_eq!(with_angles(1004).unwrap(), Some(3009.0));
    let error = with_angles(3).unwrap_err();
    assert_says(
        &error.to_string(),
        &[
            "dataset.toml",
            "angles_deg has 3",
            "2 poses",
            "1000 to 1003",
        ],
    );
}
