//! `compare`: two calibrations of one rig. Of a dataset it says where methods are compared.

use super::Outcome;
use super::error::Error;
use super::output::Console;
use super::rig_file::RigFile;
use super::usage_error::UsageError;
use crate::pipeline::{estimate_again, names};
use crate::present::numbers::short;
use crate::present::table::Table;
use crate::report::Calibration;
use crate::report::facts::Facts;
use calib_blob::pack::PackSettings;
use calib_judge::difference::{CameraDifference, Difference, difference};
use calib_judge::half_data::Halves;
use calib_rays::field::Rig;
use clap::Args;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline compare results/monday/calibration.json results/friday/calibration.json";

const FORMATS: &str = "\
Both are calibration.json of the same cameras. The second rig is placed on the first as well as a rigid motion
can, by points all over the volume of the first; what remains is the difference. The prediction is the sum of
both covariances, estimated again from the corners in the files: that of calibrations that share no recording.

With --json, schema calib-offline/compare/2; a figure that does not apply is null:
  judgement                      as-predicted, more, less or not-predicted
  points, rms_mm, max_mm         points of the same pixels; of a camera alone, its rays, and 0 points
  predicted_rms_mm, ratio, ratio_by_chance
                                 ratio: over the predicted one, and where it falls by chance in 999 of 1000
  distances_mm                   of the points from the first camera: least, middle, largest
  cameras (name, rms_px, max_px, map (u, v, px, mm))
                                 over the area that both are calibrated in; mm across the ray at the middle distance";

/// Columns and rows of a map on the terminal.
const MAP: [usize; 2] = [8, 6];

/// The arguments, and those that `methods` had under this name.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct CompareArgs {
    /// Two calibrations: A.json B.json
    #[arg(value_name = "CALIBRATION")]
    pub files: Vec<PathBuf>,
    /// Of `methods`
    #[arg(short, long, hide = true)]
    pub output: Option<PathBuf>,
    /// Of `methods`
    #[arg(long, hide = true)]
    pub folds: Option<String>,
    /// Of `methods`
    #[arg(long, hide = true)]
    pub force: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct CompareObject {
    schema: &'static str,
    #[serde(flatten)]
    difference: Difference,
}

/// Runs the command.
///
/// # Errors
/// [`UsageError::CompareIsMethods`] for a dataset; files that are no calibrations of the same cameras.
pub fn run(args: &CompareArgs, console: &Console) -> Result<Outcome, Error> {
    let [first, second] = &args.files[..] else {
        return Err(UsageError::CompareIsMethods.into());
    };
    if first.is_dir() || second.is_dir() {
        return Err(UsageError::CompareIsMethods.into());
    }
    let (a, b) = (calibration(first)?, calibration(second)?);
    let ordered = same_cameras(&a.rig, &b)?;
    let distances_mm = Facts::of(&a).working_distance_mm.map_or_else(
        || vec![PackSettings::default().working_distance_mm; 3],
        |distance| vec![distance.least, distance.median, distance.most],
    );
    let found = difference(
        &a.rig,
        &ordered.rig,
        &distances_mm,
        estimates(&a, &ordered, console),
    )
    .ok_or(UsageError::NothingInCommon)?;
    let object = CompareObject {
        schema: "calib-offline/compare/2",
        difference: found,
    };
    console.result(&words(&object.difference, &a.rig), &object);
    Ok(Outcome::Done)
}

fn calibration(path: &Path) -> Result<Calibration, Error> {
    match RigFile::read(path)? {
        RigFile::Calibration(calibration) => Ok(*calibration),
        RigFile::Blob(_) => {
            let path = path.to_owned();
            Err(UsageError::BlobWithoutCorners { path }.into())
        }
    }
}

/// The second calibration with its cameras in the order of the first rig.
fn same_cameras(first: &Rig, calibration: &Calibration) -> Result<Calibration, UsageError> {
    let second = &calibration.rig;
    let words = |rig: &Rig| {
        let cameras = rig.cameras.iter();
        let words = cameras.map(|camera| {
            let sensor = camera.field.sensor;
            format!("{} ({} x {})", camera.name, sensor.width, sensor.height)
        });
        words.collect::<Vec<_>>()
    };
    let refused = || UsageError::OtherCameras {
        first: words(first),
        second: words(second),
    };
    let order: Option<Vec<usize>> = first
        .cameras
        .iter()
        .map(|camera| {
            let idx = second.camera_idx(&camera.name)?;
            let sensor = second.cameras[idx].field.sensor;
            (sensor == camera.field.sensor).then_some(idx)
        })
        .collect();
    let order = order
        .filter(|order| order.len() == second.cameras.len())
        .ok_or_else(refused)?;
    let mut ordered = calibration.clone();
    ordered.rig.cameras = order
        .iter()
        .map(|idx| second.cameras[*idx].clone())
        .collect();
    for corner in &mut ordered.corners {
        let place = order.iter().position(|idx| *idx == corner.camera_idx);
        corner.camera_idx = place.unwrap_or(corner.camera_idx);
    }
    // It is that of pairs by their places, and nobody asks for it here.
    ordered.rig.uncertainty.clear();
    Ok(ordered)
}

/// The estimates behind two calibrations, if both hold corners that give one.
fn estimates(first: &Calibration, second: &Calibration, console: &Console) -> Option<Halves> {
    console.progress().begin("uncertainty of both", 0);
    let (a, b) = rayon::join(|| estimate_again(first), || estimate_again(second));
    console.progress().end();
    let estimates = [a?.ok()?, b?.ok()?];
    let names = names(&first.rig);
    Some(Halves {
        rigs: [estimates[0].rig(&names), estimates[1].rig(&names)],
        estimates,
    })
}

/// For a terminal.
fn words(found: &Difference, rig: &Rig) -> String {
    let mut text = format!("the calibrations are {}\n", found.judgement.word());
    let predicted = found
        .predicted_rms_mm
        .map_or_else(String::new, |predicted| {
            let ratio = found.ratio.unwrap_or(0.0);
            let [low, high] = found.ratio_by_chance.unwrap_or_default();
            format!(
                "; predicted {} mm, ratio {ratio:.2}, by chance {low:.2} to {high:.2}",
                short(predicted)
            )
        });
    let what = if found.points > 0 {
        format!("{} points", found.points)
    } else {
        "rays".to_owned()
    };
    let near = found.distances_mm.first().copied().unwrap_or(0.0);
    let far = found.distances_mm.last().copied().unwrap_or(0.0);
    let _ = writeln!(
        text,
        "{what} at {near:.0} to {far:.0} mm, after the best rigid placement: {} mm RMS, most {} mm{predicted}",
        short(found.rms_mm),
        short(found.max_mm)
    );
    for (camera, calibrated) in found.cameras.iter().zip(&rig.cameras) {
        let sensor = calibrated.field.sensor;
        let _ = writeln!(
            text,
            "camera {}: {} px RMS, most {} px; over the image, px and mm:",
            camera.name,
            short(camera.rms_px),
            short(camera.max_px)
        );
        text += &map(camera, [f64::from(sensor.width), f64::from(sensor.height)]);
    }
    text
}

/// RMS in px and mm over cells of the image.
fn map(camera: &CameraDifference, size_px: [f64; 2]) -> String {
    let [columns, rows] = MAP;
    let middle = |k: usize, count: usize, px: f64| (k as f64 + 0.5) / count as f64 * px;
    let head = (0..columns).map(|k| format!("u {:.0}", middle(k, columns, size_px[0])));
    let mut table = Table::new(std::iter::once("v".to_owned()).chain(head));
    let cell = |u: f64, extent: f64, count: usize| {
        (((u + 0.5) / extent * count as f64).max(0.0) as usize).min(count - 1)
    };
    for row in 0..rows {
        let cells = (0..columns).map(|column| {
            let inside: Vec<_> = camera
                .map
                .iter()
                .filter(|place| {
                    cell(place.u, size_px[0], columns) == column
                        && cell(place.v, size_px[1], rows) == row
                })
                .collect();
            if inside.is_empty() {
                return "-".to_owned();
            }
            let rms = |of: fn(&calib_judge::difference::Place) -> f64| {
                let sum: f64 = inside.iter().map(|place| of(place).powi(2)).sum();
                short((sum / inside.len() as f64).sqrt())
            };
            format!("{} {}", rms(|place| place.px), rms(|place| place.mm))
        });
        let label = format!("{:.0}", middle(row, rows, size_px[1]));
        table.push(std::iter::once(label).chain(cells).collect());
    }
    table.text()
}
