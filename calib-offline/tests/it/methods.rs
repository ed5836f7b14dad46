//! `methods`, driven as a user drives it, on simulated recordings.

use crate::common::documented::assert_documented;
use crate::common::{MANIFEST, contents, corners_csv, dataset, run};
use calib_estimate::adjust::Observations;
use calib_judge::held_out::Estimated;
use calib_offline::compare::{compare_methods, words};
use calib_offline::methods::{Given, Joint, Method, MethodError, Pinhole, Solution};
use calib_offline::pipeline;
use calib_rays::progress::{Progress, Silent};
use calib_recording::dataset::Dataset;
use calib_recording::detect::DetectSettings;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::sync::Arc;

/// A small recording: 14 poses of 42 corners before two cameras.
fn simulate(folder: &Path, optics: &str) {
    simulate_with(folder, optics, &[]);
}

fn simulate_with(folder: &Path, optics: &str, more: &[&str]) {
    let size = ["--rows", "7", "--cols", "6", "--square-mm", "22"];
    let shots = ["--angles=-39:13:39", "--points", "200", "--holdout", "200"];
    let start = ["simulate", "-o", "set", "--optics", optics, "--seed", "3"];
    run(folder, &[&start[..], &size, &shots, more].concat()).assert_code(0);
}

fn method<'a>(object: &'a Value, name: &str) -> &'a Value {
    let methods = object["methods"].as_array().unwrap();
    methods.iter().find(|m| m["method"] == name).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn behind_a_port_the_ray_field_gains_and_the_files_say_so() {
    let folder = tempfile::tempdir().unwrap();
    simulate(folder.path(), "port");
    let arguments = ["methods", "set", "-o", "out", "--json"];
    let first = run(folder.path(), &arguments);
    let object = first.assert_code(0).json();
    let answered = "every method has an answer for every fold";
    assert_documented(
        "methods",
        "calib-offline/compare/1",
        std::slice::from_ref(&object),
        &["methods.failed_folds.fold", "methods.failed_folds.reason"].map(|key| (key, answered)),
    );
    assert_eq!(
        (&object["poses"], &object["folds"]),
        (&14.into(), &5.into())
    );
    let (baseline, joint) = (method(&object, "baseline"), method(&object, "joint"));
    for own in [baseline, joint] {
        assert!(own["failure"].is_null());
        assert_eq!(own["truth"].as_array().unwrap().len(), 2);
        // Both from the same corners.
        assert_eq!(own["training"]["corners"], joint["training"]["corners"]);
        assert_eq!(own["held_out"]["points"], joint["held_out"]["points"]);
    }
    assert!(number(&baseline["conversion_error_px"]) < 1e-4);
    // Noise of 0.05 px per axis.
    let fitted = number(&joint["training"]["rms_px"]);
    assert!((0.06..0.08).contains(&fitted), "{fitted}");
    assert!(number(&baseline["training"]["rms_px"]) > 1.3 * fitted);
    let rigid = &joint["against_first"]["rigid"];
    assert!(number(&rigid["low"]) < number(&rigid["ratio"]));
    assert!(number(&rigid["high"]) < 0.95, "{rigid}");
    assert!(baseline["against_first"].is_null());
    let ratio = |own: &Value| number(&own["truth"][0]["errors"]["placed_ratio"]);
    assert!(
        ratio(joint) < 1.2 && ratio(baseline) > 1.5,
        "{} {}",
        ratio(joint),
        ratio(baseline)
    );
    let conclusion = object["conclusion"].to_string();
    assert!(
        conclusion.contains("A pinhole is not enough here"),
        "{conclusion}"
    );

    let out = folder.path().join("out");
    let json: Value =
        serde_json::from_slice(&fs::read(out.join("comparison.json")).unwrap()).unwrap();
    assert_eq!(json, object);
    let csv = fs::read_to_string(out.join("comparison.csv")).unwrap();
    let fields: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(fields, [27; 4], "{csv}");
    let page = fs::read_to_string(out.join("comparison.md")).unwrap();
    assert!(page.contains("| ray field, joint |") && page.contains("- A pinhole is not enough"));

    // Nothing is replaced unasked, and what is written again has the same bytes.
    let before = contents(folder.path());
    run(folder.path(), &arguments)
        .assert_code(2)
        .assert_says(&["exists", "--force"]);
    let again = [&arguments[..], &["--force", "--threads", "1"]].concat();
    run(folder.path(), &again).assert_code(0);
    assert_eq!(contents(folder.path()), before);
}

#[test]
fn in_air_a_pinhole_is_enough() {
    let folder = tempfile::tempdir().unwrap();
    simulate(folder.path(), "brown");
    let found = run(folder.path(), &["methods", "set", "-v"]);
    found.assert_code(0).assert_says(&["s with its folds"]);
    assert!(
        found.stdout.contains("A pinhole is enough here"),
        "{}",
        found.stdout
    );
    assert!(!found.stdout.contains("s with its folds"));
    assert!(found.stdout.contains("matches mm (x oracle)"));
}

#[test]
fn one_camera_alone_is_compared_by_its_residuals() {
    let folder = tempfile::tempdir().unwrap();
    simulate(folder.path(), "brown");
    let set = folder.path().join("set");
    let manifest = fs::read_to_string(set.join("dataset.toml")).unwrap();
    let mut cameras: Vec<&str> = manifest.split("[[camera]]").collect();
    let right = cameras
        .iter()
        .position(|part| part.contains("\"right\""))
        .unwrap();
    // Whatever follows the camera's own keys stays.
    let rest = cameras[right]
        .find("\n[")
        .map_or("", |at| &cameras[right][at..]);
    let rest = rest.to_owned();
    cameras.remove(right);
    fs::write(set.join("dataset.toml"), cameras.join("[[camera]]") + &rest).unwrap();
    let corners = fs::read_to_string(set.join("corners.csv")).unwrap();
    let left: Vec<&str> = corners
        .lines()
        .filter(|line| !line.starts_with("right"))
        .collect();
    fs::write(set.join("corners.csv"), left.join("\n")).unwrap();
    let found = run(folder.path(), &["methods", "set", "--json"]);
    let object = found.assert_code(0).json();
    for name in ["baseline", "joint"] {
        let own = method(&object, name);
        assert!(number(&own["held_out"]["rms_px"]) < 0.1, "{own}");
        assert!(own["held_out"]["neighbor_rms_mm"].is_null());
        assert_eq!(own["truth"], Value::Array(Vec::new()));
    }
    assert!(object["conclusion"].to_string().contains("residual"));
}

#[test]
fn too_few_poses_for_folds_are_said() {
    let folder = dataset(MANIFEST, corners_csv(5).as_bytes());
    let found = run(folder.path(), &["methods", "set"]);
    found.assert_code(0);
    for part in ["no held-out boards", "not compared on boards it never saw"] {
        assert!(found.stdout.contains(part), "{}", found.stdout);
    }
}

#[test]
fn a_damaged_table_of_true_points_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    simulate(folder.path(), "brown");
    let truth = folder.path().join("set/matches_truth.csv");
    let text = fs::read_to_string(&truth).unwrap();
    for (content, words) in [
        (
            text.lines().take(9).collect::<Vec<_>>().join("\n"),
            "has 8 rows, its matches 200",
        ),
        (
            text.replacen("x_oracle", "oracle", 1),
            "is no table of true points",
        ),
        (String::new(), "has 0 rows"),
    ] {
        fs::write(&truth, content).unwrap();
        run(folder.path(), &["methods", "set", "-o", "out"])
            .assert_code(2)
            .assert_says(&["matches_truth.csv", words, "try: "]);
        assert!(!folder.path().join("out").exists());
    }
}

#[test]
fn outliers_hide_no_difference() {
    let folder = tempfile::tempdir().unwrap();
    simulate_with(folder.path(), "port", &["--outliers", "0.05"]);
    let object = run(folder.path(), &["methods", "set", "--json"])
        .assert_code(0)
        .json();
    let outliers = number(&object["outliers"]) / number(&object["corners"]);
    // 5 % were displaced by 3 px and more, 40 standard deviations.
    assert!((0.03..0.06).contains(&outliers), "{outliers}");
    let rigid = &method(&object, "joint")["against_first"]["rigid"];
    assert!(number(&rigid["high"]) < 0.95, "{rigid}");
}

/// A method that never has an answer.
#[derive(Debug)]
struct Never;

/// The baseline, if it never had an answer for some of the poses.
#[derive(Debug)]
struct NoFolds;

fn failed(why: &str) -> MethodError {
    MethodError::Other(Arc::new(std::io::Error::other(why)))
}

impl Method for Never {
    fn name(&self) -> &'static str {
        "never"
    }

    fn title(&self) -> &'static str {
        "never"
    }

    fn fit(&self, _: &Given, _: &dyn Progress) -> Result<Solution, MethodError> {
        Err(failed("there is none"))
    }

    fn fit_some_poses(&self, _: &Observations, _: &Given) -> Result<Estimated, MethodError> {
        panic!("nobody asks for folds of a method without an answer")
    }
}

impl Method for NoFolds {
    fn name(&self) -> &'static str {
        "no-folds"
    }

    fn title(&self) -> &'static str {
        "no folds"
    }

    fn fit(&self, given: &Given, progress: &dyn Progress) -> Result<Solution, MethodError> {
        Pinhole.fit(given, progress)
    }

    fn fit_some_poses(&self, _: &Observations, _: &Given) -> Result<Estimated, MethodError> {
        Err(failed("too few"))
    }
}

#[test]
fn a_method_that_fails_leaves_the_others_standing() {
    let folder = tempfile::tempdir().unwrap();
    simulate(folder.path(), "brown");
    let dataset = Dataset::load(&folder.path().join("set")).unwrap();
    let corners = pipeline::corners(&dataset, &DetectSettings::default(), &Silent).unwrap();
    let methods: [&dyn Method; 3] = [&Never, &NoFolds, &Joint];
    let found = compare_methods(&methods, &dataset, &corners, 4, &Silent).unwrap();
    let [never, no_folds, joint] = &found.methods[..] else {
        panic!("{}", found.methods.len());
    };
    assert_eq!(never.failure.as_deref(), Some("there is none"));
    assert!(never.training.is_none() && never.held_out.is_none() && never.truth.is_empty());
    assert_eq!(no_folds.failed_folds.len(), 4);
    assert!(no_folds.held_out.is_none() && no_folds.training.is_some());
    assert!(joint.held_out.unwrap().rms_px.unwrap() < 0.1);
    assert_eq!((found.folds, joint.truth.len()), (4, 2));
    let text = words::text(&found);
    for part in [
        "never: no answer: there is none",
        "4 fold(s) without an answer; fold 0: too few",
    ] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn compare_says_that_methods_are_compared_by_another_verb() {
    let folder = dataset(MANIFEST, corners_csv(5).as_bytes());
    let before = contents(folder.path());
    for more in [
        &[][..],
        &["-o", "out", "--folds", "5", "--force"],
        &["b.json"],
    ] {
        run(folder.path(), &[&["compare", "set"], more].concat())
            .assert_code(2)
            .assert_says(&[
                "calib-offline methods",
                "try: calib-offline methods DATASET",
            ]);
    }
    assert_eq!(contents(folder.path()), before);
}
