//! `measure`: matches to points, with a blob (the device's own code in f32), a calibration (f64), or on a
//! device.

use super::Outcome;
use super::error::Error;
use super::output::Console;
use super::place::check_file;
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use crate::device::{DeviceSource, connect};
use crate::present::numbers::short;
use calib_blob::matches::{
    BlobSource, MatchesError, MeasureSummary, POINTS_HEADER, StreamError, measure_batches,
    measure_with_blob, measure_with_calibration,
};
use calib_rays::measure::{PointSource, RigSource};
use calib_recording::atomic_file::{PendingFile, WriteError};
use clap::Args;
use firmware_sim::client::DEFAULT_TIMEOUT;
use serde::Serialize;
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline measure results/rig.rays matches.csv -o points.csv
  calib-offline measure results/calibration.json matches.csv -o points.csv --frame left
  calib-offline measure --device tcp:127.0.0.1:7777 matches.csv -o points.csv";

const FORMATS: &str = "\
MATCHES.csv has the header id,u_left,v_left,u_right,v_right, with the names of the rig's cameras.
Leave both fields of a camera empty where it did not see the point; two must be left.
POINTS.csv has the header id,x,y,z,gap,sigma_x,sigma_y,sigma_z,status and one row per match, in
the order of the matches; lengths in mm. The status is ok, outside (of the calibrated area),
parallel or behind; only ok has numbers. sigma is the predicted standard deviation of the point, for
matches of two cameras whose uncertainty the rig carries: what the calibration leaves open (a rigid
motion of the whole rig taken out) and pixel noise of the size of its corners'. Else it is empty.

A blob is evaluated with the device's own library and gives the device's bits; a calibration is
evaluated in double precision. With --device the device measures, with the blob it has in use: the
same bits as that blob gives here; matches of two cameras, in the rig's frame.
An earlier POINTS.csv is replaced; any other file only with --force.

With --json, schema calib-offline/measure/1:
  rig          the device's address with --device
  rig_kind     blob, calibration or device
  frame, output, matches, ok, outside, parallel, behind, gap_rms_mm";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS, allow_missing_positional = true)]
pub struct MeasureArgs {
    /// A blob (*.rays) or a calibration.json
    #[arg(
        value_name = "RIG",
        required_unless_present = "device",
        conflicts_with = "device"
    )]
    pub rig: Option<PathBuf>,
    /// The pixels that belong together; - is standard input
    #[arg(value_name = "MATCHES.csv")]
    pub matches: PathBuf,
    /// Where to write the points
    #[arg(short, long, value_name = "POINTS.csv")]
    pub output: PathBuf,
    /// Give the points in the frame of this camera instead of the rig's
    #[arg(long, value_name = "CAMERA", conflicts_with = "device")]
    pub frame: Option<String>,
    /// Let this device measure, instead of a RIG: tcp:HOST:PORT or serial:PORT@BAUD
    #[arg(long, value_name = "ADDRESS")]
    pub device: Option<String>,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct MeasureObject<'a> {
    schema: &'static str,
    rig: &'a Path,
    rig_kind: &'static str,
    frame: &'a str,
    output: &'a Path,
    #[serde(flatten)]
    summary: MeasureSummary,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &MeasureArgs, console: &Console) -> Result<Outcome, Error> {
    let mut inputs = vec![args.matches.as_path()];
    inputs.extend(args.rig.as_deref());
    check_file(&args.output, POINTS_HEADER.as_bytes(), &inputs, args.force)?;
    let (rig, kind, summary) = match (&args.device, &args.rig) {
        (Some(address), _) => (Path::new(address), "device", measure_there(args, address)?),
        (None, Some(rig)) => {
            let (kind, summary) = measure_here(args, rig)?;
            (rig.as_path(), kind, summary)
        }
        (None, None) => return Err(Error::Usage(UsageError::NoDevice)),
    };
    let object = MeasureObject {
        schema: "calib-offline/measure/1",
        rig,
        rig_kind: kind,
        frame: args.frame.as_deref().unwrap_or("rig"),
        output: &args.output,
        summary,
    };
    console.result(&in_words(&object), &object);
    Ok(Outcome::Done)
}

/// Has a device measure.
fn measure_there(args: &MeasureArgs, address: &str) -> Result<MeasureSummary, Error> {
    let client = connect(address, DEFAULT_TIMEOUT)?;
    let mut source = DeviceSource::new(client, address)?;
    stream(args, |file, input, output| {
        measure_batches(&mut source, file, input, output)
    })
}

/// Measures with a file; what kind it is, too.
fn measure_here(args: &MeasureArgs, rig: &Path) -> Result<(&'static str, MeasureSummary), Error> {
    let frame = args.frame.as_deref();
    Ok(match RigFile::read(rig)? {
        RigFile::Blob(bytes) => {
            let blob = open(&bytes, rig)?;
            let names = names(BlobSource::new(&blob, None));
            let source = BlobSource::new(&blob, frame);
            let measured = measure(args, rig, source.as_ref(), names, measure_with_blob)?;
            ("blob", measured)
        }
        RigFile::Calibration(calibration) => {
            let names = names(RigSource::new(&calibration.rig, None));
            let source = RigSource::new(&calibration.rig, frame);
            let measured = measure(args, rig, source.as_ref(), names, measure_with_calibration)?;
            ("calibration", measured)
        }
    })
}

fn names(source: Option<impl PointSource>) -> Vec<String> {
    source.map(|source| source.cameras()).unwrap_or_default()
}

/// `source` is none where the frame is none of the cameras `known`.
fn measure<S>(
    args: &MeasureArgs,
    rig: &Path,
    source: Option<&S>,
    known: Vec<String>,
    measure: impl FnOnce(
        &S,
        &Path,
        &mut dyn Read,
        &mut dyn Write,
    ) -> Result<MeasureSummary, StreamError>,
) -> Result<MeasureSummary, Error> {
    if known.len() < 2 {
        return Err(Error::Usage(UsageError::OneCamera {
            path: rig.to_owned(),
        }));
    }
    let Some(source) = source else {
        return Err(Error::Usage(UsageError::UnknownFrame {
            name: args.frame.clone().unwrap_or_default(),
            known,
        }));
    };
    stream(args, |file, input, output| {
        measure(source, file, input, output)
    })
}

/// Opens the matches, has them measured, and keeps the points if all went well.
fn stream<E>(
    args: &MeasureArgs,
    measure: impl FnOnce(
        &Path,
        &mut Box<dyn Read>,
        &mut PendingFile,
    ) -> Result<MeasureSummary, StreamError<E>>,
) -> Result<MeasureSummary, Error>
where
    Error: From<E>,
{
    let mut input: Box<dyn Read> = if args.matches.as_os_str() == "-" {
        Box::new(std::io::stdin().lock())
    } else {
        let file = File::open(&args.matches).map_err(|source| MatchesError::Read {
            file: args.matches.clone(),
            source,
        })?;
        Box::new(file)
    };
    let mut output = PendingFile::create(&args.output)?;
    let summary = measure(&args.matches, &mut input, &mut output).map_err(|error| match error {
        StreamError::Matches(error) => Error::Matches(error),
        StreamError::Write(source) => Error::Write(WriteError::Io {
            path: args.output.clone(),
            source,
        }),
        StreamError::Source(error) => Error::from(error),
    })?;
    output.commit()?;
    Ok(summary)
}

fn in_words(object: &MeasureObject<'_>) -> String {
    let summary = &object.summary;
    let mut parts = vec![format!(
        "{} of {} matches have a point",
        summary.ok, summary.matches
    )];
    for (count, words) in [
        (summary.outside, "outside the calibrated area"),
        (summary.parallel, "with parallel rays"),
        (summary.behind, "behind a camera"),
    ] {
        if count > 0 {
            parts.push(format!("{count} {words}"));
        }
    }
    if let Some(gap_mm) = summary.gap_rms_mm {
        parts.push(format!("gap {} mm RMS", short(gap_mm)));
    }
    format!(
        "{}; written to {}",
        parts.join(", "),
        object.output.display()
    )
}
