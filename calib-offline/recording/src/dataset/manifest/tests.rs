use super::*;
use crate::dataset::ExpectedOptics;
use calib_rays::remedy::Remedy as _;
use std::fs;

const BOARD: &str = "[board]\nkind = \"chessboard\"\nrows = 15\ncols = 13\nsquare_mm = 10.0\n";

/// A folder with two images per camera and this manifest.
fn folder(manifest: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for camera in ["left", "right"] {
        fs::create_dir(folder.path().join(camera)).unwrap();
        for image in ["10.png", "2.png"] {
            fs::write(folder.path().join(camera).join(image), "").unwrap();
        }
    }
    fs::write(folder.path().join("dataset.toml"), manifest).unwrap();
    folder
}

fn camera(name: &str) -> String {
    format!(
        "[[camera]]\nname = \"{name}\"\nwidth = 1280\nheight = 1024\nimages = \"{name}/*.png\"\n"
    )
}

fn good() -> String {
    format!("{BOARD}{}{}", camera("left"), camera("right"))
}

/// The error of this manifest: message with its remedy, and where it must point.
fn refused(manifest: &str) -> String {
    let folder = folder(manifest);
    let error = Dataset::load(folder.path()).expect_err(manifest);
    let remedy = error.remedy().expect("every error has a remedy");
    let message = error.to_string();
    assert!(message.contains("dataset.toml"), "names no file: {message}");
    format!("{message}\n{remedy}")
}

/// The error of the good manifest with one text replaced.
fn refused_with(from: &str, to: &str) -> String {
    let manifest = good();
    assert!(manifest.contains(from));
    refused(&manifest.replacen(from, to, 1))
}

fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in: {message}");
    }
}

#[test]
fn a_good_manifest_is_read_with_images_in_natural_order() {
    let manifest = format!(
        "{}[dataset]\nexclude = [1]\n[stage]\nangles_deg = [-2, 0.5]\nplacement = [0, 1]\n",
        good()
    );
    let folder = folder(&manifest);
    for path in [folder.path().to_owned(), folder.path().join("dataset.toml")] {
        let dataset = Dataset::load(&path).unwrap();
        assert_eq!((dataset.board.rows, dataset.board.cols), (15, 13));
        assert_eq!(dataset.cameras[1].name, "right");
        assert_eq!(dataset.cameras[1].sensor, SensorSize::new(1280, 1024));
        let left = folder.path().join("left");
        assert_eq!(
            dataset.cameras[0].images,
            [Some(left.join("2.png")), Some(left.join("10.png"))]
        );
        let stage = dataset.stage.unwrap();
        assert_eq!(stage.angles_deg, Some(vec![-2.0, 0.5]));
        assert_eq!(stage.placement, Some(vec![0, 1]));
        assert_eq!(dataset.excluded_poses, BTreeSet::from([1]));
    }
}

#[test]
fn square_size_that_is_no_length() {
    let message = refused_with("square_mm = 10.0\n", "");
    assert_says(
        &message,
        &[
            "dataset.toml:1:",
            "no default",
            "sets the scale of every result",
        ],
    );
    for (value, problem) in [
        ("0.0", "zero"),
        ("-10", "negative"),
        ("nan", "not a number"),
        ("inf", "infinite"),
    ] {
        let message = refused_with("square_mm = 10.0", &format!("square_mm = {value}"));
        assert_says(&message, &["dataset.toml:5:", problem, "square_mm = 10.0"]);
    }
    let message = refused_with("square_mm = 10.0", "square_mm = \"10 mm\"");
    assert_says(&message, &["dataset.toml:5:"]);
}

#[test]
fn unknown_keys_name_their_line() {
    assert_says(
        &refused_with("square_mm", "sqare_mm"),
        &["dataset.toml:5:", "sqare_mm", "square_mm"],
    );
    assert_says(
        &refused_with("[board]", "[bord]"),
        &["dataset.toml:1:", "bord"],
    );
    assert_says(
        &refused_with("width", "widht"),
        &["dataset.toml:8:", "widht"],
    );
    assert_says(
        &refused(&format!("{}[stage]\nangles = [1]\n", good())),
        &["dataset.toml:17:", "angles_deg"],
    );
    assert_says(
        &refused(&format!("exclude = [1]\n{}", good())),
        &["dataset.toml:1:", "exclude", "[dataset]"],
    );
}

#[test]
fn broken_toml_names_its_line() {
    assert_says(&refused("[board]\nrows = = 3\n"), &["dataset.toml:2:"]);
    assert_says(&refused(""), &["dataset.toml:1:", "[board] is missing"]);
}

#[test]
fn board_sizes_that_cannot_be() {
    assert_says(
        &refused_with("rows = 15", "rows = 2"),
        &["dataset.toml:3:", "[board] rows = 2", "inner corners"],
    );
    assert_says(
        &refused_with("cols = 13", "cols = -13"),
        &["dataset.toml:4:", "cols = -13"],
    );
    assert_says(
        &refused_with("cols = 13", "cols = 13.5"),
        &["dataset.toml:4:"],
    );
    assert_says(
        &refused_with("rows = 15\n", ""),
        &["dataset.toml:1:", "[board] rows is missing"],
    );
    assert_says(
        &refused_with("chessboard", "checkers"),
        &["dataset.toml:2:", "checkers", "kind = \"chessboard\""],
    );
}

#[test]
fn cameras_that_cannot_be() {
    assert_says(&refused(BOARD), &["[[camera]] is missing"]);
    assert_says(
        &refused(&format!("{BOARD}{}{}", camera("left"), camera("left"))),
        &["dataset.toml:12:", "\"left\"", "line 7", "own name"],
    );
    assert_says(
        &refused_with("name = \"left\"", "name = \"a,b\""),
        &["dataset.toml:7:", "a,b"],
    );
    assert_says(
        &refused_with("name = \"left\"", "name = \"\""),
        &["dataset.toml:7:"],
    );
    assert_says(
        &refused_with("name = \"left\"\n", ""),
        &["dataset.toml:6:", "name is missing"],
    );
    assert_says(
        &refused_with("width = 1280", "width = 0"),
        &["dataset.toml:8:", "width = 0"],
    );
    assert_says(
        &refused_with("height = 1024\n", ""),
        &["dataset.toml:6:", "height is missing"],
    );
}

#[test]
fn images_that_are_not_there() {
    assert_says(
        &refused_with("left/*.png", "left/*.PNG"),
        &["dataset.toml:10:", "left/*.PNG", "upper and lower case"],
    );
    assert_says(
        &refused_with("left/*.png", "lift/*.png"),
        &["dataset.toml:10:", "lift"],
    );
    assert_says(
        &refused_with("left/*.png", "*/a.png"),
        &["dataset.toml:10:", "file name only"],
    );
    assert_says(
        &refused_with("images = \"left/*.png\"\n", ""),
        &["dataset.toml:7:", "\"left\"", "corners.csv"],
    );
    assert_says(
        &refused_with("left/*.png", "right/*.png"),
        &["used twice", "\"left\"", "\"right\""],
    );
    let list = "image_list = [\"left/2.png\", \"left/3.png\"]";
    assert_says(
        &refused_with("images = \"left/*.png\"", list),
        &["dataset.toml:10:", "pose 1", "left/3.png"],
    );
    assert_says(
        &refused_with("images = \"left/*.png\"", "image_list = [\"\", \"\"]"),
        &["dataset.toml:10:"],
    );
    assert_says(
        &refused_with(
            "images = \"left/*.png\"",
            "images = \"left/*.png\"\nimage_list = [\"left/2.png\"]",
        ),
        &["dataset.toml:11:", "both"],
    );
}

#[test]
fn unequal_numbers_of_images_tell_of_image_list() {
    let message = refused_with("left/*.png", "left/2*.png");
    assert_says(
        &message,
        &[
            "dataset.toml:12:",
            "\"left\" has 1",
            "\"right\" has 2",
            "image_list = [",
        ],
    );
    // And the remedy works.
    let manifest = good().replacen(
        "images = \"left/*.png\"",
        "image_list = [\"\", \"left/2.png\"]",
        1,
    );
    let folder = folder(&manifest);
    let dataset = Dataset::load(folder.path()).unwrap();
    assert_eq!(dataset.cameras[0].images[0], None);
    assert_eq!(dataset.image_pose_count(), 2);
}

#[test]
fn stage_lists_of_the_wrong_length() {
    let with_stage = |stage: &str| refused(&format!("{}[stage]\n{stage}\n", good()));
    assert_says(
        &with_stage("angles_deg = [1.0]"),
        &["dataset.toml:17:", "angles_deg has 1", "2 poses"],
    );
    assert_says(
        &with_stage("placement = [0, 0, 1]"),
        &["dataset.toml:17:", "placement has 3"],
    );
    assert_says(
        &with_stage("angles_deg = [1.0, nan]"),
        &["dataset.toml:17:", "entry 1"],
    );
}

#[test]
fn an_excluded_pose_must_exist() {
    let message = refused(&format!("{}[dataset]\nexclude = [0, 2]\n", good()));
    assert_says(&message, &["dataset.toml:17:", "pose 2", "0 to 1"]);
}

#[test]
fn corners_make_images_unnecessary() {
    let folder = folder(&good().replace("left/*.png", "nowhere/*.png"));
    fs::write(folder.path().join("corners.csv"), "").unwrap();
    let dataset = Dataset::load(folder.path()).unwrap();
    assert!(dataset.cameras[0].images.is_empty());
}

#[test]
fn a_folder_without_a_manifest_and_a_binary_one() {
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path().to_owned(), folder.path().join("nowhere")] {
        let error = Dataset::load(&path).unwrap_err();
        assert!(matches!(error, ManifestError::NotFound { .. }));
        assert_says(&error.to_string(), &["dataset.toml"]);
    }
    let file = folder.path().join("dataset.toml");
    fs::write(&file, b"[board]\n\xff\xfe\x00").unwrap();
    let error = Dataset::load(folder.path()).unwrap_err();
    assert!(matches!(error, ManifestError::NotText { byte: 8, .. }));
}

#[test]
fn the_mark_before_the_text_and_other_line_ends_do_not_matter() {
    let text = format!("\u{feff}{}", good().replace('\n', "\r\n"));
    let folder = folder(&text);
    assert_eq!(Dataset::load(folder.path()).unwrap().cameras.len(), 2);
}

#[test]
fn what_is_declared_is_read_and_checked() {
    let declared = good()
        .replacen("[[camera]]\n", "[board.certificate]\nscale_ppm_sd = 20.0\n[[camera]]\noptics = \"mirror\"\nserial = \"SN 7\"\n", 1)
        + "[recording]\nname = \"line 3\"\ndate = \"2026-11-30\"\n";
    let folder = folder(&declared);
    let dataset = Dataset::load(folder.path()).unwrap();
    assert_eq!(dataset.cameras[0].optics, Some(ExpectedOptics::Mirror));
    assert_eq!(dataset.cameras[0].serial.as_deref(), Some("SN 7"));
    assert_eq!(dataset.cameras[1].optics, None);
    assert_eq!(dataset.certificate.unwrap().scale_ppm_sd, Some(20.0));
    assert_eq!(dataset.recording.unwrap().name.as_deref(), Some("line 3"));

    assert_eq!(dataset.board.square_mm, 10.0);

    let with = |from: &str, to: &str| refused(&declared.replace(from, to));
    assert_says(&with("20.0", "-1.0"), &["scale_ppm_sd = -1"]);
    assert_says(&with("2026-11-30", "30.11."), &["date = \"30.11.\""]);
    assert_says(
        &with("\"mirror\"", "\"miror\""),
        &["unknown variant", "mirror"],
    );
    assert_says(&with("scale_ppm_sd", "scale_sd"), &["unknown field"]);
}

fn with_board(board: &str) -> String {
    format!("[board]\n{board}\n{}", camera("left"))
}

#[test]
fn printed_targets_are_read_with_their_places() {
    let read = |board: &str| {
        let folder = folder(&with_board(board));
        let dataset = Dataset::load(folder.path()).unwrap();
        (dataset.kind, dataset.board)
    };
    let (kind, board) =
        read("kind = \"aprilgrid\"\nrows = 2\ncols = 3\ntag_mm = 40\nspacing = 0.25\nfirst_id = 4");
    assert!(matches!(kind, BoardKind::AprilGrid(grid) if grid.first_id == 4));
    assert_eq!((board.rows, board.cols), (4, 6));
    let place = board.corner_in_board(3, 2);
    assert_eq!((place.x, place.y, place.z), (50.0, 90.0, 0.0));
    assert_eq!(board.extent_mm(), (140.0, 90.0));
    let (_, board) = read(
        "kind = \"circles\"\nrows = 5\ncols = 4\npitch_mm = 7\ndiameter_mm = 5\nasymmetric = true",
    );
    let place = board.corner_in_board(1, 2);
    assert_eq!((place.x, place.y), (35.0, 7.0));
    // As warm as it was: 100 ppm longer.
    let (kind, board) = read(
        "kind = \"charuco\"\nrows = 5\ncols = 4\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_50\"\n\
         [board.certificate]\nexpansion_ppm_per_k = 10\ncalibrated_at_c = 20\nused_at_c = 30",
    );
    assert!(matches!(kind, BoardKind::Charuco(board) if board.marker_mm == 15.0015));
    assert_eq!(board.square_mm, 20.002);
    let (kind, _) = read(
        "kind = \"chessboard\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarked = [[0, 0], [5, 6]]",
    );
    assert_eq!(kind, BoardKind::MarkedChessboard(vec![(0, 0), (5, 6)]));
}

#[test]
fn printed_targets_that_cannot_be() {
    let says = |board: &str, parts: &[&str]| assert_says(&refused(&with_board(board)), parts);
    let charuco = "kind = \"charuco\"\nrows = 5\ncols = 4\nsquare_mm = 20\n";
    says(charuco, &["marker_mm", "missing"]);
    says(
        &format!("{charuco}marker_mm = 20\ndictionary = \"DICT_4X4_50\""),
        &["marker_mm = 20", "square_mm = 20"],
    );
    says(
        &format!("{charuco}marker_mm = 15\ndictionary = \"4X4\""),
        &["\"4X4\""],
    );
    // 30 squares have 15 markers.
    says(
        &format!("{charuco}marker_mm = 15\ndictionary = \"DICT_4X4_50\"\nfirst_id = 36"),
        &["36 to 50", "DICT_4X4_50 ends at 49"],
    );
    says(
        &format!("{charuco}marker_mm = 15\ndictionary = \"DICT_4X4_50\"\nspacing = 0.3"),
        &["spacing", "charuco"],
    );
    let circles = "kind = \"circles\"\nrows = 5\ncols = 4\npitch_mm = 7\n";
    says(&format!("{circles}diameter_mm = 8"), &["diameter_mm = 8"]);
    says(
        &format!("{circles}diameter_mm = 5\ndirection = [[5, 0]]"),
        &["[5, 0]", "5 rows"],
    );
    let tags = "kind = \"aprilgrid\"\nrows = 5\ncols = 4\ntag_mm = 7\n";
    says(tags, &["spacing", "missing"]);
    says(&format!("{tags}spacing = 3"), &["spacing = 3"]);
}
