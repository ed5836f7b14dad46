//! Datasets on disk: complete, repeatable, whole or not at all.

use super::output::write_dataset;
use super::*;
use calib_rays::geometry::SensorSize;
use std::collections::BTreeMap;
use std::path::Path;

fn scene(seed: u64) -> Scene {
    Scene::new(SceneSettings {
        sensor: SensorSize::new(320, 256),
        angles_deg: vec![-15.0, 10.0],
        noise_px: 0.05,
        ..SceneSettings::standard(OpticsKind::Brown, seed)
    })
    .unwrap()
}

fn few() -> OutputSettings {
    OutputSettings {
        point_count: 12,
        holdout_count: 15,
        ..OutputSettings::default()
    }
}

/// Every file below a folder, by relative path.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().display().to_string();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

fn lines(text: &[u8]) -> Vec<Vec<&str>> {
    std::str::from_utf8(text)
        .unwrap()
        .lines()
        .map(|line| line.split(',').collect())
        .collect()
}

#[test]
fn a_corner_dataset_holds_what_the_scene_says_bit_for_bit() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("deep/down/set");
    let scene = scene(1);
    let summary = write_dataset(&scene, &few(), &folder, false).unwrap();
    let files = files(&folder);
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "corners.csv",
            "dataset.toml",
            "holdout.csv",
            "holdout_truth.csv",
            "matches.csv",
            "matches_truth.csv",
            "truth.json"
        ]
    );
    assert_eq!(
        summary.byte_count,
        files.values().map(|bytes| bytes.len() as u64).sum::<u64>()
    );

    let table = lines(&files["corners.csv"]);
    assert_eq!(table[0], ["camera", "pose", "row", "col", "u", "v"]);
    assert_eq!(table.len() - 1, summary.corner_count);
    let views = scene.observe_corners();
    let corners = views
        .iter()
        .flat_map(|view| view.corners.iter().map(move |corner| (view, corner)));
    for (row, (view, corner)) in table[1..].iter().zip(corners) {
        assert_eq!(row[0], scene.names[view.camera_idx]);
        assert_eq!(row[1].parse(), Ok(view.pose));
        assert_eq!(row[2].parse(), Ok(corner.row));
        assert_eq!(row[3].parse(), Ok(corner.col));
        assert_eq!(row[4].parse(), Ok(corner.pixel.u));
        assert_eq!(row[5].parse(), Ok(corner.pixel.v));
    }

    let manifest: toml::Table = std::str::from_utf8(&files["dataset.toml"])
        .unwrap()
        .parse()
        .unwrap();
    assert_eq!(manifest["board"]["rows"].as_integer(), Some(15));
    assert_eq!(manifest["board"]["square_mm"].as_float(), Some(10.0));
    assert_eq!(manifest["camera"][1]["name"].as_str(), Some("right"));
    assert_eq!(manifest["camera"][1]["height"].as_integer(), Some(256));
    assert_eq!(manifest["stage"]["placement"].as_array().unwrap().len(), 4);
    assert_eq!(manifest["stage"]["angles_deg"][0].as_float(), Some(-15.0));
}

#[test]
fn truth_tables_stand_row_by_row_beside_the_matches() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("set");
    let scene = scene(2);
    write_dataset(&scene, &few(), &folder, false).unwrap();
    let files = files(&folder);
    for (name, set, count) in [
        ("matches", MatchSet::Points, 12),
        ("holdout", MatchSet::Holdout, 15),
    ] {
        let pixels = lines(&files[&format!("{name}.csv")]);
        let truth = lines(&files[&format!("{name}_truth.csv")]);
        assert_eq!(pixels[0], ["id", "u_left", "v_left", "u_right", "v_right"]);
        let expected = scene.matches(set, count);
        assert_eq!(pixels.len(), count + 1);
        for ((row, truth_row), entry) in pixels[1..].iter().zip(&truth[1..]).zip(&expected) {
            assert_eq!(row[0], truth_row[0]);
            assert_eq!(row[3].parse(), Ok(entry.pixels[1].u));
            assert_eq!(truth_row[3].parse(), Ok(entry.point_in_datum.z));
            assert_eq!(truth_row[4].parse(), Ok(entry.point_in_left.x));
            assert_eq!(truth_row[9].parse(), Ok(entry.oracle_in_datum.z));
            assert_eq!(truth_row.len(), truth[0].len());
        }
    }
    let truth: serde_json::Value = serde_json::from_slice(&files["truth.json"]).unwrap();
    assert_eq!(truth["schema"], "calib-offline/truth/1");
    let settings: SceneSettings = serde_json::from_value(truth["settings"].clone()).unwrap();
    assert_eq!(settings, scene.settings, "the scene can be made again");
    let ray = &truth["cameras"][1]["rays"][20];
    let pixel =
        calib_rays::geometry::PixelPoint::new(ray[0].as_f64().unwrap(), ray[1].as_f64().unwrap());
    let direction = scene.true_ray(1, pixel).unwrap().direction;
    assert_eq!(ray[7].as_f64(), Some(direction.z));
}

#[test]
fn the_same_seed_gives_the_same_bytes_images_included() {
    let home = tempfile::tempdir().unwrap();
    let settings = OutputSettings {
        images: true,
        corners: false,
        ..few()
    };
    let write = |name: &str, seed| {
        let folder = home.path().join(name);
        let settings = OutputSettings {
            ring_target: seed == 3,
            ..settings
        };
        let summary = write_dataset(&scene(seed), &settings, &folder, false).unwrap();
        assert_eq!((summary.image_count, summary.corner_count), (8, 0));
        files(&folder)
    };
    let first = write("first", 3);
    let quick = OutputSettings {
        image_files: ImageFiles::Quick,
        ..settings.clone()
    };
    let quick_folder = home.path().join("quick");
    write_dataset(&scene(3), &quick, &quick_folder, false).unwrap();
    let pixels = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_bytes();
    let place = "right/0003.png";
    assert!(pixels(&files(&quick_folder)[place]) == pixels(&first[place]));
    assert!(
        !first.contains_key("corners.csv"),
        "the images are the data"
    );
    assert!(first == write("second", 3), "same seed, same bytes");
    assert!(first["left/0000.png"] != write("third", 4)["left/0000.png"]);
    let image = image::load_from_memory(&first["right/0003.png"]).unwrap();
    assert_eq!((image.width(), image.height()), (320, 256));
    assert_eq!(image.color(), image::ColorType::L8);
    assert!(first.contains_key("target/left/0006.png"));
    let dataset = calib_recording::dataset::Dataset::load(&home.path().join("first")).unwrap();
    let target = dataset.target.unwrap();
    assert_eq!((target.rows, target.cols, target.pose_count()), (7, 9, 7));
    assert!(target.is_direction(1, 2) && !target.is_direction(2, 1));
    let markers = lines(&first["target/truth.csv"]);
    assert!(markers.len() > 6 * 63, "{} markers", markers.len() - 1);
    let header = "id,pose,row,col,direction,x,y,z,x_left,y_left,z_left";
    assert_eq!(markers[0].join(","), header);
    let directions = markers[1..].iter().filter(|row| row[4] == "1").count();
    assert!(directions >= 30, "{directions}");
}

#[test]
fn sixteen_bits_agree_with_eight() {
    let home = tempfile::tempdir().unwrap();
    let load = |name: &str, image_depth| {
        let folder = home.path().join(name);
        let settings = OutputSettings {
            images: true,
            image_depth,
            image_files: ImageFiles::Quick,
            ..few()
        };
        write_dataset(&scene(1), &settings, &folder, false).unwrap();
        image::open(folder.join("left/0001.png")).unwrap()
    };
    let eight = load("eight", ImageDepth::Eight).into_luma8();
    let sixteen = load("sixteen", ImageDepth::Sixteen);
    assert_eq!(sixteen.color(), image::ColorType::L16);
    for (a, b) in eight.pixels().zip(sixteen.into_luma16().pixels()) {
        assert!((f64::from(a.0[0]) * 257.0 - f64::from(b.0[0])).abs() <= 129.0);
    }
}

#[test]
fn nothing_is_overwritten_unasked_and_nothing_half_written() {
    let home = tempfile::tempdir().unwrap();
    let scene = scene(1);
    let file = home.path().join("file");
    std::fs::write(&file, "mine").unwrap();
    let error = write_dataset(&scene, &few(), &file, true).unwrap_err();
    assert!(matches!(error, SimulateError::OutputIsFile { .. }));
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");

    let full = home.path().join("full");
    std::fs::create_dir(&full).unwrap();
    std::fs::write(full.join("notes.txt"), "mine").unwrap();
    let error = write_dataset(&scene, &few(), &full, false).unwrap_err();
    assert!(matches!(error, SimulateError::OutputNotEmpty { .. }));
    assert!(error.to_string().contains("--force"));

    // A dataset that cannot be made leaves the old one alone, even when told to replace it.
    let apart = Scene::new(SceneSettings {
        angles_deg: vec![170.0],
        ..scene.settings.clone()
    })
    .unwrap();
    let error = write_dataset(&apart, &few(), &full, true).unwrap_err();
    assert!(matches!(
        error,
        SimulateError::TooFewMatches { need: 12, have: 0 }
    ));
    assert_eq!(files(&full).len(), 1);

    write_dataset(&scene, &few(), &full, true).unwrap();
    assert!(!full.join("notes.txt").exists() && full.join("truth.json").exists());
    let empty = home.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    write_dataset(&scene, &few(), &empty, false).unwrap();

    let below_file = file.join("set");
    let error = write_dataset(&scene, &few(), &below_file, false).unwrap_err();
    assert!(matches!(error, SimulateError::Io { .. }));
    // No temporary folder is left behind.
    let names: Vec<_> = std::fs::read_dir(home.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(names.len(), 3, "{names:?}");
}
