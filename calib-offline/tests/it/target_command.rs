//! `detect --target` through the real binary: what it writes, and what it refuses.

use crate::common::documented::assert_documented;
use crate::common::{contents, run};
use calib_rays::progress::Silent;
use calib_rays::remedy::Remedy as _;
use calib_recording::dataset::{Dataset, load_markers};
use calib_recording::detect::ring_target::{TargetSettings, join_markers, target_views};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// A simulated dataset with corners and images of the target, smaller than usual, made once.
fn dataset() -> tempfile::TempDir {
    static FILES: LazyLock<BTreeMap<PathBuf, Vec<u8>>> = LazyLock::new(|| {
        let folder = tempfile::tempdir().unwrap();
        let size = ["--sensor", "640x512", "--angles", "-20:10:20"];
        let start = ["simulate", "-o", "set", "--target", "ring"];
        run(folder.path(), &[&start[..], &size].concat()).assert_code(0);
        let files = contents(folder.path()).into_iter();
        let below = |place: &str| {
            let place = Path::new(place).strip_prefix(folder.path());
            place.unwrap().to_owned()
        };
        files
            .filter(|(place, _)| !place.ends_with('/'))
            .map(|(place, bytes)| (below(&place), bytes))
            .collect()
    });
    let folder = tempfile::tempdir().unwrap();
    for (place, bytes) in &*FILES {
        let place = folder.path().join(place);
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        fs::write(place, bytes).unwrap();
    }
    folder
}

/// By id: u and v of the left camera, then of the right one.
fn true_matches(folder: &Path) -> BTreeMap<usize, [f64; 4]> {
    let text = fs::read_to_string(folder.join("set/target/matches.csv")).unwrap();
    text.lines()
        .skip(1)
        .map(|line| {
            let fields: Vec<f64> = line
                .split(',')
                .map(|field| field.parse().unwrap())
                .collect();
            (
                fields[0] as usize,
                [fields[1], fields[2], fields[3], fields[4]],
            )
        })
        .collect()
}

#[test]
fn markers_are_written_read_back_and_joined_into_the_simulators_matches() {
    let folder = dataset();
    let path = folder.path();
    let corners = fs::read(path.join("set/corners.csv")).unwrap();
    let object = run(
        path,
        &["detect", "set", "--target", "--overlay", "seen", "--json"],
    )
    .assert_code(0)
    .json();
    assert_eq!(object["schema"], "calib-offline/detect-target/1");
    let target = std::slice::from_ref(&object);
    assert_documented("detect", "calib-offline/detect-target/1", target, &[]);
    assert_eq!(
        (
            object["used"].as_u64(),
            object["images"].as_array().map(Vec::len)
        ),
        (Some(14), Some(14))
    );
    assert_eq!(object["images"][0]["verdict"], "ok");
    assert!(path.join("seen/target_right_006.png").exists());
    assert_eq!(
        fs::read(path.join("set/corners.csv")).unwrap(),
        corners,
        "the board's stay"
    );

    let dataset = Dataset::load(&path.join("set")).unwrap();
    let views = load_markers(&dataset).unwrap().unwrap();
    let target = dataset.target.as_ref().unwrap();
    let found = join_markers(target, &views, 2);
    let truth = true_matches(path);
    assert!(
        found.len() >= truth.len(),
        "{} of {}",
        found.len(),
        truth.len()
    );
    for marker in &found {
        let [u_left, v_left, u_right, v_right] = truth[&marker.id];
        let off = (marker.pixels[0].u - u_left)
            .hypot(marker.pixels[0].v - v_left)
            .max((marker.pixels[1].u - u_right).hypot(marker.pixels[1].v - v_right));
        // Rings of ten pixels' radius, noise of one level.
        assert!(off < 0.03, "{}: {off} px", marker.id);
    }
}

#[test]
fn a_table_of_markers_wins_over_the_images_and_is_not_replaced_unasked() {
    let folder = dataset();
    let path = folder.path();
    let table = "camera,pose,row,col,u,v\nleft,2,6,8,100.5,200\n";
    fs::write(path.join("set/markers.csv"), table).unwrap();
    let dataset = Dataset::load(&path.join("set")).unwrap();
    let views = target_views(&dataset, &TargetSettings::default(), &Silent).unwrap();
    assert_eq!(views.len(), 1);
    assert_eq!(views[0].corners[0].pixel.u, 100.5);
    run(path, &["detect", "set", "--target"])
        .assert_code(2)
        .assert_says(&["markers.csv: exists", "--force"]);
    assert_eq!(
        fs::read_to_string(path.join("set/markers.csv")).unwrap(),
        table
    );
    run(path, &["detect", "set", "--target", "--force"]).assert_code(0);
    let dataset = Dataset::load(&path.join("set")).unwrap();
    assert_eq!(load_markers(&dataset).unwrap().unwrap().len(), 14);

    fs::write(
        path.join("set/markers.csv"),
        "camera,pose,row,col,u,v\nleft,2,7,8,1,2\n",
    )
    .unwrap();
    let error = target_views(&dataset, &TargetSettings::default(), &Silent).unwrap_err();
    assert!(error.remedy().unwrap().contains("[target]"));
}

#[test]
fn what_cannot_be_used_is_said_and_nothing_is_written() {
    let folder = dataset();
    let path = folder.path();
    let refused = |code: i32, parts: &[&str]| {
        let before = contents(path);
        run(path, &["detect", "set", "--target"])
            .assert_code(code)
            .assert_says(parts)
            .assert_says(&["try: "]);
        assert_eq!(contents(path), before);
    };
    let manifest = fs::read_to_string(path.join("set/dataset.toml")).unwrap();
    // Images of something else.
    for camera in ["left", "right"] {
        for pose in 0..7 {
            let place = path.join(format!("set/target/{camera}/{pose:04}.png"));
            image::GrayImage::from_pixel(640, 512, image::Luma([90]))
                .save(place)
                .unwrap();
        }
    }
    refused(
        3,
        &[
            "left target pose 0",
            "too little contrast",
            "none of 14 images",
        ],
    );
    fs::write(path.join("set/target/left/0003.png"), "no image").unwrap();
    refused(2, &["camera left, pose 3", "0003.png"]);
    let described = manifest.find("[target]").unwrap();
    let without = manifest[..described].replace("target_images", "# target_images");
    fs::write(path.join("set/dataset.toml"), without).unwrap();
    refused(
        2,
        &["dataset.toml describes no [target]", "kind = \"rings\""],
    );
    fs::write(path.join("set/dataset.toml"), &manifest[..described]).unwrap();
    refused(2, &["dataset.toml:", "there is no [target]"]);
}
