//! `pack`: a calibration to a blob within a proven error.

use super::Outcome;
use super::calibrate::{blob_max_error_px, pack_settings, watched};
use super::error::Error;
use super::match_noise::parse;
use super::output::Console;
use super::place::{check_file, place_in_words};
use crate::present::numbers::short;
use crate::report::{BlobFacts, Calibration};
use calib_blob::pack::{CurvePoint, Deviation, LOOSEST_PX, PackSettings, Prefer};
use calib_recording::atomic_file;
use clap::{Args, ValueEnum};
use ray_runtime::format::{Form, MAGIC};
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline pack results/calibration.json -o small.rays --max-error-px 0.01
  calib-offline pack results/calibration.json -o fast.rays --prefer speed
  calib-offline pack results/calibration.json -o tiny.rays --max-bytes 2048";

const FORMATS: &str = "\
Every pixel of the calibrated area, and quarter pixels along its edge, are looked up in the finished
blob and compared with the calibration: none is further off than the bound. With --max-bytes and no
bound, the smallest error that fits is taken. --prefer size stores a polynomial and the quantized knots
of what it leaves; --prefer speed a cubic for each cell, which takes fewer instructions and several
times the bytes (ray-runtime/COST.md has both). The uncertainty goes with it on a coarse grid; how
far that changes predicted standard deviations is measured and said. An earlier blob is replaced;
any other file only with --force.

With --json, schema calib-offline/pack/2:
  output, bytes
  max_error_px      asked for; null with only --max-bytes
  worst_error_px, worst_error_mm
                    found; mm at the working distance
  integer_error_px  found for the arithmetic of integers; null without --arithmetic integer
  cameras (name, form, central, cells, bytes, worst_error_px, worst_error_mm)
  pairs (cameras, nodes, bytes, sigma_error/calibration_sigma_error (rms, worst))
                    relative
  match_noise_px    what sigma is computed with; null: the corners' noise
  curve (bytes, error_px, error_mm)
                    bytes of all tables";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct PackArgs {
    /// The result of calibrate
    #[arg(value_name = "CALIBRATION.json")]
    pub calibration: PathBuf,
    /// Where to write the blob
    #[arg(short, long, value_name = "RIG.rays")]
    pub output: PathBuf,
    /// No ray may be further off than this, px [default: as calibrate packs, or what fits into --max-bytes]
    #[arg(long, value_name = "E")]
    pub max_error_px: Option<f64>,
    /// The blob may have no more bytes than this
    #[arg(long, value_name = "B")]
    pub max_bytes: Option<usize>,
    /// What matters within these limits
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = PreferArg::Size)]
    pub prefer: PreferArg,
    /// How noisy the pixels of matches will be: standard deviation of a coordinate, px
    /// [default: as the calibration says, else as its corners]
    #[arg(long, value_name = "S", value_parser = parse)]
    pub match_noise_px: Option<f64>,
    /// Leave out the uncertainty: a smaller blob, and no sigma from it
    #[arg(long)]
    pub no_uncertainty: bool,
    /// Prove the error of this arithmetic too, and write its answers to the self-tests: for devices without a floating-point unit
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = ArithmeticArg::F32)]
    pub arithmetic: ArithmeticArg,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
}

/// What rays and points are computed in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ArithmeticArg {
    /// Numbers of 32 bits with a floating point
    F32,
    /// Integers
    Integer,
}

/// What matters among tables within the limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PreferArg {
    /// The fewest bytes
    Size,
    /// The fewest instructions per lookup
    Speed,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct PackObject<'a> {
    schema: &'static str,
    output: &'a Path,
    bytes: usize,
    max_error_px: Option<f64>,
    worst_error_px: f64,
    worst_error_mm: f64,
    integer_error_px: Option<f64>,
    cameras: Vec<PackedCamera>,
    pairs: Vec<PairObject>,
    match_noise_px: Option<f64>,
    curve: Vec<CurvePoint>,
}

#[derive(Debug, Serialize)]
struct PackedCamera {
    name: String,
    form: &'static str,
    central: bool,
    cells: [u32; 2],
    bytes: usize,
    worst_error_px: f64,
    worst_error_mm: f64,
}

#[derive(Debug, Serialize)]
struct PairObject {
    cameras: [String; 2],
    nodes: [u16; 2],
    bytes: usize,
    sigma_error: Deviation,
    calibration_sigma_error: Deviation,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &PackArgs, console: &Console) -> Result<Outcome, Error> {
    check_file(&args.output, &MAGIC, &[&args.calibration], args.force)?;
    let mut calibration = Calibration::load(&args.calibration)?;
    let default_px = match args.max_bytes {
        Some(_) => LOOSEST_PX,
        None => blob_max_error_px(&calibration),
    };
    let max_error_px = args.max_error_px.unwrap_or(default_px);
    let settings = PackSettings {
        with_uncertainty: !args.no_uncertainty,
        prefer: match args.prefer {
            PreferArg::Size => Prefer::Size,
            PreferArg::Speed => Prefer::Speed,
        },
        with_integers: args.arithmetic == ArithmeticArg::Integer,
        ..pack_settings(&calibration, max_error_px)
    };
    let rig = &mut calibration.rig;
    rig.match_noise_px = args.match_noise_px.or(rig.match_noise_px);
    let rig = &*rig;
    let packed = watched(rig, &settings, console, |packer| match args.max_bytes {
        Some(max_bytes) if args.max_error_px.is_none() => packer.within_bytes(max_bytes),
        Some(max_bytes) => packer.within(max_error_px)?.within(max_bytes),
        // A bound that nobody asked for is no reason to have no blob.
        None if args.max_error_px.is_none() => packer.nearest(),
        None => packer.within(max_error_px),
    })?;
    if args.max_bytes.is_none()
        && let Some(warning) = BlobFacts::new(&packed, max_error_px).warning()
    {
        console.warn(&warning);
    }
    atomic_file::write(&args.output, &packed.bytes)?;
    let object = PackObject {
        schema: "calib-offline/pack/2",
        output: &args.output,
        bytes: packed.bytes.len(),
        max_error_px: args
            .max_error_px
            .or(args.max_bytes.is_none().then_some(default_px)),
        worst_error_px: packed.worst_error_px,
        worst_error_mm: packed.worst_error_mm,
        integer_error_px: packed.integer_error_px,
        cameras: packed
            .tables
            .into_iter()
            .map(|table| PackedCamera {
                name: table.camera,
                form: form_name(table.encoding.form),
                central: table.encoding.is_central,
                cells: table.cells,
                bytes: table.bytes,
                worst_error_px: table.proof.worst_error_px,
                worst_error_mm: table.proof.worst_error_mm,
            })
            .collect(),
        pairs: packed
            .pairs
            .into_iter()
            .map(|pair| PairObject {
                cameras: pair.cameras,
                nodes: pair.nodes,
                bytes: pair.bytes,
                sigma_error: pair.sigma_error,
                calibration_sigma_error: pair.calibration_sigma_error,
            })
            .collect(),
        match_noise_px: rig.match_noise_px,
        curve: packed.curve,
    };
    let uncertainty: String = object.pairs.iter().map(pair_words).collect();
    let asked = match (args.max_error_px, args.max_bytes) {
        (None, Some(bytes)) => format!("at most {bytes} bytes"),
        (_, Some(bytes)) => format!("{max_error_px} px in at most {bytes} bytes"),
        (_, None) => format!("{max_error_px} px"),
    };
    let integers = object.integer_error_px.map_or(String::new(), |px| {
        format!("; in integers every ray within {} px", short(px))
    });
    let words = format!(
        "{} bytes, every ray within {} px, {} mm at the working distance (asked for: {asked}){integers}{uncertainty}; written to {}",
        object.bytes,
        short(object.worst_error_px),
        short(object.worst_error_mm),
        place_in_words(&args.output)
    );
    console.result(&words, &object);
    Ok(Outcome::Done)
}

/// The name of a form in JSON, here and in `inspect`.
pub(super) const fn form_name(form: Form) -> &'static str {
    match form {
        Form::Spline => "spline",
        Form::Patches => "patches",
        Form::Quantized => "quantized",
    }
}

fn pair_words(pair: &PairObject) -> String {
    let percent = |share: f64| short(100.0 * share);
    let [first, second] = &pair.cameras;
    format!(
        "; {} of the bytes are the uncertainty of {first} and {second}, its sigma off by {} % RMS and {} % at worst",
        pair.bytes,
        percent(pair.sigma_error.rms),
        percent(pair.sigma_error.worst)
    )
}
