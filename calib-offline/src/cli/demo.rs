//! `demo`: the whole chain on the data that comes with the program.

use super::Outcome;
use super::calibrate::{
    FILES, Written, blob_max_error_px, pack_settings, say_what_is_used, write_results,
};
use super::error::Error;
use super::output::Console;
use super::usage_error::UsageError;
use crate::demo::device::{check_cortex_m, check_simulated, corner_pairs, known_pairs};
use crate::demo::page::{Entry, page};
use crate::demo::unseen::measure_unseen;
use crate::demo::{DemoError, DeviceCheck, Measured, words};
use crate::pipeline::{self, CalibrateSettings, Checked};
use crate::report::facts::Facts;
use crate::report::record::Grade;
use crate::report::{BlobFacts, text};
use calib_blob::matches::{BlobSource, read_known};
use calib_blob::pack::{AlignedBytes, BlobError};
use calib_estimate::adjust::Observations;
use calib_judge::Folds;
use calib_judge::known_points::KnownPoints;
use calib_rays::measure::PointSource;
use calib_recording::atomic_file::{self, check_folder};
use calib_recording::dataset::Dataset;
use clap::Args;
use ray_runtime::RayBlob;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline demo
  calib-offline demo -o demo-results";

const FORMATS: &str = "\
For each dataset: corners are detected, the cameras calibrated, the blob packed and opened by the
device's runtime, and points measured with it: held-out boards, each with a blob that was made
without it; where the truth is known, matches.csv and holdout.csv against it. The simulated device
(and the Cortex-M image in QEMU, if it has been built) is flashed and must give the host's bits.

-o holds index.html, and per dataset calibration.json, rig.rays and report.html.
Exit code 1: a verdict is fail, or a device gave other bits than the host.

With --json, schema calib-offline/demo/1:
  index
  datasets (dataset, the facts of calibrate, report, blob (as of calibrate), measured (
    unseen_boards (folds, square_mm, blob_error_px, as_recorded/as_used (pairs,
      neighbor_rms_percent, neighbor_rms_mm, neighbor_median_percent, rigid_rms_mm, points,
      outside, unmet)),
    known_points (file, matches, without_point, errors (points, direct_rms_mm, placed_rms_mm,
      oracle_rms_mm, direct_ratio, placed_ratio)),
    devices (device, slot, self_tests, matches, points, different),
    no_cortex_m))
as_used: without the pairs that the calibration leaves out; self_tests: equal, and all; no_cortex_m:
why there is no Cortex-M among the devices";

/// The datasets of the demo, folders of `data/`.
const DATASETS: [&str; 2] = ["opencv-stereo", "stage"];

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct DemoArgs {
    /// The folder for the results; earlier results of the demo in it are replaced
    #[arg(short, long, value_name = "DIR", default_value = "demo-results")]
    pub output: PathBuf,
    /// The folder with the datasets [default: data, here or beside the program's source]
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct DemoObject {
    schema: &'static str,
    index: PathBuf,
    datasets: Vec<DatasetObject>,
}

#[derive(Debug, Serialize)]
struct DatasetObject {
    dataset: PathBuf,
    #[serde(flatten)]
    facts: Facts,
    report: PathBuf,
    blob: BlobFacts,
    measured: Measured,
}

/// Runs the command.
///
/// # Errors
/// [`Error`] of the first dataset that fails; results of the datasets before it stand.
pub fn run(args: &DemoArgs, console: &Console) -> Result<Outcome, Error> {
    check_folder(&args.output)?;
    let data = data_folder(args.data.as_deref())?;
    let (mut words, mut datasets) = (String::new(), Vec::new());
    for name in DATASETS {
        let (object, summary) = run_dataset(&data.join(name), &args.output.join(name), console)?;
        // Writing to a String cannot fail.
        let _ = write!(words, "{name}\n{summary}\n");
        datasets.push(object);
    }
    let entries: Vec<Entry> = DATASETS
        .iter()
        .zip(&datasets)
        .map(|(name, object)| Entry {
            name,
            verdict: object.facts.verdict.word(),
            measured: &object.measured,
            report: format!("{name}/{}", FILES[2]),
        })
        .collect();
    let index = args.output.join("index.html");
    atomic_file::write(&index, page(&entries).as_bytes())?;
    let _ = writeln!(words, "all of it: {}", index.display());
    let is_good = |object: &DatasetObject| {
        object.facts.verdict != Grade::Fail
            && object.measured.devices.iter().all(DeviceCheck::is_equal)
    };
    let outcome = if datasets.iter().all(is_good) {
        Outcome::Done
    } else {
        Outcome::VerdictFail
    };
    let object = DemoObject {
        schema: "calib-offline/demo/1",
        index,
        datasets,
    };
    console.result(&words, &object);
    Ok(outcome)
}

/// The chain on one dataset; what came of it, also in words.
fn run_dataset(
    folder: &Path,
    place: &Path,
    console: &Console,
) -> Result<(DatasetObject, String), Error> {
    let dataset = Dataset::load(folder)?;
    console.narrate(&format!("dataset {}", folder.display()));
    say_what_is_used(&dataset, console);
    let settings = CalibrateSettings::default();
    let corners = pipeline::corners(&dataset, &settings.detect, console.progress())?;
    let Checked {
        mut calibration,
        offered,
        folds,
        ..
    } = pipeline::calibrate_corners(&dataset, &corners, &settings, console.progress())?;
    calibration.command = Some("calib-offline demo".to_owned());
    let written = write_results(place, calibration.into(), console)?;
    console.progress().begin("measuring with the blob", 0);
    let measured = measure(folder, &written, &folds, &offered);
    console.progress().end();
    let measured = measured?;
    let report = place.join(FILES[2]);
    let mut summary = text::summary(&written.calibration, Some(&written.blob));
    for (name, fact) in words::lines(&measured) {
        // Writing to a String cannot fail.
        let _ = writeln!(summary, "{name:<15} {fact}");
    }
    let _ = writeln!(summary, "{:<15} {}", "report", report.display());
    let object = DatasetObject {
        dataset: folder.to_owned(),
        facts: Facts::of(&written.calibration),
        report,
        blob: written.blob,
        measured,
    };
    Ok((object, summary))
}

/// Measures with the blob as it stands on the disk, and with those of the folds.
fn measure(
    folder: &Path,
    written: &Written,
    folds: &Folds,
    offered: &Observations,
) -> Result<Measured, Error> {
    let calibration = &written.calibration;
    let settings = pack_settings(calibration, blob_max_error_px(calibration));
    let unseen_boards = measure_unseen(folds, offered, &settings)?;
    let [_, rays, _] = &written.files;
    let bytes = read(rays)?;
    let blob = RayBlob::open(&bytes).map_err(DemoError::Open)?;
    let (mut known_points, mut pairs) = (Vec::new(), Vec::new());
    // Without a frame there is always a source.
    if let Some(source) = BlobSource::new(&blob, None) {
        let known = read_known(folder, &source.cameras())?;
        known_points.extend(known.iter().map(|known| KnownPoints::of(&source, known)));
        pairs = known_pairs(&known);
    }
    if pairs.is_empty() {
        pairs = corner_pairs(calibration);
    }
    let mut devices = vec![check_simulated(&bytes, &pairs)?];
    let mut no_cortex_m = None;
    match check_cortex_m(&bytes, &pairs) {
        Ok(check) => devices.push(check),
        Err(reason) => no_cortex_m = Some(reason),
    }
    Ok(Measured {
        unseen_boards,
        known_points,
        devices,
        no_cortex_m,
    })
}

fn read(file: &Path) -> Result<AlignedBytes, Error> {
    calib_blob::pack::read_aligned(file).map_err(|source| {
        Error::Blob(BlobError::Read {
            file: file.to_owned(),
            source,
        })
    })
}

/// Where the datasets are: as asked for, in the working folder, or in the source tree.
fn data_folder(asked: Option<&Path>) -> Result<PathBuf, Error> {
    let candidates = match asked {
        Some(folder) => vec![folder.to_owned()],
        None => vec![
            PathBuf::from("data"),
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../data"),
        ],
    };
    let is_there = |folder: &&PathBuf| folder.join(DATASETS[0]).is_dir();
    match candidates.iter().find(is_there) {
        Some(folder) => Ok(folder.clone()),
        None => Err(Error::Usage(UsageError::NotFound {
            path: candidates[0].join(DATASETS[0]),
        })),
    }
}
