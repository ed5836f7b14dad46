//! `pack`: a calibration to a blob within a proven error.

use super::Outcome;
use super::calibrate::{BLOB_MAX_ERROR_PX, pack_settings};
use super::output::Console;
use super::place::check_file;
use crate::atomic_file;
use crate::error::Error;
use crate::pack::pack;
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
calibration: none is further off than the bound. An earlier blob is replaced; any other file only
with --force.

With --json: schema calib-offline/pack/1, output, bytes, max_error_px (asked for), worst_error_px
(found), cameras (name, cells, bytes, worst_error_px), curve (pairs of table bytes and error, px).";

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
    curve: Vec<(usize, f64)>,
}

#[derive(Debug, Serialize)]
struct PackedCamera {
    name: String,
    cells: [u32; 2],
    bytes: usize,
    worst_error_px: f64,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &PackArgs, console: &Console) -> Result<Outcome, Error> {
    check_file(&args.output, &MAGIC, &[&args.calibration], args.force)?;
    let calibration = Calibration::load(&args.calibration)?;
    console.progress().begin("packing the blob", 0);
    let packed = pack(
        &calibration.rig,
        &pack_settings(&calibration, args.max_error_px),
    );
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
        curve: packed.curve,
    };
    let words = format!(
        "{} bytes, every ray within {} px (asked for: {} px); written to {}",
        object.bytes,
        short(object.worst_error_px),
        args.max_error_px,
        args.output.display()
    );
    console.result(&words, &object);
    Ok(Outcome::Done)
}
