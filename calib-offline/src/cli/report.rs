//! `report`: the page of a calibration, drawn again from its record alone.

use super::Outcome;
use super::error::Error;
use super::output::Console;
use super::place::{check_file, place_in_words};
use super::rig_file::RigFile;
use super::usage_error::UsageError;
use crate::report::html;
use calib_recording::atomic_file;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline report results/calibration.json";

const FORMATS: &str = "\
Takes neither images nor corners: calibration.json holds all that the page shows. An earlier page is
replaced; any other file only with --force. The size of a blob that was packed with the calibration is
not on the page.

With --json, schema calib-offline/report/1:
  calibration, output, bytes";

/// How every page begins.
const START: &[u8] = b"<!DOCTYPE html>";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct ReportArgs {
    /// A calibration.json
    #[arg(value_name = "CALIBRATION.json")]
    pub calibration: PathBuf,
    /// Where to write the page [default: report.html beside the calibration]
    #[arg(short, long, value_name = "REPORT.html")]
    pub output: Option<PathBuf>,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct ReportObject<'a> {
    schema: &'static str,
    calibration: &'a Path,
    output: &'a Path,
    bytes: usize,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &ReportArgs, console: &Console) -> Result<Outcome, Error> {
    let output = match &args.output {
        Some(output) => output.clone(),
        None => args.calibration.with_file_name("report.html"),
    };
    check_file(&output, START, &[&args.calibration], args.force)?;
    let RigFile::Calibration(calibration) = RigFile::read(&args.calibration)? else {
        return Err(Error::Usage(UsageError::UnknownKind {
            path: args.calibration.clone(),
            expected: "a calibration: a blob does not hold what a report shows",
        }));
    };
    let page = html::page(&calibration, None);
    atomic_file::write(&output, page.as_bytes())?;
    let object = ReportObject {
        schema: "calib-offline/report/1",
        calibration: &args.calibration,
        output: &output,
        bytes: page.len(),
    };
    console.result(&format!("written to {}", place_in_words(&output)), &object);
    Ok(Outcome::Done)
}
