//! `verify`: whether an old calibration still holds, by a few new poses.

use super::Outcome;
use super::calibrate::say_what_is_used;
use super::error::Error;
use super::output::Console;
use super::rig_file::RigFile;
use super::usage_error::UsageError;
use crate::pipeline::{self, Verified};
use crate::present::numbers::short;
use crate::present::table::Table;
use crate::report::record::Grade;
use calib_judge::validity::{MeasuredBoards, Validity};
use calib_recording::dataset::Dataset;
use calib_recording::detect::DetectSettings;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

const EXAMPLE: &str = "\
Example:
  calib-offline verify results/monday/calibration.json recordings/friday";

const FORMATS: &str = "\
CALIBRATION is a calibration.json; DATASET holds a few new poses of its board, three tilted ones, near and
far, by the same cameras: images or corners.csv. Nothing is written, and nothing is calibrated again: the old
rig is held as well as its own corners hold it, and named changes compete for the new ones.

The verdict is \"fail\" (exit code 1) if something changed that costs more than the limit, which is twice what
the calibration leaves open of points; \"doubtful\" if too little is seen, or the new boards contradict
each other; else \"pass\".

With --json, schema calib-offline/verify/1; a figure that does not apply is null:
  verdict, reasons
  cause                          code of what lowered the verdict, as of calibrate
  cost_mm, limit_mm, left_open_mm
                                 RMS of points at the distances of the calibration: error by all that changed,
                                 its limit, and what the calibration leaves open
  unnoticed_mm                   what a single change may cost and go unnoticed
  distances_mm                   of the calibration's boards: least, middle, largest
  causes (cause, since_pose, size, cost_mm, text, grade, evidence, amounts (camera, what, value, sd, unit))
                                 what changed, most important first; evidence: twice the log Bayes factor;
                                 amounts: after minus before, directions seen from behind the camera
  cannot_tell                    sentences
  poses                          new poses used
  cameras (name, corners, share)
                                 share: area of the new corners over the calibrated one
  rms_px, old_rms_px             residual vectors of the new corners without what changed, and of the old
  boards/old_boards (points, neighbor_rms_mm, neighbor_noise_mm, scale_percent, gap_rms_mm)
                                 new boards and the calibration's, measured with the old rig: distance error of
                                 neighboring corners, what noise makes of it, its mean, gap of rays";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct VerifyArgs {
    /// The old calibration.json
    #[arg(value_name = "CALIBRATION")]
    pub calibration: PathBuf,
    /// The folder with dataset.toml of the new poses
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// Leave these new poses out
    #[arg(long, value_name = "POSE", value_delimiter = ',')]
    pub exclude: Vec<usize>,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct VerifyObject {
    schema: &'static str,
    #[serde(flatten)]
    validity: Validity,
}

/// Runs the command.
///
/// # Errors
/// [`Error`].
pub fn run(args: &VerifyArgs, console: &Console) -> Result<Outcome, Error> {
    let RigFile::Calibration(calibration) = RigFile::read(&args.calibration)? else {
        let path = args.calibration.clone();
        return Err(UsageError::BlobWithoutCorners { path }.into());
    };
    let mut dataset = Dataset::load(&args.dataset)?;
    dataset.excluded_poses.extend(&args.exclude);
    say_what_is_used(&dataset, console);
    let corners = pipeline::corners(&dataset, &DetectSettings::default(), console.progress())?;
    let Verified {
        validity,
        from_file_mm,
    } = pipeline::verify(&calibration, &dataset, &corners, console.progress())?;
    if let Some(mm) = from_file_mm.filter(|mm| *mm > validity.limit_mm) {
        console.warn(&format!(
            "the joint estimate from the old corners differs from the calibration in the file by {} mm RMS (method {}, \
             version {}): what is said holds for the estimate",
            short(mm),
            calibration.method,
            calibration.tool_version
        ));
    }
    let object = VerifyObject {
        schema: "calib-offline/verify/1",
        validity,
    };
    console.result(&words(&object.validity), &object);
    Ok(match object.validity.verdict {
        Grade::Fail => Outcome::VerdictFail,
        Grade::Pass | Grade::Doubtful => Outcome::Done,
    })
}

/// For a terminal.
fn words(found: &Validity) -> String {
    let mut lines = vec![format!("verdict: {}", found.verdict)];
    lines.extend(found.reasons.iter().map(|reason| format!("  {reason}")));
    lines.push("what the data cannot tell:".to_owned());
    lines.extend(found.cannot_tell.iter().map(|said| format!("  {said}")));
    lines.push(format!(
        "residuals: {} px RMS on {} new poses without what changed, {} px in the calibration",
        short(found.rms_px),
        found.poses.len(),
        short(found.old_rms_px)
    ));
    for camera in &found.cameras {
        lines.push(format!(
            "camera {}: {} new corners on {:.0} % of its calibrated area",
            camera.name,
            camera.corners,
            100.0 * camera.share
        ));
    }
    let mut table = Table::new([
        "measured with the old rig",
        "points",
        "length error, mm",
        "by noise",
        "scale, %",
        "gap, mm",
    ]);
    let rows = [("new boards", found.boards), ("its own", found.old_boards)];
    let mut any = false;
    for (name, boards) in rows {
        if let Some(MeasuredBoards {
            points,
            neighbor_rms_mm,
            neighbor_noise_mm,
            scale_percent,
            gap_rms_mm,
        }) = boards
        {
            any = true;
            table.push(vec![
                name.to_owned(),
                points.to_string(),
                short(neighbor_rms_mm),
                short(neighbor_noise_mm),
                format!("{scale_percent:+.3}"),
                short(gap_rms_mm),
            ]);
        }
    }
    let table = if any { table.text() } else { String::new() };
    lines.join("\n") + "\n" + &table
}
