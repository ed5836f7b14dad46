//! Files that should be images, given to the real binary.

use crate::common::{MANIFEST, contents, run};
use image::{ImageBuffer, Luma, Rgb};
use std::fs;
use std::path::Path;

/// A board of 7 x 6 squares of 50 px, a little smaller from pose to pose.
fn board(pose: u32, u: u32, v: u32) -> u8 {
    let square_px = 50 - 4 * pose;
    let (u, v) = (u.wrapping_sub(60), v.wrapping_sub(60));
    let on_board = u < 6 * square_px && v < 7 * square_px;
    let dark = (u / square_px + v / square_px).is_multiple_of(2);
    if on_board && dark { 30 } else { 220 }
}

/// So many images per camera.
fn dataset(poses: u32) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut manifest = MANIFEST.to_owned();
    for camera in ["left", "right"] {
        let place = folder.path().join("set").join(camera);
        fs::create_dir_all(&place).unwrap();
        for pose in 0..poses {
            let image = ImageBuffer::from_fn(640, 480, |u, v| Luma([board(pose, u, v)]));
            image.save(place.join(format!("{pose}.png"))).unwrap();
        }
        let name = format!("name = \"{camera}\"\n");
        manifest = manifest.replace(&name, &format!("{name}images = \"{camera}/*.png\"\n"));
    }
    fs::write(folder.path().join("set/dataset.toml"), manifest).unwrap();
    folder
}

#[track_caller]
fn refused(folder: &Path, code: i32, parts: &[&str]) {
    let before = contents(folder);
    for arguments in [&["calibrate", "set", "-o", "out"][..], &["detect", "set"]] {
        run(folder, arguments)
            .assert_code(code)
            .assert_says(parts)
            .assert_says(&["try: "]);
    }
    assert_eq!(contents(folder), before, "something was written");
}

/// The first bytes of a PNG that claims to be of this size.
fn claims_to_be(folder: &Path, width: u32, height: u32) -> Vec<u8> {
    let path = folder.join("small.png");
    ImageBuffer::from_pixel(3, 3, Luma([9u8]))
        .save(&path)
        .unwrap();
    let mut bytes = fs::read(&path).unwrap();
    fs::remove_file(&path).unwrap();
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    bytes
}

#[test]
fn a_file_that_is_no_image_of_its_camera() {
    let folder = dataset(2);
    let path = folder.path();
    let good = fs::read(path.join("set/left/1.png")).unwrap();
    let small = ImageBuffer::from_pixel(1, 1, Luma([9u8]));
    small.save(path.join("small.png")).unwrap();
    let small = fs::read(path.join("small.png")).unwrap();
    let turned = ImageBuffer::from_pixel(480, 640, Luma([9u8]));
    turned.save(path.join("turned.png")).unwrap();
    let turned = fs::read(path.join("turned.png")).unwrap();
    let huge = claims_to_be(path, i32::MAX as u32, i32::MAX as u32);
    let cases: [(&[u8], &str); 7] = [
        (b"", "1.png"),
        (b"left 1", "1.png"),
        (&good[..good.len() / 2], "1.png"),
        (&good[..20], "1.png"),
        (&huge, "1.png"),
        (&small, "(1.png): 1x1 pixels, not 640x480"),
        (&turned, "width and height swapped?"),
    ];
    for (bytes, words) in cases {
        fs::write(path.join("set/left/1.png"), bytes).unwrap();
        refused(path, 2, &["camera left, pose 1", words]);
    }
    for broken in ["set/left/1.png", "set/right/0.png"] {
        fs::write(path.join(broken), b"").unwrap();
    }
    refused(path, 2, &["camera left, pose 1", "1 more images"]);
}

#[test]
fn images_without_the_board_that_is_described() {
    let folder = dataset(4);
    let path = folder.path();
    let set = path.join("set/dataset.toml");
    let manifest = fs::read_to_string(&set).unwrap();
    let squares = manifest
        .replace("rows = 6", "rows = 7")
        .replace("cols = 5", "cols = 6");
    fs::write(&set, &squares).unwrap();
    run(path, &["calibrate", "set", "-o", "out"])
        .assert_code(3)
        .assert_says(&[
            "8 of 8 images show a whole board of 5 x 6",
            "rows = 6, cols = 5",
            "not squares",
        ]);
    fs::write(&set, manifest).unwrap();
    for camera in ["left", "right"] {
        for pose in 0..4 {
            let place = path.join(format!("set/{camera}/{pose}.png"));
            ImageBuffer::from_pixel(640, 480, Luma([0u8]))
                .save(place)
                .unwrap();
        }
    }
    run(path, &["calibrate", "set", "-o", "out"])
        .assert_code(3)
        .assert_says(&["8 of 8 images", "left/0.png", "too little contrast"]);
    assert!(!path.join("out").exists());
}

#[test]
fn colors_and_sixteen_bits_are_read_like_gray() {
    let folder = dataset(4);
    let path = folder.path();
    let deep = ImageBuffer::from_fn(640, 480, |u, v| Luma([u16::from(board(1, u, v)) * 257]));
    deep.save(path.join("set/left/1.png")).unwrap();
    let color = ImageBuffer::from_fn(640, 480, |u, v| Rgb([board(2, u, v); 3]));
    color.save(path.join("set/left/2.png")).unwrap();
    let object = run(path, &["detect", "set", "--json"])
        .assert_code(0)
        .json();
    assert_eq!(object["used"], 8);
    assert_eq!(object["corner_count"], 8 * 30);
}

#[test]
fn patterns_and_places_that_mean_nothing() {
    let folder = dataset(4);
    let path = folder.path();
    let set = path.join("set/dataset.toml");
    let manifest = fs::read_to_string(&set).unwrap();
    for (from, to, words) in [
        ("left/*.png", "left/*.jpg", "matches no file"),
        ("left/*.png", "nowhere/*.png", "cannot be read"),
        ("left/*.png", "*/0.png", "in the file name only"),
        ("left/*.png", "right/*.png", "is used twice"),
        (
            "left/*.png",
            "left/?.p*g\"\nimage_list = [\"a\"]\n#",
            "both images",
        ),
    ] {
        fs::write(&set, manifest.replacen(from, to, 1)).unwrap();
        refused(path, 2, &["dataset.toml:", words]);
    }
    fs::write(&set, &manifest).unwrap();
    run(path, &["detect", "set", "--overlay", "set/dataset.toml"])
        .assert_code(2)
        .assert_says(&["is a file, a folder is needed"]);
    fs::remove_file(path.join("set/left/1.png")).unwrap();
    refused(path, 2, &["3 images", "4", "image_list"]);
}
