//! `audit`: calibrations by anybody on the user's own images.

use super::Outcome;
use super::calibrate::say_what_is_used;
use super::error::Error;
use super::foreign_args::ForeignArgs;
use super::output::Console;
use super::rig_file::RigFile;
use super::usage_error::UsageError;
use crate::audit::{Candidate, audit, words};
use crate::pipeline;
use calib_exchange::{ForeignRig, Naming};
use calib_rays::geometry::SensorSize;
use calib_recording::dataset::Dataset;
use calib_recording::dataset::identity::input_sha256;
use calib_recording::detect::DetectSettings;
use clap::Args;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline audit left.yml right.yml extrinsics.yml recordings/monday --unit mm
  calib-offline audit camchain.yaml results/calibration.json recordings/monday";

const FORMATS: &str = "\
FILE is a calibration by another tool (any format that import reads) or a calibration.json; DATASET is a recording
of a board by the same cameras, images or corners.csv, with the cameras' names. Several calibrations are judged
side by side: a file with several cameras is one, the files with one camera each of one format are one together.

  px, a pose a view    RMS residual of all corners, outliers too, each view's board placed by itself; for files of
                       OpenCV from these corners it is the RMS that calibrateCamera printed
  px, a pose a board   one pose of a board for all cameras, as stereoCalibrate's RMS
  neighbors, rigid     triangulated corners: RMS error of the distance of neighbors, RMS distance from the board
  common               the same on the corners that all can answer; our own estimate never saw the boards there

A calibration's figures are held-out if it never saw these images, which files by other tools do not say.

With --json, schema calib-offline/audit/1; a figure that does not apply is null:
  tool_version, input_sha256, square_mm, poses, views, corners, folds, common_corners
  no_estimate            why there is none of ours
  conclusion             sentences
  calibrations/ours (title, files, saw_these, rms_px, together_rms_px, together_corners, unplaced_views,
    cameras (name, model, corners, unanswered, rms_px, median_px, regions (name, corners, rms_px, mean_px)),
    points (points, unanswered, neighbor_rms_mm, scale_percent, rigid_rms_mm),
    common (rms_px, neighbor_rms_mm, rigid_rms_mm),
    against_ours (residual/neighbor/rigid (ratio, low, high, boards)))
saw_these: whether it was made from these corners; scale_percent: mean error of the distance of neighbors;
mean_px: observed minus predicted; against_ours: errors over those of ours, with the 95 % interval";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct AuditArgs {
    /// The calibrations
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// The folder with dataset.toml
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// What the files do not say.
    #[command(flatten)]
    pub foreign: ForeignArgs,
    /// Leave these poses out
    #[arg(long, value_name = "POSE", value_delimiter = ',')]
    pub exclude: Vec<usize>,
    /// Folds of our own held-out check, by pose: 2 or more
    #[arg(long, default_value_t = 5, value_name = "N", value_parser = clap::value_parser!(u16).range(2..))]
    pub folds: u16,
}

/// Runs the command.
///
/// # Errors
/// [`Error`].
pub fn run(args: &AuditArgs, console: &Console) -> Result<Outcome, Error> {
    let mut dataset = Dataset::load(&args.dataset)?;
    dataset.excluded_poses.extend(&args.exclude);
    // Before images are searched, which takes longer.
    let (own, foreign): (Vec<&PathBuf>, Vec<&PathBuf>) =
        args.files.iter().partition(|file| is_ours(file));
    let foreign: Vec<PathBuf> = foreign.into_iter().cloned().collect();
    let naming = Naming {
        names: args.foreign.names(),
        only: None,
        may_stand_anywhere: true,
    };
    let rigs = ForeignRig::read_several(&foreign, &args.foreign.options(), &naming)?;
    say_what_is_used(&dataset, console);
    let corners = pipeline::corners(&dataset, &DetectSettings::default(), console.progress())?;
    let sha256 = input_sha256(&dataset, &corners.views);
    let mut candidates = Vec::new();
    for rig in rigs {
        // Rays that do not meet are held where the boards of anybody stand, more or less.
        let converted = rig.rays(None)?;
        candidates.push(matched(Candidate::foreign(rig, converted), &dataset)?);
    }
    for file in own {
        let RigFile::Calibration(calibration) = RigFile::read(file)? else {
            return Err(UsageError::BlobWithoutCorners { path: file.clone() }.into());
        };
        let name = file.display().to_string();
        let own = Candidate::own(name, *calibration, &dataset.board, &sha256);
        candidates.push(matched(own, &dataset)?);
    }
    let folds = usize::from(args.folds);
    let found = audit(&dataset, &corners, &candidates, folds, console.progress());
    console.result(&words::text(&found), &found);
    Ok(Outcome::Done)
}

/// Whether a file is a calibration of ours, or a blob.
fn is_ours(file: &Path) -> bool {
    let Ok(bytes) = std::fs::read(file) else {
        return false;
    };
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).into_owned();
    bytes.starts_with(&ray_runtime::format::MAGIC)
        || head.trim_start().starts_with("{\"schema\"") && head.contains("calib-offline/")
}

/// The dataset's cameras of a calibration, by their names, in its order.
fn matched(candidate: Candidate, dataset: &Dataset) -> Result<Candidate, UsageError> {
    let calibration = match candidate.files.first() {
        Some(file) => file.clone(),
        None => candidate.title.clone(),
    };
    let cameras = &candidate.rig.cameras;
    let order: Option<Vec<usize>> = dataset
        .cameras
        .iter()
        .map(|wanted| cameras.iter().position(|camera| camera.name == wanted.name))
        .collect();
    let Some(order) = order else {
        return Err(UsageError::AuditCameras {
            calibration,
            found: cameras.iter().map(|camera| camera.name.clone()).collect(),
            wanted: dataset
                .cameras
                .iter()
                .map(|camera| camera.name.clone())
                .collect(),
        });
    };
    let sides = |sensor: SensorSize| [sensor.width, sensor.height];
    for (wanted, place) in dataset.cameras.iter().zip(&order) {
        let found = cameras[*place].field.sensor;
        if found != wanted.sensor {
            return Err(UsageError::AuditSensor {
                calibration,
                camera: wanted.name.clone(),
                found: sides(found),
                wanted: sides(wanted.sensor),
            });
        }
    }
    Ok(candidate.ordered(&order))
}
