//! `detect` and `simulate` on the console: where `corners.csv` goes, and how the outcome is told.

use super::Outcome;
use super::detect::{DetectArgs, run as run_detect};
use super::detect_target::run as run_detect_target;
use super::error::Error;
use super::output::Console;
use super::simulate::{SimulateArgs, SimulateSummary, run as run_simulate};
use super::usage_error::UsageError;
use crate::present::numbers::short;
use calib_recording::atomic_file::{check_folder, check_place};
use calib_recording::dataset::{Dataset, SufficiencyError, write_corners};
use serde::Serialize;
use std::path::Path;

/// Finds the corners of a dataset's images and writes `corners.csv`.
///
/// # Errors
/// [`Error`]; without a single usable image nothing is written.
pub(super) fn detect(args: &DetectArgs, console: &Console) -> Result<Outcome, Error> {
    let dataset = Dataset::load(&args.dataset)?;
    if args.target {
        return detect_target(args, &dataset, console);
    }
    let path = dataset.corners_path();
    check_output(args, &path)?;
    let report = run_detect(args, &dataset, console.progress())?;
    if report.views.is_empty() {
        console.narrate(&report.object.in_words());
        return Err(SufficiencyError::NoCorners.into());
    }
    write_corners(&path, &dataset, &report.views)?;
    let words = format!(
        "{}; written to {}",
        report.object.in_words(),
        path.display()
    );
    console.result(&words, &report.object);
    console.narrate(&format!(
        "then: calib-offline calibrate {} -o RESULTS",
        args.dataset.display()
    ));
    Ok(Outcome::Done)
}

/// Finds the markers of a dataset's measurement target and writes `markers.csv`.
fn detect_target(
    args: &DetectArgs,
    dataset: &Dataset,
    console: &Console,
) -> Result<Outcome, Error> {
    let path = dataset.markers_path();
    check_output(args, &path)?;
    let narrate = |text: &str| console.narrate(text);
    let report = run_detect_target(args, dataset, console.progress(), narrate)?;
    write_corners(&path, dataset, &report.views)?;
    let words = format!(
        "{}; written to {}",
        report.object.in_words(),
        path.display()
    );
    console.result(&words, &report.object);
    Ok(Outcome::Done)
}

/// Refuses a table that exists (unless `--force`) and places that cannot be written to.
fn check_output(args: &DetectArgs, path: &Path) -> Result<(), Error> {
    check_place(path)?;
    if path.exists() && !args.force {
        let path = path.to_owned();
        return Err(Error::Usage(UsageError::Exists { path }));
    }
    if let Some(folder) = &args.overlay {
        check_folder(folder)?;
    }
    Ok(())
}

/// What `simulate --json` prints.
#[derive(Debug, Serialize)]
struct SimulateObject {
    schema: &'static str,
    #[serde(flatten)]
    summary: SimulateSummary,
}

/// Makes a dataset with known truth.
///
/// # Errors
/// [`Error`], with nothing written.
pub(super) fn simulate(args: &SimulateArgs, console: &Console) -> Result<Outcome, Error> {
    let summary = run_simulate(args)?;
    let words = format!(
        "{} cameras, {} poses, {} corners, {} images, {} + {} matches; a perfect calibration would be off by {} mm RMS; written to {}",
        summary.camera_count,
        summary.pose_count,
        summary.corner_count,
        summary.image_count,
        summary.point_count,
        summary.holdout_count,
        short(summary.points_oracle_rms_mm),
        summary.folder.display()
    );
    let object = SimulateObject {
        schema: "calib-offline/simulate/1",
        summary,
    };
    console.result(&words, &object);
    Ok(Outcome::Done)
}
