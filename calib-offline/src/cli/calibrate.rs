//! `calibrate`: a dataset to `calibration.json`, `rig.rays` and `report.html`.

use super::Outcome;
use super::asked_for::asked_for;
use super::error::Error;
use super::match_noise::parse;
use super::output::Console;
use super::place::check_results_folder;
use super::usage_error::UsageError;
use crate::methods::{self, Method};
use crate::pipeline::{CalibrateError, CalibrateSettings, Calibrated};
use crate::report::facts::Facts;
use crate::report::record::{ExpectedError, Grade};
use crate::report::{BlobFacts, Calibration, html, text};
use calib_blob::pack::{PackError, PackSettings, Packed, Packer};
use calib_exchange::dense::array_name;
use calib_rays::field::Rig;
use calib_rays::progress::Progress;
use calib_recording::atomic_file::{make_folder, write_set};
use calib_recording::dataset::Dataset;
use clap::{Args, ValueEnum};
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline calibrate recordings/monday -o results/monday
  calib-offline calibrate recordings/monday -o results/without --exclude 3,17
  calib-offline calibrate recordings/monday -o results/monday --task 'length 100 mm at 800 mm'";

const FORMATS: &str = "\
DATASET is a folder with dataset.toml and corners.csv or images; corners win. The output folder is
made if need be and then holds calibration.json (every number), rig.rays (the blob for the device)
and report.html. Results that stand there already are replaced only with --force.

With --ray-tables it holds rays_NAME.npy too: for each pixel (row, column) six numbers in double
precision, a point of its ray nearest to the camera (mm) and the unit direction into the scene, both in the
rig's frame; NaN where there is no ray. Those of --method alternating are its own, pixel by pixel.

With --task 'length 100 mm at 800 mm' the expected error of that measurement is part of all results: its standard
deviation and 95 % limit from the joint covariance of both ends, RMS over places in the calibrated area at that
distance from the first camera and seven directions at each (its u, v and optical axis, and four diagonals), and
the worst line. Its shares add up in squares: pixel noise (--match-noise-px, else that of the corners), calibration, board's
scale, shape and temperature. What [board.certificate] does not say of scale and temperature is not in it.

With --json, schema calib-offline/calibrate/1; a figure that does not apply is null:
  verdict, reasons
  causes (cause, since_pose, size, cost_mm, text, grade)
                                 what was found about the recording, most likely first; cost_mm: RMS error
                                 that it leaves in points; grade: the best verdict that it allows
  task (length_mm, distance_mm, sd_mm, error95_mm, worst (direction, middle_px, sd_mm, error95_mm),
    shares_mm (pixel_noise, calibration, board_scale, board_shape, temperature), if_ends_independent_mm,
    directions (direction, lines, sd_mm), places, lines, pixel_noise_px)
                                 null without --task; sd_mm: RMS over lines; direction: along-u, along-v, depth
                                 or diagonal; a share is null where the certificate does not say;
                                 if_ends_independent_mm: sd_mm, did the errors of the ends not go together
  held_out_neighbor_percent, held_out_neighbor_mm, held_out_rigid_mm, held_out_rms_px
  half_data_mm, half_data_ratio  points of two calibrations from half of the poses: RMS difference,
                                 and over what was predicted
  central_model_mm               RMS by which a central model would move points; 0 if central
  rms_px, sigma_px
  cameras (name, sensor_px, covered_share, views, focal_px, principal_point_px, pinhole_rms_px, central,
    centrality_rms_mm, offset_numbers)
                                 of the pinhole nearest to the rays: focal lengths, principal point and by how much
                                 it misses them; offset_numbers: used, and all
  baseline_mm, axes_angle_deg    from the first camera to each other one, between these pinholes
  working_distance_mm (least, median, most)
  poses_used, views_used, left_out, corners_used, corners_rejected
  blob (bytes, max_error_px, max_error_mm, wanted_error_px, search_ended_early,
    curve (bytes, error_px, error_mm))
                                 mm at the working distance; larger than wanted only where no table
                                 tried holds it, or the search ended at the work that packing may
                                 take; curve: other sizes of all tables
  calibration, rig, report       the three files";

/// The blob's bound unless `pack` is asked for another: this share of the corners' standard deviation adds a
/// ten-thousandth to the variance of a pixel ...
const BLOB_NOISE_SHARE: f64 = 0.01;
/// ... and at least so much, px: well below the noise of any corner.
const BLOB_LEAST_BOUND_PX: f64 = 0.001;

/// The blob's bound unless `pack` is asked for another, px.
pub fn blob_max_error_px(calibration: &Calibration) -> f64 {
    (BLOB_NOISE_SHARE * calibration.estimate.sigma_px).max(BLOB_LEAST_BOUND_PX)
}

/// Names of the files written, in the output folder.
pub const FILES: [&str; 3] = ["calibration.json", "rig.rays", "report.html"];

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct CalibrateArgs {
    /// The folder with dataset.toml
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// The folder for the results
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// How to estimate
    #[arg(long, default_value = "joint")]
    pub method: MethodArg,
    /// Leave these poses out, besides those that the manifest leaves out
    #[arg(long, value_name = "POSE", value_delimiter = ',')]
    pub exclude: Vec<usize>,
    /// How noisy the pixels of matches will be: standard deviation of a coordinate, px
    /// [default: as the corners]
    #[arg(long, value_name = "S", value_parser = parse)]
    pub match_noise_px: Option<f64>,
    /// Predict the error of a measurement, such as "length 100 mm at 800 mm"
    #[arg(long, value_name = "TASK")]
    pub task: Option<String>,
    /// Write one ray per pixel of each camera too: `rays_NAME.npy`
    #[arg(long)]
    pub ray_tables: bool,
    /// Replace results that stand in the output folder
    #[arg(long)]
    pub force: bool,
}

/// Which estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodArg {
    /// All cameras and poses together.
    Joint,
    /// The published procedure.
    Alternating,
}

impl MethodArg {
    const fn method(self) -> &'static dyn Method {
        match self {
            Self::Joint => &methods::Joint,
            Self::Alternating => &methods::Alternating,
        }
    }
}

/// What estimates: `pipeline::calibrate`, or a stand-in in tests.
pub type Estimate<'a> =
    &'a dyn Fn(&Dataset, &CalibrateSettings, &dyn Progress) -> Result<Calibrated, CalibrateError>;

/// A calibration and where its files are.
#[derive(Debug)]
pub struct Written {
    /// The result.
    pub calibration: Calibration,
    /// The blob's size and error.
    pub blob: BlobFacts,
    /// The three files, in the order of [`FILES`].
    pub files: [PathBuf; 3],
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct CalibrateObject<'a> {
    schema: &'static str,
    #[serde(flatten)]
    facts: Facts,
    task: Option<&'a ExpectedError>,
    blob: BlobFacts,
    calibration: &'a Path,
    rig: &'a Path,
    report: &'a Path,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(
    args: &CalibrateArgs,
    console: &Console,
    estimate: Estimate<'_>,
) -> Result<Outcome, Error> {
    let task = args.task.as_ref().map(|words| words.parse()).transpose();
    let task = task.map_err(UsageError::Task)?;
    check_results_folder(&args.output, &FILES, args.force)?;
    let mut dataset = Dataset::load(&args.dataset)?;
    if args.ray_tables {
        let names: Vec<String> = dataset
            .cameras
            .iter()
            .map(|c| array_name(&c.name))
            .collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        check_results_folder(&args.output, &names, args.force)?;
    }
    dataset.excluded_poses.extend(&args.exclude);
    let settings = CalibrateSettings {
        method: args.method.method(),
        ray_tables: args.ray_tables,
        match_noise_px: args.match_noise_px,
        task,
        command: Some(command(args, &dataset)),
        ..CalibrateSettings::default()
    };
    let written = calibrate_into(&args.output, &dataset, &settings, console, estimate)?;
    let [calibration, rig, report] = &written.files;
    let object = CalibrateObject {
        schema: "calib-offline/calibrate/1",
        facts: Facts::of(&written.calibration),
        task: written.calibration.task.as_ref(),
        blob: written.blob.clone(),
        calibration,
        rig,
        report,
    };
    let words = text::summary(&written.calibration, Some(&written.blob));
    console.result(&words, &object);
    console.narrate(&format!(
        "look at {}; then: calib-offline measure {} MATCHES.csv -o POINTS.csv",
        report.display(),
        rig.display()
    ));
    Ok(match object.facts.verdict {
        Grade::Fail => Outcome::VerdictFail,
        Grade::Pass | Grade::Doubtful => Outcome::Done,
    })
}

/// What was asked for, for the record.
fn command(args: &CalibrateArgs, dataset: &Dataset) -> String {
    let method = match args.method {
        MethodArg::Joint => None,
        MethodArg::Alternating => Some("alternating".to_owned()),
    };
    let poses: Vec<String> = args.exclude.iter().map(ToString::to_string).collect();
    let flags = [
        ("--method", method),
        ("--exclude", (!poses.is_empty()).then(|| poses.join(","))),
        (
            "--match-noise-px",
            args.match_noise_px.map(|px| px.to_string()),
        ),
        ("--task", args.task.clone()),
    ];
    asked_for("calibrate", &dataset.folder, &flags)
}

/// Estimates, then [`write_results`].
///
/// # Errors
/// [`Error`], with nothing written.
pub fn calibrate_into(
    folder: &Path,
    dataset: &Dataset,
    settings: &CalibrateSettings,
    console: &Console,
    estimate: Estimate<'_>,
) -> Result<Written, Error> {
    say_what_is_used(dataset, console);
    let calibrated = estimate(dataset, settings, console.progress())?;
    write_results(folder, calibrated, console)
}

/// Says so if there are images that nobody looks at.
pub fn say_what_is_used(dataset: &Dataset, console: &Console) {
    if dataset.corners_path().exists() && dataset.has_images() {
        console.narrate("there are images and corners.csv: the corners are used");
    }
}

/// Packs, draws the report and writes the three files together.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn write_results(
    folder: &Path,
    calibrated: Calibrated,
    console: &Console,
) -> Result<Written, Error> {
    let Calibrated {
        calibration,
        ray_tables,
    } = calibrated;
    let max_error_px = blob_max_error_px(&calibration);
    let settings = pack_settings(&calibration, max_error_px);
    let packed = watched(&calibration.rig, &settings, console, Packer::nearest)?;
    let blob = BlobFacts::new(&packed, max_error_px);
    if let Some(warning) = blob.warning() {
        console.warn(&warning);
    }
    let json = calibration.to_json()?;
    let page = html::page(&calibration, Some(&blob));
    let files = FILES.map(|name| folder.join(name));
    let existed = folder.exists();
    make_folder(folder)?;
    let contents = [json.as_slice(), packed.bytes.as_slice(), page.as_bytes()];
    let cameras = calibration.rig.cameras.iter();
    let tables: Vec<(PathBuf, Vec<u8>)> = cameras
        .zip(&ray_tables)
        .map(|(camera, table)| (folder.join(array_name(&camera.name)), table.to_npy()))
        .collect();
    let set: Vec<(PathBuf, &[u8])> = files
        .iter()
        .cloned()
        .zip(contents)
        .chain(
            tables
                .iter()
                .map(|(path, bytes)| (path.clone(), &bytes[..])),
        )
        .collect();
    if let Err(error) = write_set(&set) {
        if !existed {
            // Only if it is empty, and only the innermost: then it is the one just made.
            let _ = std::fs::remove_dir(folder);
        }
        return Err(error.into());
    }
    Ok(Written {
        calibration,
        blob,
        files,
    })
}

/// Packs while the console shows how far it is.
///
/// # Errors
/// What packing gives.
pub fn watched<'a>(
    rig: &'a Rig,
    settings: &PackSettings,
    console: &'a Console,
    pack: impl FnOnce(&mut Packer<'a>) -> Result<Packed, PackError>,
) -> Result<Packed, PackError> {
    let progress = console.progress();
    progress.begin("packing the blob", 0);
    let packed = Packer::new(rig, settings, progress).and_then(|mut packer| pack(&mut packer));
    progress.end();
    packed
}

/// How a calibration is packed: at its working distance, under its own identity.
pub fn pack_settings(calibration: &Calibration, max_error_px: f64) -> PackSettings {
    let working_distance_mm = Facts::of(calibration)
        .working_distance_mm
        .map_or(PackSettings::default().working_distance_mm, |d| d.median);
    PackSettings {
        max_error_px,
        working_distance_mm,
        identity: calibration.identity(),
        ..PackSettings::default()
    }
}

#[cfg(test)]
mod tests;
