//! `pack`: a calibration to a blob within a proven error.

use super::Outcome;
use super::calibrate::{BLOB_MAX_ERROR_PX, pack_settings};
use super::output::Console;
use super::place::check_file;
use crate::atomic_file;
use crate::error::Error;
use crate::pack::{Deviation, PackSettings, pack};
use crate::report::Calibration;
use crate::report::text::short;
use clap::Args;
use ray_runtime::format::MAGIC;
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline pack results/calibration.json -o small.rays --max-error-px 0.01";

const FORMATS: &str = "\
Every pixel of the calibrated area is looked up in the finished blob and compared with the
calibration: none is further off than the bound. The uncertainty goes with it on a coarse grid; how
far that changes predicted standard deviations is measured and said. An earlier blob is replaced;
any other file only with --force.

With --json: schema calib-offline/pack/1, output, bytes, max_error_px (asked for), worst_error_px
(found), cameras (name, cells, bytes, worst_error_px), pairs (cameras, nodes, bytes; sigma_error and
calibration_sigma_error: rms and worst, relative), curve (pairs of table bytes and error, px).";

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
    /// No ray may be further off than this, px
    #[arg(long, value_name = "E", default_value_t = BLOB_MAX_ERROR_PX)]
    pub max_error_px: f64,
    /// Leave out the uncertainty: a smaller blob, and no sigma from it
    #[arg(long)]
    pub no_uncertainty: bool,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct PackObject<'a> {
    schema: &'static str,
    output: &'a Path,
    bytes: usize,
    max_error_px: f64,
    worst_error_px: f64,
    cameras: Vec<PackedCamera>,
    pairs: Vec<PairObject>,
    curve: Vec<(usize, f64)>,
}

#[derive(Debug, Serialize)]
struct PackedCamera {
    name: String,
    cells: [u32; 2],
    bytes: usize,
    worst_error_px: f64,
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
    let calibration = Calibration::load(&args.calibration)?;
    console.progress().begin("packing the blob", 0);
    let settings = PackSettings {
        with_uncertainty: !args.no_uncertainty,
        ..pack_settings(&calibration, args.max_error_px)
    };
    let packed = pack(&calibration.rig, &settings);
    console.progress().end();
    let packed = packed?;
    atomic_file::write(&args.output, &packed.bytes)?;
    let object = PackObject {
        schema: "calib-offline/pack/1",
        output: &args.output,
        bytes: packed.bytes.len(),
        max_error_px: args.max_error_px,
        worst_error_px: packed.worst_error_px,
        cameras: packed
            .grids
            .into_iter()
            .map(|grid| PackedCamera {
                name: grid.camera,
                cells: grid.cells,
                bytes: grid.bytes,
                worst_error_px: grid.proof.worst_error_px,
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
        curve: packed.curve,
    };
    let uncertainty: String = object.pairs.iter().map(pair_words).collect();
    let words = format!(
        "{} bytes, every ray within {} px (asked for: {} px){uncertainty}; written to {}",
        object.bytes,
        short(object.worst_error_px),
        args.max_error_px,
        args.output.display()
    );
    console.result(&words, &object);
    Ok(Outcome::Done)
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
