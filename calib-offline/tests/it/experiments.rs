//! The publication's experiments on small simulated datasets.

use crate::common::documented::{assert_documented, assert_listed};
use crate::common::{MANIFEST, contents, corners_csv, dataset, run};
use calib_offline::compare::publication::figures::figures;
use calib_offline::compare::publication::tables::tables;
use calib_offline::compare::publication::words::text;
use calib_offline::compare::publication::{Evaluation, ExperimentSettings, evaluate};
use calib_offline::methods::METHODS;
use calib_rays::board::BoardSpec;
use calib_rays::progress::Silent;
use calib_recording::dataset::Dataset;
use calib_simulate::{ImageFiles, OpticsKind, OutputSettings, Scene, SceneSettings, write_dataset};
use serde_json::json;
use std::fs;
use std::path::Path;

const SCHEMA: &str = "calib-offline/evaluate/1";

const FEW: ExperimentSettings = ExperimentSettings {
    spreads: 7,
    wide_spreads: 9,
    views: 2,
};

fn simulated(folder: &Path, ring_target: bool, change: impl FnOnce(&mut SceneSettings)) {
    let mut settings = SceneSettings::standard_noisy(OpticsKind::Brown, 1);
    settings.angles_deg = (-4..=4).map(|k| 10.0 * f64::from(k)).collect();
    change(&mut settings);
    let output = OutputSettings {
        ring_target,
        image_files: ImageFiles::Quick,
        ..OutputSettings::default()
    };
    write_dataset(&Scene::new(settings).unwrap(), &output, folder, false).unwrap();
}

fn evaluated(folder: &Path) -> Evaluation {
    evaluate(&Dataset::load(folder).unwrap(), &FEW, &Silent).unwrap()
}

#[test]
fn a_simulated_recording_has_every_part_and_joint_is_near_the_oracle() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("set");
    simulated(&folder, true, |_| {});
    let found = evaluated(&folder);
    assert!(found.left_out.is_empty(), "{:?}", found.left_out);
    let (of_command, complete) = ("the command adds it", "nothing is left out");
    assert_documented(
        "evaluate",
        SCHEMA,
        &[json!({ "evaluations": [found] })],
        &[
            ("tool_version", of_command),
            ("publication", of_command),
            ("publication.mean_mm", of_command),
            ("publication.deviation_mm", of_command),
            ("publication.comparable", of_command),
            ("files", of_command),
            ("evaluations.left_out.part", complete),
            ("evaluations.left_out.reason", complete),
        ],
    );
    assert!(found.methods.iter().all(|m| m.placed_poses == 18));

    let known = found.known_points.as_ref().unwrap();
    assert!(known.frame_is_true);
    let ratio = |method: &str| {
        let of = known.methods.iter().find(|m| m.method == method).unwrap();
        of.errors.as_ref().unwrap().placed_ratio
    };
    // 18 poses leave some percent of the noise of one match; the pinhole is the true model here.
    assert!(ratio("joint") < 1.05, "{}", ratio("joint"));
    assert!(ratio("baseline") < 1.05, "{}", ratio("baseline"));
    assert!(ratio("alternating") < 1.4, "{}", ratio("alternating"));
    let binned: usize = known.oracle.iter().map(|bin| bin.points).sum();
    assert_eq!(binned, known.common);

    let target = found.target.as_ref().unwrap();
    assert_eq!(target.methods.len(), 3);
    assert_eq!(target.cloud_method, Some("joint"));
    assert_eq!(target.cloud.len(), target.common);
    for method in &target.methods {
        // Seven distances from 0.92 to 1.08 of 350 mm, over which the depth of the cameras differs.
        assert_eq!(method.poses.len(), 7);
        let distances = method.poses.iter().map(|p| p.distance_mm);
        assert!(distances.clone().all(|d| (300.0..400.0).contains(&d)));
        // Markers of 0.002 px measure to micrometers; what is left is the calibration.
        let errors = method.errors.as_ref().unwrap();
        assert!(errors.mean_mm < 0.02, "{:?}: {errors:?}", method.method);
        // Depth is some three times as uncertain as what a rigid target shows.
        let true_rms_mm = method.true_rms_mm.unwrap();
        assert!(true_rms_mm > 0.5 * errors.rms_mm && true_rms_mm < 0.05);
        let squares = method
            .poses
            .iter()
            .map(|p| p.errors.count as f64 * p.true_rms_mm.unwrap().powi(2));
        let pooled = (squares.sum::<f64>() / errors.count as f64).sqrt();
        assert!((pooled - true_rms_mm).abs() < 1e-12);
        let rms = (errors.mean_mm.powi(2) + errors.variance_mm2).sqrt();
        assert!((rms - errors.rms_mm).abs() < 1e-12);
    }

    let spread = found.spread.as_ref().unwrap();
    assert_eq!((spread.published.len(), spread.wide.len()), (7, 9));
    assert_eq!(spread.published[0].spread_px, 1000.0);
    assert_eq!(spread.published[6].spread_px, 7000.0);
    assert!(spread.marker_pairs > 0);
    // Neurons of 100 px do not reach from corner to corner.
    assert!(spread.wide[0].left_out_rms_mm > 10.0 * spread.best_left_out_rms_mm);
    assert!(spread.best_left_out_rms_mm <= spread.published_choice_left_out_rms_mm);

    let drawn = figures(&found);
    let names: Vec<&str> = drawn.iter().map(|(name, _)| *name).collect();
    assert_eq!(
        names,
        [
            "fig7_spread.svg",
            "fig8_stage_angles.svg",
            "fig10_point_cloud.svg",
            "fig11_error_over_distance.svg"
        ]
    );
    for k in [1, 3] {
        for method in METHODS {
            assert!(drawn[k].1.contains(method.name()), "{} {k}", method.name());
        }
    }
    let rows: Vec<usize> = tables(&found)
        .iter()
        .map(|(_, t)| t.lines().count())
        .collect();
    assert_eq!(rows[..3], [1 + 7 + 9, 1 + 3 * 18, 1 + target.common]);
    for (name, table) in tables(&found) {
        let fields = table.lines().map(|line| line.split(',').count());
        let fields: Vec<usize> = fields.collect();
        assert!(fields.iter().all(|count| *count == fields[0]), "{name}");
    }
    let words = text(&[found]);
    assert!(words.contains("0.037") && words.contains("What cannot"));
}

#[test]
fn a_stage_without_noise_agrees_with_its_dial() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("set");
    simulated(&folder, false, |settings| {
        settings.noise_px = 0.0;
        settings.runout_mm = 0.0;
        settings.wobble_deg = 0.0;
    });
    let found = evaluated(&folder);
    let worst = |method: &str| {
        let methods = &found.stage_angles.as_ref().unwrap().methods;
        let of = methods.iter().find(|m| m.method == method).unwrap();
        assert_eq!(of.angles.len(), 18);
        of.angles
            .iter()
            .map(|a| a.error_deg.abs())
            .fold(0.0, f64::max)
    };
    // The baseline's model is the truth; the field is a polynomial of degree 7, the networks are
    // rougher still.
    assert!(worst("baseline") < 1e-6, "{}", worst("baseline"));
    assert!(worst("joint") < 1e-4, "{}", worst("joint"));
    assert!(worst("alternating") < 0.02, "{}", worst("alternating"));
    assert!(found.target.is_none());
    assert!(
        found
            .left_out
            .iter()
            .any(|l| l.part == "measurement target")
    );
}

#[test]
fn a_method_that_fails_says_why_and_the_others_stand() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("set");
    simulated(&folder, false, |settings| {
        settings.board = BoardSpec::chessboard(5, 3, 30.0);
    });
    let found = evaluated(&folder);
    let failed: Vec<bool> = found.methods.iter().map(|m| m.failed.is_some()).collect();
    assert_eq!(failed, [false, true, false]);
    let reason = found.methods[1].failed.as_ref().unwrap();
    assert!(reason.contains("no view has the"), "{reason}");
    let parts: Vec<&str> = found.left_out.iter().map(|l| l.part).collect();
    assert!(parts.contains(&"error against spread"), "{parts:?}");
    let known = found.known_points.as_ref().unwrap();
    assert_eq!(known.methods.len(), 2);
    assert!(known.methods.iter().all(|m| m.errors.is_some()));
    assert!(text(&[found]).contains("alternating: failed, no view"));
}

#[test]
fn one_camera_has_networks_and_angles_only() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("set");
    simulated(&folder, false, |_| {});
    let manifest = fs::read_to_string(folder.join("dataset.toml")).unwrap();
    let right = manifest.find("\n[[camera]]\nname = \"right\"").unwrap();
    let stage = manifest.find("\n[stage]").unwrap();
    let manifest = manifest[..right].to_owned() + &manifest[stage..];
    fs::write(folder.join("dataset.toml"), manifest).unwrap();
    let corners = fs::read_to_string(folder.join("corners.csv")).unwrap();
    let left: Vec<&str> = corners
        .lines()
        .filter(|l| !l.starts_with("right"))
        .collect();
    fs::write(folder.join("corners.csv"), left.join("\n") + "\n").unwrap();
    // Its truth is that of two cameras.
    fs::remove_file(folder.join("truth.json")).unwrap();
    let found = evaluated(&folder);
    assert!(found.spread.is_some() && found.stage_angles.is_some());
    assert!(found.target.is_none() && found.known_points.is_none());
    let names: Vec<&str> = figures(&found).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["fig7_spread.svg", "fig8_stage_angles.svg"]);
}

#[test]
fn the_command_writes_all_files_and_takes_away_those_of_an_earlier_run() {
    let home = dataset(MANIFEST, corners_csv(6).as_bytes());
    fs::create_dir(home.path().join("out")).unwrap();
    fs::write(home.path().join("out/fig10_point_cloud.svg"), "old").unwrap();
    fs::write(home.path().join("out/notes.txt"), "mine").unwrap();
    let object = run(home.path(), &["evaluate", "set", "-o", "out", "--json"])
        .assert_code(0)
        .json();
    assert_listed("evaluate", SCHEMA, std::slice::from_ref(&object));
    let mut names: Vec<String> = fs::read_dir(home.path().join("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "evaluation.json",
            "fig7_spread.csv",
            "fig7_spread.svg",
            "notes.txt",
            "table.md"
        ]
    );
    let written = fs::read_to_string(home.path().join("out/evaluation.json")).unwrap();
    let written: serde_json::Value = serde_json::from_str(&written).unwrap();
    assert_eq!(written, object);
    let evaluation = &object["evaluations"][0];
    assert_eq!(evaluation["name"], "set");
    assert_eq!(evaluation["left_out"].as_array().unwrap().len(), 4);
}

#[test]
fn evaluations_that_cannot_be() {
    let home = dataset(MANIFEST, corners_csv(6).as_bytes());
    let before = contents(home.path());
    for (arguments, parts) in [
        (&["evaluate"][..], &["DATASET"][..]),
        (&["evaluate", "set", "--paper-set-up"], &["--paper-set-up"]),
        (&["evaluate", "nowhere"], &["nowhere", "try: "]),
        (
            &["evaluate", "set", "-o", "set/corners.csv"],
            &["corners.csv", "try: "],
        ),
    ] {
        run(home.path(), arguments)
            .assert_code(2)
            .assert_says(parts);
        assert_eq!(contents(home.path()), before, "{arguments:?}");
    }
    let manifest = home.path().join("set/dataset.toml");
    let excluding = format!("[dataset]\nexclude = [6]\n{MANIFEST}");
    fs::write(&manifest, excluding).unwrap();
    run(home.path(), &["evaluate", "set"])
        .assert_code(2)
        .assert_says(&["no pose 6", "the last is pose 5", "try: "]);
    assert!(!home.path().join("evaluation").exists());
    fs::write(&manifest, MANIFEST).unwrap();
    let truth = home.path().join("set/truth.json");
    for (content, part) in [("{", "EOF"), ("{\"settings\": {}}", "missing field")] {
        fs::write(&truth, content).unwrap();
        run(home.path(), &["evaluate", "set"])
            .assert_code(2)
            .assert_says(&["truth.json: is not the truth", part, "try: "]);
        assert!(!home.path().join("evaluation").exists());
    }
    fs::remove_file(&truth).unwrap();
    let header = "id,u_left,v_left,u_right,v_right\n1,300,200,310,200\n";
    fs::write(home.path().join("set/matches.csv"), header).unwrap();
    fs::write(home.path().join("set/matches_truth.csv"), "id,x\n1,2\n").unwrap();
    run(home.path(), &["evaluate", "set"])
        .assert_code(2)
        .assert_says(&["matches_truth.csv", "missing field"]);
    let empty = "x,y,z,x_oracle,y_oracle,z_oracle\n";
    fs::write(home.path().join("set/matches_truth.csv"), empty).unwrap();
    run(home.path(), &["evaluate", "set"])
        .assert_code(2)
        .assert_says(&["matches_truth.csv", "has 0 rows, its matches 1"]);
    assert!(!home.path().join("evaluation").exists());
}
