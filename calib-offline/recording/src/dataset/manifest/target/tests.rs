use super::super::Dataset;
use std::fs;

const GOOD: &str = r#"[board]
kind = "chessboard"
rows = 15
cols = 13
square_mm = 10.0
[[camera]]
name = "left"
width = 1280
height = 1024
target_images = "target/left/*.png"
[[camera]]
name = "right"
width = 1280
height = 1024
target_images = "target/right/*.png"
[target]
kind = "rings"
rows = 7
cols = 9
pitch_mm = 12.0
outer_radius_mm = 4.0
direction_outer_radius_mm = 5.0
direction = [[3, 4], [3, 5], [3, 6], [4, 4], [1, 2]]
"#;

/// A folder with corners and two images of the target per camera.
fn folder(manifest: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("corners.csv"),
        "camera,pose,row,col,u,v\n",
    )
    .unwrap();
    for camera in ["left", "right"] {
        let images = folder.path().join("target").join(camera);
        fs::create_dir_all(&images).unwrap();
        for image in ["10.png", "2.png"] {
            fs::write(images.join(image), "").unwrap();
        }
    }
    fs::write(folder.path().join("dataset.toml"), manifest).unwrap();
    folder
}

#[test]
fn a_good_target_is_read_with_its_images_in_natural_order() {
    let folder = folder(GOOD);
    let target = Dataset::load(folder.path()).unwrap().target.unwrap();
    assert_eq!((target.rows, target.cols), (7, 9));
    assert_eq!(target.direction[4], (1, 2));
    assert_eq!(target.pose_count(), 2);
    for (images, camera) in target.images.iter().zip(["left", "right"]) {
        let expected =
            ["2.png", "10.png"].map(|name| folder.path().join("target").join(camera).join(name));
        assert_eq!(images[..], expected);
    }
}

#[test]
fn what_means_nothing_is_refused_with_its_line_and_a_remedy() {
    let direction = "direction = [[3, 4], [3, 5], [3, 6], [4, 4], [1, 2]]";
    for (from, to, line, says) in [
        (
            "kind = \"rings\"",
            "kind = \"dots\"",
            17,
            "\"dots\" is not known",
        ),
        ("pitch_mm = 12.0", "pitch_mm = -1.0", 20, "pitch_mm = -1"),
        ("pitch_mm = 12.0\n", "", 16, "[target] pitch_mm"),
        ("pitch_mm = 12.0", "pitch_mm = 10.0", 22, "would touch"),
        ("radius_mm = 5.0", "radius_mm = 4.1", 22, "the larger ones"),
        (direction, "direction = [[3]]", 23, "must be [row, col]"),
        (
            direction,
            "direction = [[7, 0]]",
            23,
            "not on the target of 7 rows",
        ),
        (
            direction,
            "direction = [[1, 2], [1, 2]]",
            23,
            "[1, 2] twice",
        ),
        (direction, "direction = [[3, 4]]", 23, "looks the same"),
        (direction, "colour = 3", 23, "colour"),
        ("target/left", "target/right", 15, "another view too"),
        (
            "right/*.png",
            "right/1*.png",
            15,
            "\"left\" has 2 and camera \"right\" has 1",
        ),
    ] {
        assert!(GOOD.contains(from), "{from}");
        let folder = folder(&GOOD.replacen(from, to, 1));
        let error = Dataset::load(folder.path()).expect_err(to);
        let message = error.to_string();
        assert!(
            message.contains(&format!("dataset.toml:{line}")),
            "{to}: {message}"
        );
        assert!(message.contains(says), "{to}: {message}");
        assert!(error.remedy().is_some(), "{to}");
    }
}

#[test]
fn images_of_no_target_and_a_target_without_images_are_refused() {
    let (cameras, target) = GOOD.split_at(GOOD.find("[target]").unwrap());
    let without_target = Dataset::load(folder(cameras).path())
        .unwrap_err()
        .to_string();
    assert!(
        without_target.contains("there is no [target]"),
        "{without_target}"
    );
    let plain: Vec<&str> = cameras
        .lines()
        .filter(|line| !line.starts_with("target_images"))
        .collect();
    let manifest = plain.join("\n") + "\n" + target;
    let without_images = folder(&manifest);
    let message = Dataset::load(without_images.path())
        .unwrap_err()
        .to_string();
    assert!(message.contains("no camera has target_images"), "{message}");
    // Markers found before are as good as images.
    fs::write(without_images.path().join("markers.csv"), "").unwrap();
    assert!(Dataset::load(without_images.path()).is_ok());
}
