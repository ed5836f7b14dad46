//! The same input gives the same bytes, whatever the number of threads.

use calib_recording::dataset::Dataset;
use calib_simulate::{OpticsKind, Scene, SceneSettings};
use workspace_tests::{calibrate, packed, record, small_scene};

/// `calibration.json` and `rig.rays`.
fn bytes(dataset: &Dataset, threads: usize) -> [Vec<u8>; 2] {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        let calibration = calibrate(dataset, 2).calibration;
        [calibration.to_json().unwrap(), packed(&calibration).bytes]
    })
}

fn assert_same(dataset: &Dataset) {
    let once = bytes(dataset, 1);
    for threads in [2, 5] {
        // Not assert_eq: nobody wants to read the two files.
        assert!(bytes(dataset, threads) == once, "{threads} threads");
    }
}

#[test]
fn from_corners() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = small_scene(OpticsKind::Paper, 3);
    scene.settings.noise_px = 0.05;
    assert_same(&record(&scene, false, &folder.path().join("set")));
}

#[test]
fn from_images() {
    let folder = tempfile::tempdir().unwrap();
    let scene = small_scene(OpticsKind::Brown, 4);
    assert_same(&record(&scene, true, &folder.path().join("set")));
}

#[test]
fn the_seed_makes_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let record = |seed: u64, name: &str| {
        let path = folder.path().join(name);
        let few = SceneSettings {
            angles_deg: vec![-11.0, 11.0],
            ..small_scene(OpticsKind::Brown, seed).settings
        };
        record(&Scene::new(few).unwrap(), true, &path);
        [
            "left/0003.png",
            "right/0000.png",
            "matches.csv",
            "truth.json",
        ]
        .map(|file| std::fs::read(path.join(file)).unwrap())
    };
    let first = record(5, "first");
    assert!(record(5, "again") == first);
    assert!(record(6, "other") != first);
}
