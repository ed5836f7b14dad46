//! `import`: a calibration by another tool as ours.

use super::Outcome;
use super::error::Error;
use super::foreign_args::ForeignArgs;
use super::import_corners::{self, CornerArgs};
use super::output::Console;
use super::place::{check_file, place_in_words};
use super::usage_error::UsageError;
use crate::report::facts::Facts;
use crate::report::import::{record, summary};
use crate::report::record::ImportRecord;
use calib_exchange::{ForeignRig, Naming};
use calib_recording::atomic_file;
use calib_recording::dataset::identity::hex;
use clap::Args;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline import left.yml right.yml extrinsics.yml --unit mm -o calibration.json
  calib-offline import camchain.yaml -o calibration.json
  calib-offline import left.cameramodel right.cameramodel -o calibration.json
  calib-offline import corners.vnl --board 10x10 --images left=left-*.jpg -o recordings/monday/corners.csv";

const FORMATS: &str = "\
FILE is of OpenCV (FileStorage: YAML, XML or JSON), ROS (camera_info YAML), Kalibr (camchain.yaml), mrcal
(.cameramodel), COLMAP (cameras.txt), MATLAB (parameters as JSON) or DICe (XML); which one is found from what it
holds. All files are of one rig. Where a file says no unit, no size, no model or no direction, it is asked, and
never guessed. docs/EXCHANGE.md has what each format holds and what is lost.

CALIBRATION.json is read by every command: pack, measure, rays, export, compare, inspect, audit. It holds no
corners and no uncertainty, so that verify refuses it and points have no sigma. Its frame is the file's. An
earlier one is replaced only with --force.

With -o NAME.csv the files hold corners: a table (--columns), mrcal's .vnl, or image_points of OpenCV's calibration
sample (the camera by --names, else as the file). They become corners.csv of a dataset.

With --json, schema calib-offline/import/1:
  output
  format, files, lost    lost: sentences
  working_distance_mm    as said; else null
  cameras (name, model, rms_px, max_px)
                         by how much the rays differ from the model
or, of corners, schema calib-offline/import-corners/1:
  output, cameras, poses, corners";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct ImportArgs {
    /// The files of one rig by another tool
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// Where to write the calibration, or corners.csv for corners
    #[arg(short, long, value_name = "CALIBRATION.json")]
    pub output: PathBuf,
    /// What the files do not say.
    #[command(flatten)]
    pub foreign: ForeignArgs,
    /// What files of corners do not say.
    #[command(flatten)]
    pub corners: CornerArgs,
    /// Take this camera alone
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// How far from the cameras things are measured; needed where rays do not meet in a point
    #[arg(long, value_name = "MM", value_parser = parse_distance)]
    pub distance_mm: Option<f64>,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct ImportObject<'a> {
    schema: &'static str,
    output: &'a Path,
    #[serde(flatten)]
    imported: &'a ImportRecord,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &ImportArgs, console: &Console) -> Result<Outcome, Error> {
    if args
        .output
        .extension()
        .is_some_and(|ending| ending == "csv")
    {
        let names = &args.foreign.names;
        let force = args.force;
        import_corners::run(
            &args.files,
            &args.output,
            &args.corners,
            names,
            force,
            console,
        )?;
        return Ok(Outcome::Done);
    }
    let inputs: Vec<&Path> = args.files.iter().map(PathBuf::as_path).collect();
    // No start that all calibrations have: one is replaced only when that is asked for.
    check_file(&args.output, b"\0", &inputs, args.force)?;
    let naming = Naming {
        names: args.foreign.names(),
        only: args.camera.clone(),
        may_stand_anywhere: false,
    };
    let foreign = ForeignRig::read(&args.files, &args.foreign.options(), &naming)?;
    if !foreign.is_central() && args.distance_mm.is_none() {
        return Err(UsageError::NeedsDistance.into());
    }
    console.progress().begin("rays", 0);
    let converted = foreign.rays(args.distance_mm);
    console.progress().end();
    let calibration = record(
        &foreign,
        &converted?,
        sha256(&args.files)?,
        args.distance_mm,
    );
    atomic_file::write(&args.output, &calibration.to_json()?)?;
    if let Some(imported) = &calibration.imported {
        let object = ImportObject {
            schema: "calib-offline/import/1",
            output: &args.output,
            imported,
        };
        let words = format!(
            "{}written to {}",
            summary(imported, &Facts::of(&calibration)),
            place_in_words(&args.output)
        );
        console.result(&words, &object);
    }
    Ok(Outcome::Done)
}

/// Of all files, one after the other.
fn sha256(files: &[PathBuf]) -> Result<String, Error> {
    let mut hash = Sha256::new();
    for file in files {
        let bytes = std::fs::read(file)
            .map_err(|error| calib_exchange::Problem::Read(error.to_string()).in_file(file))?;
        hash.update(bytes);
    }
    Ok(hex(&hash.finalize()))
}

/// A distance from the command line, mm.
pub(super) fn parse_distance(text: &str) -> Result<f64, String> {
    let distance_mm = text
        .parse::<f64>()
        .ok()
        .filter(|mm| *mm > 0.0 && mm.is_finite());
    distance_mm.ok_or_else(|| "give a distance above 0, mm".to_owned())
}
