//! `inspect`: what a dataset, a calibration or a blob is.

use super::Outcome;
use super::error::Error;
use super::output::Console;
use super::pack::form_name;
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use crate::present::numbers::short;
use crate::report::facts::Facts;
use crate::report::text::summary;
use calib_judge::Cause;
use calib_judge::plausibility::{Dial, Sheet};
use calib_recording::capture::Capture;
use calib_recording::dataset::Dataset;
use calib_recording::dataset::identity::hex;
use calib_recording::dataset::load_corners;
use calib_recording::dataset::split::without_excluded;
use clap::Args;
use ray_runtime::format::aligned;
use ray_runtime::{MatchNoise, RayBlob};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline inspect recordings/monday
  calib-offline inspect results/monday/rig.rays --json";

const FORMATS: &str = "\
FILE is a dataset (its folder or its dataset.toml), a calibration.json or a blob. For a dataset it
says which views and which parts of the sensor are covered, and what to record besides.

With --json, kind dataset of schema calib-offline/inspect/1:
  kind, folder, rows, cols, square_mm, stage, excluded
  source     corners, images or both
  cameras (name, sensor_px, images)
  capture (poses, poses_seen_by_all, cameras (name, views, corners, corners_per_view,
    covered_share, corners_per_ninth), warnings)
             null before detect; corners_per_view: least, median, most
  dial (counterclockwise, rms_deg, largest_deg)
             null without [stage] angles_deg; the sense that larger readings turn the board in, seen
             from above in the first camera's image; found minus dialed
  causes (cause, since_pose, size, cost_mm, text, grade)
             what is wrong on its face, most likely first; as calibrate has them
With --json, kind calibration of schema calib-offline/inspect/1:
  kind, tool_version, method, input_sha256, the facts of calibrate
With --json, kind blob of schema calib-offline/inspect/1:
  kind, bytes, identity, frame, written_by, max_error_px, working_distance_mm, self_tests
  cameras (name, sensor_px, region_px, cells, form, central, position_mm)
  pairs (cameras, nodes, bytes, noise_px)    whose uncertainty it carries; the corners' noise
  match_noise_px                             what sigma is computed with; null: the corners' noise";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct InspectArgs {
    /// A dataset, a calibration.json or a blob
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct InspectObject {
    schema: &'static str,
    #[serde(flatten)]
    kind: Kind,
}

#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
enum Kind {
    Dataset(DatasetObject),
    Calibration(CalibrationObject),
    Blob(BlobObject),
}

#[derive(Debug, Serialize)]
struct DatasetObject {
    folder: PathBuf,
    rows: usize,
    cols: usize,
    square_mm: f64,
    #[serde(skip)]
    board: String,
    /// What its labels are, in one word.
    #[serde(skip)]
    points: &'static str,
    stage: bool,
    excluded: Vec<usize>,
    source: &'static str,
    cameras: Vec<DatasetCamera>,
    capture: Option<Capture>,
    dial: Option<Dial>,
    causes: Vec<Cause>,
}

#[derive(Debug, Serialize)]
struct DatasetCamera {
    name: String,
    sensor_px: [u32; 2],
    images: usize,
}

#[derive(Debug, Serialize)]
struct CalibrationObject {
    tool_version: String,
    method: String,
    input_sha256: String,
    #[serde(flatten)]
    facts: Facts,
}

#[derive(Debug, Serialize)]
struct BlobObject {
    bytes: usize,
    identity: String,
    frame: String,
    written_by: String,
    max_error_px: f32,
    working_distance_mm: f32,
    self_tests: usize,
    cameras: Vec<BlobCamera>,
    pairs: Vec<BlobPair>,
    match_noise_px: Option<f32>,
}

#[derive(Debug, Serialize)]
struct BlobCamera {
    name: String,
    sensor_px: [u32; 2],
    /// First column, first row, columns, rows.
    region_px: [u32; 4],
    cells: [u32; 2],
    form: &'static str,
    central: bool,
    position_mm: [f32; 3],
}

/// The uncertainty of two cameras.
#[derive(Debug, Serialize)]
struct BlobPair {
    cameras: [String; 2],
    nodes: [u16; 2],
    bytes: usize,
    /// Standard deviation of a pixel coordinate of the calibration's corners.
    noise_px: f32,
}

/// Runs the command.
///
/// # Errors
/// [`Error`].
pub fn run(args: &InspectArgs, console: &Console) -> Result<Outcome, Error> {
    let file = &args.file;
    let is_dataset = file.is_dir() || file.extension().is_some_and(|e| e == "toml");
    let (words, kind) = if is_dataset {
        let object = dataset_object(file)?;
        (dataset_words(&object), Kind::Dataset(object))
    } else {
        match RigFile::read(file).map_err(any_kind)? {
            RigFile::Calibration(calibration) => {
                let object = CalibrationObject {
                    tool_version: calibration.tool_version.clone(),
                    method: calibration.method.clone(),
                    input_sha256: calibration.input_sha256.clone(),
                    facts: Facts::of(&calibration),
                };
                let words = format!(
                    "calibration     by calib-offline {}, method {}, input {}\n{}",
                    object.tool_version,
                    object.method,
                    object
                        .input_sha256
                        .get(..12)
                        .unwrap_or(&object.input_sha256),
                    summary(&calibration, None)
                );
                (words, Kind::Calibration(object))
            }
            RigFile::Blob(bytes) => {
                let object = blob_object(&open(&bytes, file)?);
                (blob_words(&object), Kind::Blob(object))
            }
        }
    };
    let object = InspectObject {
        schema: "calib-offline/inspect/1",
        kind,
    };
    console.result(&words, &object);
    Ok(Outcome::Done)
}

/// A file that is no rig could have been a dataset as well.
fn any_kind(error: Error) -> Error {
    match error {
        Error::Usage(UsageError::UnknownKind { path, .. }) => {
            Error::Usage(UsageError::UnknownKind {
                path,
                expected: "a dataset folder, a dataset.toml, a calibration.json or a blob",
            })
        }
        other => other,
    }
}

fn dataset_object(path: &Path) -> Result<DatasetObject, Error> {
    let dataset = Dataset::load(path)?;
    let corners = load_corners(&dataset)?;
    let source = match (corners.is_some(), dataset.has_images()) {
        (true, true) => "both",
        (true, false) => "corners",
        (false, _) => "images",
    };
    let used = corners.map(|views| without_excluded(views, &dataset.excluded_poses).used);
    let capture = used.as_ref().map(|used| Capture::of(&dataset, used));
    let sheet = used.map_or_else(Sheet::default, |used| Sheet::of(&dataset, &used));
    Ok(DatasetObject {
        rows: dataset.board.rows,
        cols: dataset.board.cols,
        square_mm: dataset.board.square_mm,
        board: dataset.board.words_of(dataset.kind.points()),
        points: dataset.kind.points_in_a_word(),
        stage: dataset.stage.is_some(),
        excluded: dataset.excluded_poses.iter().copied().collect(),
        source,
        cameras: dataset
            .cameras
            .iter()
            .map(|camera| DatasetCamera {
                name: camera.name.clone(),
                sensor_px: [camera.sensor.width, camera.sensor.height],
                images: camera.images.iter().flatten().count(),
            })
            .collect(),
        capture,
        dial: sheet.dial,
        causes: sheet.causes,
        folder: dataset.folder,
    })
}

fn dataset_words(object: &DatasetObject) -> String {
    let mut words = format!(
        "dataset         {}\nboard           {}{}\n",
        object.folder.display(),
        object.board,
        if object.stage { ", on a stage" } else { "" }
    );
    // Writing to a String cannot fail.
    for camera in &object.cameras {
        let [width, height] = camera.sensor_px;
        let _ = writeln!(
            words,
            "camera          {}, {width} x {height} px, {} images",
            camera.name, camera.images
        );
    }
    if !object.excluded.is_empty() {
        let _ = writeln!(words, "excluded        poses {:?}", object.excluded);
    }
    let Some(capture) = &object.capture else {
        words
            .push_str("corners         none yet: run calib-offline detect, or calibrate at once\n");
        return words;
    };
    if object.source == "both" {
        words.push_str("corners         corners.csv is used, the images are not\n");
    }
    let _ = writeln!(
        words,
        "poses           {}, {} of them seen by every camera",
        capture.poses, capture.poses_seen_by_all
    );
    for camera in &capture.cameras {
        let per_view = camera
            .corners_per_view
            .map_or(String::new(), |[least, median, most]| {
                format!(", {median} a view ({least} to {most})")
            });
        let _ = writeln!(
            words,
            "{:<15} {} views, {} {}{per_view}, {:.0} % of the sensor would be calibrated",
            camera.name,
            camera.views,
            camera.corners,
            object.points,
            100.0 * camera.covered_share
        );
    }
    for warning in &capture.warnings {
        let _ = writeln!(words, "look at         {warning}");
    }
    if let Some(dial) = &object.dial {
        let _ = writeln!(
            words,
            "dial            larger readings turn the board {}, seen from above; found minus dialed {:.2} degrees RMS",
            dial.sense(),
            dial.rms_deg
        );
    }
    for cause in &object.causes {
        let _ = writeln!(words, "{:<15} {}", cause.code.word(), cause.text);
    }
    words
}

fn blob_object(blob: &RayBlob<'_>) -> BlobObject {
    BlobObject {
        bytes: blob.len(),
        identity: hex(blob.identity()),
        frame: blob.frame().to_owned(),
        written_by: blob.written_by().to_owned(),
        max_error_px: blob.max_error_px(),
        working_distance_mm: blob.working_distance_mm(),
        self_tests: blob.self_tests().count(),
        cameras: (0..blob.camera_count())
            .filter_map(|k| blob.camera(k))
            .map(|camera| BlobCamera {
                name: camera.name.to_owned(),
                sensor_px: [camera.sensor_width, camera.sensor_height],
                region_px: [
                    camera.region.u,
                    camera.region.v,
                    camera.region.width,
                    camera.region.height,
                ],
                cells: camera.cells,
                form: form_name(camera.encoding.form),
                central: camera.encoding.is_central,
                position_mm: camera.rig_from_camera.translation_mm,
            })
            .collect(),
        pairs: blob
            .uncertain_pairs()
            .map(|pair| BlobPair {
                cameras: pair.cameras.map(|camera| {
                    let camera = blob.camera(camera.into());
                    camera.map_or_else(String::new, |camera| camera.name.to_owned())
                }),
                nodes: pair.nodes,
                bytes: aligned(pair.section_len()),
                noise_px: pair.noise_px2.sqrt(),
            })
            .collect(),
        match_noise_px: blob.match_noise().map(MatchNoise::px),
    }
}

fn blob_words(object: &BlobObject) -> String {
    let mut words = format!(
        "blob            {} bytes, identity {}, by {}\nframe           {}, mm\nerror           every ray within {} px of the calibration, offsets judged at {} mm\nself-tests      {}\n",
        object.bytes,
        object.identity,
        object.written_by,
        object.frame,
        short(f64::from(object.max_error_px)),
        short(f64::from(object.working_distance_mm)),
        object.self_tests
    );
    for camera in &object.cameras {
        let [width, height] = camera.sensor_px;
        let [x, y, z] = camera.position_mm;
        // Writing to a String cannot fail.
        let _ = writeln!(
            words,
            "camera          {}, {width} x {height} px, {}, {} x {} cells, {}, at ({x:.2}, {y:.2}, {z:.2}) mm",
            camera.name,
            camera.form,
            camera.cells[0],
            camera.cells[1],
            if camera.central {
                "central"
            } else {
                "non-central"
            }
        );
    }
    for pair in &object.pairs {
        let ([first, second], [nodes_u, nodes_v]) = (&pair.cameras, pair.nodes);
        let _ = writeln!(
            words,
            "uncertainty     of {first} with {second}, {nodes_u} x {nodes_v} nodes, {} bytes; corners off by {} px",
            pair.bytes,
            short(f64::from(pair.noise_px))
        );
    }
    if let Some(noise_px) = object.match_noise_px {
        let noise = short(f64::from(noise_px));
        let _ = writeln!(
            words,
            "matches         off by {noise} px per coordinate, as its sigma takes them to be"
        );
    }
    if object.pairs.is_empty() {
        words.push_str("uncertainty     none: points measured with it have no sigma\n");
    }
    words
}
