//! `methods`: methods side by side on one dataset.

use super::Outcome;
use super::calibrate::say_what_is_used;
use super::error::Error;
use super::output::Console;
use super::place::check_results_folder;
use crate::compare::{Comparison, compare, words};
use crate::pipeline;
use calib_recording::atomic_file::{make_folder, write_set};
use calib_recording::dataset::Dataset;
use clap::Args;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline methods recordings/monday
  calib-offline methods recordings/monday -o results/compared --folds 10";

const FORMATS: &str = "\
DATASET is a folder with dataset.toml and corners.csv or images, as for calibrate. Every method is
given the same views (those that the joint estimate finds to agree with each other) and the same
folds: baseline (a pinhole with Brown-Conrady distortion, robust, all cameras together), alternating
(the published procedure) and joint (the ray field of calibrate). Held-out figures are from the
corners that every method can answer, without those that every method rejects when it sees them.

  fitted px    RMS residual of the corners that all methods use, from the calibration of all poses
  held-out px  RMS residual on boards that the method never saw, pose refitted; then the median
  neighbor     RMS error of the distance of neighboring corners on those boards, triangulated
  rigid        RMS distance of their corners from the rigid board
  outside      held-out corners outside the method's own calibrated area
  rejected     corners that the method leaves out of its calibration
  matches, holdout   where the truth is known (simulate): RMS distance of points from it after the best
               rigid placement, and over that of the true rays

Held-out figures contain the noise of the held-out corners: a ratio of 0.9 may be a calibration that is
much better. Intervals are 95 %, by drawing boards anew (fixed seed). -v tells the time of each method.

-o holds comparison.json (the object of --json), comparison.csv and comparison.md.
Exit code 3: no method has an answer.

With --json, schema calib-offline/compare/1; a figure that does not apply is null:
  tool_version, input_sha256, square_mm, working_distance_mm
  poses, views, corners, outliers, folds, boards, held_out_corners, common_corners
  conclusion             sentences
  methods (method, title, failure, training (rms_px, corners, rejected), conversion_error_px,
    failed_folds (fold, reason), held_out (rms_px, median_px, neighbor_rms_percent,
      neighbor_rms_mm, rigid_rms_mm, points, unanswered),
    against_first (residual/neighbor/rigid (ratio, low, high, boards)),
    truth (file, unanswered, errors (points, direct_rms_mm, placed_rms_mm, oracle_rms_mm,
      direct_ratio, placed_ratio)))
failure: why there is no answer; conversion_error_px: of the method's rays as a ray field";

/// Names of the files written, in the output folder.
const FILES: [&str; 3] = ["comparison.json", "comparison.csv", "comparison.md"];

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct MethodsArgs {
    /// The folder with dataset.toml
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// A folder for the results as files
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Folds of the held-out check, by pose: 2 or more
    #[arg(long, default_value_t = 5, value_name = "N", value_parser = clap::value_parser!(u16).range(2..))]
    pub folds: u16,
    /// Replace results that stand in the output folder
    #[arg(long)]
    pub force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &MethodsArgs, console: &Console) -> Result<Outcome, Error> {
    if let Some(folder) = &args.output {
        check_results_folder(folder, &FILES, args.force)?;
    }
    let dataset = Dataset::load(&args.dataset)?;
    say_what_is_used(&dataset, console);
    let detect = calib_recording::detect::DetectSettings::default();
    let corners = pipeline::corners(&dataset, &detect, console.progress())?;
    let folds = usize::from(args.folds);
    let comparison = compare(&dataset, &corners, folds, console.progress())?;
    for method in &comparison.methods {
        console.detail(&format!(
            "{}: {:.1} s with its folds",
            method.title,
            method.time.as_secs_f64()
        ));
    }
    if let Some(folder) = &args.output {
        write(folder, &comparison)?;
    }
    console.result(&words::text(&comparison), &comparison);
    Ok(Outcome::Done)
}

/// All three files, or none.
fn write(folder: &Path, comparison: &Comparison) -> Result<(), Error> {
    let mut json = serde_json::to_vec_pretty(comparison)?;
    json.push(b'\n');
    let csv = words::csv(comparison);
    let page = words::markdown(comparison);
    let contents = [json.as_slice(), csv.as_bytes(), page.as_bytes()];
    let existed = folder.exists();
    make_folder(folder)?;
    let set: Vec<(PathBuf, &[u8])> = FILES
        .iter()
        .map(|name| folder.join(name))
        .zip(contents)
        .collect();
    if let Err(error) = write_set(&set) {
        if !existed {
            // Only if it is empty, and only the innermost: then it is the one just made.
            let _ = std::fs::remove_dir(folder);
        }
        return Err(error.into());
    }
    Ok(())
}
