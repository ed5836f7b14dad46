//! `evaluate`: the publication's experiments on a dataset, or on a simulated copy of its set-up.

use super::Outcome;
use super::error::Error;
use super::output::Console;
use crate::compare::publication::figures::figures;
use crate::compare::publication::paper::evaluate_set_up;
use crate::compare::publication::tables::tables;
use crate::compare::publication::words::{
    COMPARABLE, PUBLISHED_DEVIATION_MM, PUBLISHED_MEAN_MM, text,
};
use crate::compare::publication::{Evaluation, ExperimentSettings, evaluate};
use calib_recording::atomic_file::{check_folder, check_writable, make_folder, write_set};
use calib_recording::dataset::Dataset;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline evaluate recordings/monday -o results/monday-evaluated
  calib-offline evaluate --paper-set-up";

const FORMATS: &str = "\
Three methods get the same screened corners: baseline (pinhole with Brown-Conrady distortion),
alternating (the published procedure) and joint (the default of calibrate). What the dataset has
decides what can be done: stage angles (Fig. 8), a [target] of ring markers (Fig. 10 and 11),
matches.csv and holdout.csv with their truth, truth.json of a simulated dataset (auxiliary
markers). What is left out is said with the reason.

DIR holds fig7_spread, fig8_stage_angles, fig10_point_cloud and fig11_error_over_distance, each as
.svg and .csv, table.md and evaluation.json. With --paper-set-up the figures are in a folder per
recording: ten-poses and two-placements.

evaluation.json, and --json, schema calib-offline/evaluate/1:
  tool_version, publication (mean_mm, deviation_mm, comparable), files
  evaluations (name, dataset, cameras, poses, corners, methods (method, placed_poses, failed),
    spread (views, neurons, marker_pairs, best_px, best_left_out_rms_mm, alternating_px,
      published_choice_left_out_rms_mm),
    stage_angles (methods (method, rms_deg, wobble_rms_deg,
      angles (pose, placement, dial_deg, error_deg))),
    target (markers, common, cloud_method, methods (method, without_point,
      errors (count, mean_mm, deviation_mm, variance_mm2, rms_mm, worst_mm),
      neighbor_rms_mm, true_rms_mm, largest_pose_deviation_mm, poses (pose, distance_mm,
        errors (count, mean_mm, deviation_mm, variance_mm2, rms_mm, worst_mm),
        neighbor_rms_mm, true_rms_mm))),
    known_points (matches, common, frame_is_true, methods (method, without_point,
      errors (points, direct_rms_mm, placed_rms_mm, oracle_rms_mm, direct_ratio, placed_ratio),
      bins (distance_mm, points, placed_rms_mm)), oracle (distance_mm, points, placed_rms_mm)),
    left_out (part, reason))
failed: why there is nothing of a method";

/// Everything that may stand in a folder of figures.
const FIGURE_FILES: [&str; 8] = [
    "fig7_spread.svg",
    "fig7_spread.csv",
    "fig8_stage_angles.svg",
    "fig8_stage_angles.csv",
    "fig10_point_cloud.svg",
    "fig10_point_cloud.csv",
    "fig11_error_over_distance.svg",
    "fig11_error_over_distance.csv",
];

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct EvaluateArgs {
    /// The folder of a dataset
    #[arg(value_name = "DATASET", required_unless_present = "paper_set_up")]
    pub dataset: Option<PathBuf>,
    /// Simulate a copy of the publication's set-up and evaluate that
    #[arg(long, conflicts_with = "dataset")]
    pub paper_set_up: bool,
    /// The folder for the results; earlier results in it are replaced
    #[arg(short, long, value_name = "DIR", default_value = "evaluation")]
    pub output: PathBuf,
}

/// `evaluation.json`, and what `--json` prints.
#[derive(Debug, Serialize)]
struct EvaluateObject {
    schema: &'static str,
    tool_version: &'static str,
    publication: Publication,
    files: Vec<PathBuf>,
    evaluations: Vec<Evaluation>,
}

#[derive(Debug, Serialize)]
struct Publication {
    mean_mm: f64,
    deviation_mm: f64,
    comparable: String,
}

/// Runs the command.
///
/// # Errors
/// [`Error`]; then nothing is written.
pub fn run(args: &EvaluateArgs, console: &Console) -> Result<Outcome, Error> {
    check_folder(&args.output)?;
    let settings = ExperimentSettings::default();
    let evaluations = if let Some(folder) = &args.dataset {
        let dataset = Dataset::load(folder)?;
        check_writable(&args.output)?;
        vec![evaluate(&dataset, &settings, console.progress())?]
    } else {
        check_writable(&args.output)?;
        evaluate_set_up(&settings, console.progress())?
    };
    let words = text(&evaluations);
    let (object, folders) = write_results(&args.output, evaluations, &words, args.paper_set_up)?;
    remove_stale(&folders, &object.files);
    let shown = format!("{words}\nwritten to {}", args.output.display());
    console.result(&shown, &object);
    Ok(Outcome::Done)
}

/// Writes all files; the figures of each recording into a folder of its own if they are several.
fn write_results(
    output: &Path,
    evaluations: Vec<Evaluation>,
    words: &str,
    by_name: bool,
) -> Result<(EvaluateObject, Vec<PathBuf>), Error> {
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    for evaluation in &evaluations {
        let folder = if by_name {
            output.join(&evaluation.name)
        } else {
            output.to_owned()
        };
        for (name, content) in figures(evaluation).into_iter().chain(tables(evaluation)) {
            files.push((folder.join(name), content));
        }
        folders.push(folder);
    }
    files.push((output.join("table.md"), words.to_owned()));
    let json = output.join("evaluation.json");
    let mut places: Vec<PathBuf> = files.iter().map(|(path, _)| path.clone()).collect();
    places.push(json.clone());
    let object = EvaluateObject {
        schema: "calib-offline/evaluate/1",
        tool_version: env!("CARGO_PKG_VERSION"),
        publication: Publication {
            mean_mm: PUBLISHED_MEAN_MM,
            deviation_mm: PUBLISHED_DEVIATION_MM,
            comparable: COMPARABLE.replace('\n', " "),
        },
        files: places,
        evaluations,
    };
    files.push((json, serde_json::to_string_pretty(&object)? + "\n"));
    make_folder(output)?;
    for folder in &folders {
        make_folder(folder)?;
    }
    let contents: Vec<(PathBuf, &[u8])> = files
        .iter()
        .map(|(path, content)| (path.clone(), content.as_bytes()))
        .collect();
    write_set(&contents)?;
    Ok((object, folders))
}

/// Figures of an earlier run that this one has not would be taken for its own.
fn remove_stale(folders: &[PathBuf], written: &[PathBuf]) {
    let places = folders
        .iter()
        .flat_map(|folder| FIGURE_FILES.map(|name| folder.join(name)));
    for path in places.filter(|path| !written.contains(path)) {
        // Most were never there.
        let _ = std::fs::remove_file(path);
    }
}
