//! `rays`: pixels of one camera to rays, with a blob (the device's own code in f32) or a calibration (f64).

use super::Outcome;
use super::error::Error;
use super::measure::open_matches;
use super::output::Console;
use super::place::{check_file, place_in_words};
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use calib_blob::matches::{PixelsError, RAYS_HEADER, RaysSummary, StreamError, rays_of_pixels};
use calib_blob::rays::RaySource;
use calib_recording::atomic_file::{PendingFile, WriteError};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline rays results/calibration.json --camera left pixels.csv -o rays.csv";

const FORMATS: &str = "\
PIXELS.csv has the header id,u,v: the center of the top-left pixel is (0, 0), u to the right, v down.
RAYS.csv has the header id,ox,oy,oz,dx,dy,dz,status and one row per pixel, in the order of the pixels:
a point on the ray (the one nearest to the camera's reference point, mm) and its unit direction into
the scene, in the rig's frame. The status is ok or outside (of the calibrated area); only ok has
numbers. A blob is evaluated with the device's own library, a calibration in double precision. An
earlier RAYS.csv is replaced; any other file only with --force.

With --json, schema calib-offline/rays/1:
  rig, rig_kind    blob or calibration
  camera, output, pixels, ok, outside";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct RaysArgs {
    /// A blob (*.rays) or a calibration.json
    #[arg(value_name = "RIG")]
    pub rig: PathBuf,
    /// The pixels; - is standard input
    #[arg(value_name = "PIXELS.csv")]
    pub pixels: PathBuf,
    /// The camera that they are of
    #[arg(long, value_name = "NAME")]
    pub camera: String,
    /// Where to write the rays
    #[arg(short, long, value_name = "RAYS.csv")]
    pub output: PathBuf,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct RaysObject<'a> {
    schema: &'static str,
    rig: &'a Path,
    rig_kind: &'static str,
    camera: &'a str,
    output: &'a Path,
    #[serde(flatten)]
    summary: RaysSummary,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &RaysArgs, console: &Console) -> Result<Outcome, Error> {
    let inputs = [args.rig.as_path(), args.pixels.as_path()];
    check_file(&args.output, RAYS_HEADER.as_bytes(), &inputs, args.force)?;
    let (rig_kind, summary) = match RigFile::read(&args.rig)? {
        RigFile::Blob(bytes) => ("blob", look_up(args, &open(&bytes, &args.rig)?)?),
        RigFile::Calibration(calibration) => ("calibration", look_up(args, &calibration.rig)?),
    };
    let object = RaysObject {
        schema: "calib-offline/rays/1",
        rig: &args.rig,
        rig_kind,
        camera: &args.camera,
        output: &args.output,
        summary,
    };
    let outside = match summary.outside {
        0 => String::new(),
        count => format!(", {count} outside the calibrated area"),
    };
    let words = format!(
        "{} of {} pixels have a ray{outside}; written to {}",
        summary.ok,
        summary.pixels,
        place_in_words(&args.output)
    );
    console.result(&words, &object);
    Ok(Outcome::Done)
}

fn look_up(args: &RaysArgs, source: &dyn RaySource) -> Result<RaysSummary, Error> {
    let cameras = source.cameras();
    let camera_idx = cameras
        .iter()
        .position(|camera| camera.name == args.camera)
        .ok_or_else(|| UsageError::UnknownCamera {
            name: args.camera.clone(),
            known: cameras.iter().map(|camera| camera.name.clone()).collect(),
        })?;
    let mut input = open_matches(&args.pixels).map_err(PixelsError::from)?;
    let mut output = PendingFile::create(&args.output)?;
    let summary = rays_of_pixels(source, camera_idx, &args.pixels, &mut input, &mut output);
    let summary = summary.map_err(|error| match error {
        StreamError::Matches(error) => Error::Pixels(error.into()),
        StreamError::Write(source) => Error::Write(WriteError::Io {
            path: args.output.clone(),
            source,
        }),
        StreamError::Source(never) => never.into(),
    })?;
    output.commit()?;
    Ok(summary)
}
