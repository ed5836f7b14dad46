//! `measure`: matches to points, with a blob (the device's own code in f32 or integers), a calibration (f64), or on a
//! device.

use super::Outcome;
use super::error::Error;
use super::lengths::{self, check_lengths};
use super::match_noise::{in_f32, parse};
use super::output::Console;
use super::pack::ArithmeticArg;
use super::place::{check_file, place_in_words};
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use crate::device::{DeviceSource, connect};
use crate::present::numbers::short;
use crate::report::record::Grade;
use calib_blob::matches::{
    BlobSource, MatchesError, MeasureSummary, NoiseError, NoiseEstimate, POINTS_HEADER,
    StreamError, measure_batches, measure_with_blob, measure_with_calibration, noise_with_blob,
    noise_with_calibration,
};
use calib_judge::lengths::CheckedLengths;
use calib_rays::measure::{PointSource, RigSource};
use calib_recording::atomic_file::{PendingFile, WriteError};
use clap::Args;
use firmware_sim::client::DEFAULT_TIMEOUT;
use serde::Serialize;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline measure results/rig.rays matches.csv -o points.csv
  calib-offline measure results/calibration.json matches.csv -o points.csv --frame left
  calib-offline measure results/rig.rays matches.csv -o points.csv --match-noise-px 0.2
  calib-offline measure results/calibration.json matches.csv -o points.csv --lengths bar.csv
  calib-offline measure results/rig.rays matches.csv -o points.csv --arithmetic integer
  calib-offline measure --device tcp:127.0.0.1:7777 matches.csv -o points.csv";

const FORMATS: &str = "\
MATCHES.csv has the header id,u_left,v_left,u_right,v_right, with the names of the rig's cameras.
Leave both fields of a camera empty where it did not see the point; two must be left.
POINTS.csv has the header id,x,y,z,gap,sigma_x,sigma_y,sigma_z,status and one row per match, in
the order of the matches; lengths in mm. The status is ok, outside (of the calibrated area),
parallel or behind; only ok has numbers. sigma is the predicted standard deviation of the point, for
matches of two cameras whose uncertainty the rig carries: what the calibration leaves open (a rigid
motion of the whole rig taken out) and the noise of the pixels. Else it is empty.

A matcher is seldom as exact as the corners of the calibration. The noise of the pixels is that of
--match-noise-px, else what calibrate or pack --match-noise-px wrote into the rig, else that of the
corners. --estimate-match-noise finds it from the gaps of these very matches and says how well: a median,
so that wrong matches hardly count. Gaps see only the noise across the plane of the two rays; that
within it, which makes most of the error in depth, is taken to be as large.

With --arithmetic integer a blob is evaluated as a device without a floating-point unit does it: the same bits there
and here, near those of f32, and no sigma. Of a match of more than two cameras the first two with rays count. A device
must compute in integers itself.

A blob is evaluated with the device's own library and gives the device's bits; a calibration is
evaluated in double precision. With --device the device measures, with the blob it has in use: the
same bits as that blob gives here; matches of two cameras, in the rig's frame.
An earlier POINTS.csv is replaced; any other file only with --force.

LENGTHS.csv has the header id_a,id_b,length_mm or id_a,id_b,length_mm,limit_mm: known lengths between two of the
matches, and what the length measurement error (measured minus known) may be at most; an empty limit is none.
The exit code is 1 if one is exceeded. The standard deviation of an error is that of both ends along the length, taken as
independent, and with a calibration that of its board's scale ([board.certificate]).

With --json, schema calib-offline/measure/1:
  rig          the device's address with --device
  rig_kind     blob, calibration or device
  frame, output, matches, ok, outside, parallel, behind, gap_rms_mm
  match_noise_px
               what sigma was computed with; null: the corners' noise, or what the device's blob says
  estimated_match_noise (px, low_px, high_px, gaps)
               with --estimate-match-noise, and its 95 % interval; else null
  known_lengths (verdict, inside, outside, not_measured, largest_error_mm, rms_error_mm, error_over_sd,
    lengths (id_a, id_b, length_mm, measured_mm, error_mm, sd_mm, limit_mm, inside))
               null without --lengths; verdict: fail beyond a limit, doubtful if one was not tested, null
               without limits";

/// How it is called. A flag may stand anywhere, so that which of the two files is left out with a device follows from
/// `--device` and not from where the flags are.
const USAGE: &str = "\
calib-offline measure [OPTIONS] --output <POINTS.csv> <RIG> <MATCHES.csv>
       calib-offline measure [OPTIONS] --output <POINTS.csv> --device <ADDRESS> <MATCHES.csv>";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS, override_usage = USAGE)]
pub struct MeasureArgs {
    /// A blob (*.rays) or a calibration.json; with --device, MATCHES.csv stands here
    #[arg(value_name = "RIG")]
    first: PathBuf,
    /// The pixels that belong together; - is standard input
    #[arg(
        value_name = "MATCHES.csv",
        required_unless_present = "device",
        conflicts_with = "device"
    )]
    second: Option<PathBuf>,
    /// Where to write the points
    #[arg(short, long, value_name = "POINTS.csv")]
    pub output: PathBuf,
    /// Give the points in the frame of this camera instead of the rig's
    #[arg(long, value_name = "CAMERA", conflicts_with = "device")]
    pub frame: Option<String>,
    /// Let this device measure, instead of a RIG: tcp:HOST:PORT or serial:PORT@BAUD
    #[arg(long, value_name = "ADDRESS")]
    pub device: Option<String>,
    /// How noisy the pixels of the matches are: standard deviation of a coordinate, px
    #[arg(long, value_name = "S", value_parser = parse)]
    pub match_noise_px: Option<f64>,
    /// Find that from the gaps of these matches; it takes 100 of them
    #[arg(long, conflicts_with_all = ["match_noise_px", "device"])]
    pub estimate_match_noise: bool,
    /// Check known lengths between the points, of a file as below
    #[arg(long, value_name = "LENGTHS.csv", conflicts_with = "device")]
    pub lengths: Option<PathBuf>,
    /// What rays and points are computed in; integer takes a blob, or a device that computes in integers
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = ArithmeticArg::F32)]
    pub arithmetic: ArithmeticArg,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
}

impl MeasureArgs {
    /// The file that measures; none where a device does.
    fn rig(&self) -> Option<&Path> {
        self.second.as_ref().map(|_| self.first.as_path())
    }

    fn in_integers(&self) -> bool {
        self.arithmetic == ArithmeticArg::Integer
    }

    /// The matches.
    fn matches(&self) -> &Path {
        self.second.as_ref().unwrap_or(&self.first)
    }
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
    #[serde(flatten)]
    noise: NoiseUsed,
    known_lengths: Option<CheckedLengths>,
}

/// What the pixels' part of sigma comes from.
#[derive(Debug, Clone, Copy, Default, Serialize)]
struct NoiseUsed {
    match_noise_px: Option<f64>,
    estimated_match_noise: Option<NoiseEstimate>,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &MeasureArgs, console: &Console) -> Result<Outcome, Error> {
    if args.in_integers()
        && (args.lengths.is_some() || args.estimate_match_noise || args.match_noise_px.is_some())
    {
        return Err(Error::Usage(UsageError::NoSigmaInIntegers));
    }
    let mut inputs = vec![args.matches()];
    inputs.extend(args.rig());
    inputs.extend(args.lengths.as_deref());
    check_file(&args.output, POINTS_HEADER.as_bytes(), &inputs, args.force)?;
    // Before anything is written: there may be a mistake in it.
    let check = |noise_px| match (&args.lengths, args.rig()) {
        (Some(lengths), Some(rig)) => {
            check_lengths(rig, args.matches(), lengths, noise_px).map(Some)
        }
        _ => Ok(None),
    };
    let mut known_lengths = check(args.match_noise_px)?;
    let (rig, kind, (summary, noise)) = match (&args.device, args.rig()) {
        (Some(address), _) => (Path::new(address), "device", measure_there(args, address)?),
        (None, Some(rig)) => {
            let (kind, measured) = measure_here(args, rig)?;
            (rig, kind, measured)
        }
        (None, None) => return Err(Error::Usage(UsageError::NoDevice)),
    };
    if args.estimate_match_noise {
        known_lengths = check(noise.match_noise_px)?;
    }
    let object = MeasureObject {
        schema: "calib-offline/measure/1",
        rig,
        rig_kind: kind,
        frame: args.frame.as_deref().unwrap_or("rig"),
        output: &args.output,
        summary,
        noise,
        known_lengths,
    };
    console.result(&in_words(&object), &object);
    let verdict = object.known_lengths.as_ref().and_then(|l| l.verdict);
    Ok(match verdict {
        Some(Grade::Fail) => Outcome::VerdictFail,
        _ => Outcome::Done,
    })
}

/// What became of the matches, and with which noise.
type Measured = (MeasureSummary, NoiseUsed);

/// Has a device measure.
fn measure_there(args: &MeasureArgs, address: &str) -> Result<Measured, Error> {
    let client = connect(address, DEFAULT_TIMEOUT)?;
    let noise = args.match_noise_px.and_then(in_f32);
    let mut source = DeviceSource::new(client, address)?.with_noise(noise);
    if args.in_integers() {
        source = source.in_integers(address)?;
    }
    let mut input = open_matches(args.matches())?;
    let summary = stream(args, &mut input, |file, input, output| {
        measure_batches(&mut source, file, input, output)
    })?;
    let noise = NoiseUsed {
        match_noise_px: args.match_noise_px,
        estimated_match_noise: None,
    };
    Ok((summary, noise))
}

/// Measures with a file; what kind it is, too.
fn measure_here(args: &MeasureArgs, rig: &Path) -> Result<(&'static str, Measured), Error> {
    let frame = args.frame.as_deref();
    Ok(match RigFile::read(rig)? {
        RigFile::Blob(bytes) => {
            let blob = open(&bytes, rig)?;
            let source = checked(
                args,
                rig,
                names(BlobSource::new(&blob, None)),
                BlobSource::new(&blob, frame),
            )?;
            let source = if args.in_integers() {
                source.in_integers().map_err(|cause| UsageError::Unsuited {
                    path: rig.to_owned(),
                    cause,
                })?
            } else {
                source
            };
            let (mut input, noise) = prepare(args, |input| {
                noise_with_blob(&source, args.matches(), input)
            })?;
            let own_px = blob.match_noise().map(|noise| f64::from(noise.px()));
            let source = match noise.match_noise_px.and_then(in_f32) {
                Some(noise) => source.with_noise(noise),
                None => source,
            };
            let summary = stream(args, &mut input, |file, input, output| {
                measure_with_blob(&source, file, input, output)
            })?;
            ("blob", (summary, noise.or_of_rig(own_px)))
        }
        RigFile::Calibration(_) if args.in_integers() => {
            return Err(Error::Usage(UsageError::UnknownKind {
                path: rig.to_owned(),
                expected: "a blob (*.rays), which integers take: make one with calib-offline pack",
            }));
        }
        RigFile::Calibration(mut calibration) => {
            let (mut input, noise) = {
                let own = &calibration.rig;
                let source = checked(
                    args,
                    rig,
                    names(RigSource::new(own, None)),
                    RigSource::new(own, frame),
                )?;
                prepare(args, |input| {
                    noise_with_calibration(&source, args.matches(), input)
                })?
            };
            let own = &mut calibration.rig;
            let noise = noise.or_of_rig(own.match_noise_px);
            own.match_noise_px = noise.match_noise_px;
            let source = checked(
                args,
                rig,
                names(RigSource::new(own, None)),
                RigSource::new(own, frame),
            )?;
            let summary = stream(args, &mut input, |file, input, output| {
                measure_with_calibration(&source, file, input, output)
            })?;
            ("calibration", (summary, noise))
        }
    })
}

fn names(source: Option<impl PointSource>) -> Vec<String> {
    source.map(|source| source.cameras()).unwrap_or_default()
}

/// The source of the frame asked for, if it is that of one of these cameras, and they are two.
fn checked<S>(
    args: &MeasureArgs,
    rig: &Path,
    known: Vec<String>,
    source: Option<S>,
) -> Result<S, UsageError> {
    if known.len() < 2 {
        return Err(UsageError::OneCamera {
            path: rig.to_owned(),
        });
    }
    source.ok_or_else(|| UsageError::UnknownFrame {
        name: args.frame.clone().unwrap_or_default(),
        known,
    })
}

impl NoiseUsed {
    /// This, or what the rig says itself.
    fn or_of_rig(self, own_px: Option<f64>) -> Self {
        Self {
            match_noise_px: self.match_noise_px.or(own_px),
            ..self
        }
    }
}

/// The matches, and how noisy they are if it was said or is to be estimated: then they are held in memory.
fn prepare(
    args: &MeasureArgs,
    estimate: impl FnOnce(&mut dyn Read) -> Result<Result<NoiseEstimate, NoiseError>, MatchesError>,
) -> Result<(Box<dyn Read>, NoiseUsed), Error> {
    let mut input = open_matches(args.matches())?;
    if !args.estimate_match_noise {
        let noise = NoiseUsed {
            match_noise_px: args.match_noise_px,
            estimated_match_noise: None,
        };
        return Ok((input, noise));
    }
    let mut bytes = Vec::new();
    input
        .read_to_end(&mut bytes)
        .map_err(|source| MatchesError::Read {
            file: args.matches().to_owned(),
            source,
        })?;
    let estimate = estimate(&mut bytes.as_slice())??;
    let noise = NoiseUsed {
        match_noise_px: Some(estimate.px),
        estimated_match_noise: Some(estimate),
    };
    Ok((Box::new(std::io::Cursor::new(bytes)), noise))
}

/// A list to be read; - is standard input.
///
/// # Errors
/// [`MatchesError::Read`].
pub(super) fn open_matches(path: &Path) -> Result<Box<dyn Read>, MatchesError> {
    Ok(if path.as_os_str() == "-" {
        Box::new(std::io::stdin().lock())
    } else {
        let file = File::open(path).map_err(|source| MatchesError::Read {
            file: path.to_owned(),
            source,
        })?;
        Box::new(file)
    })
}

/// Has the matches measured, and keeps the points if all went well.
fn stream<E>(
    args: &MeasureArgs,
    input: &mut Box<dyn Read>,
    measure: impl FnOnce(
        &Path,
        &mut Box<dyn Read>,
        &mut PendingFile,
    ) -> Result<MeasureSummary, StreamError<E>>,
) -> Result<MeasureSummary, Error>
where
    Error: From<E>,
{
    let mut output = PendingFile::create(&args.output)?;
    let summary = measure(args.matches(), input, &mut output).map_err(|error| match error {
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
    if let Some(found) = &object.noise.estimated_match_noise {
        parts.push(format!(
            "matches off by {} px per coordinate ({} to {} px with 95 % confidence; by the median of {} gaps: across the \
             plane of the two rays, and within it taken to be as much)",
            short(found.px),
            short(found.low_px),
            short(found.high_px),
            found.gaps
        ));
    }
    format!(
        "{}; written to {}{}",
        parts.join(", "),
        place_in_words(object.output),
        object
            .known_lengths
            .as_ref()
            .map_or(String::new(), lengths::in_words)
    )
}
