//! What can be written on the command line. Each help text starts with an example.

use super::settings::CommonArgs;
use super::{
    audit, calibrate, compare, completions, demo, detect, device, evaluate, export, flash, import,
    inspect, keygen, man, measure, methods, pack, rays, report, sign, simulate, target, verify,
};
use clap::{Parser, Subcommand};

const EXAMPLE: &str = "\
Example:
  calib-offline detect recordings/monday
  calib-offline calibrate recordings/monday -o results/monday
  calib-offline measure results/monday/rig.rays matches.csv -o points.csv";

const SIMULATE_EXAMPLE: &str = "\
Example:
  calib-offline simulate -o port --optics port --seed 7";

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  done, but the verdict is \"fail\"
  2  usage, file or format error
  3  the data cannot determine the answer

Results go to standard output, narration and progress to standard error. Files are written whole
or not at all. With --json, standard output holds one object with a \"schema\" field and nothing
else, for errors too. -o - writes a command's file to standard output and its words to standard
error; not with --json, and not where there are several files.";

const SIMULATE_FORMATS: &str = "\
With --json, schema calib-offline/simulate/1:
  folder, optics, seed, camera_count, pose_count, corner_count, image_count, point_count
  holdout_count, points_oracle_rms_mm, holdout_oracle_rms_mm
  hull_share    share of each camera's image inside the hull of all corners
  byte_count";

/// Calibrates cameras with one ray per pixel, from a chessboard.
#[derive(Debug, Parser)]
#[command(name = "calib-offline", version, before_help = EXAMPLE, after_help = EXIT_CODES, max_term_width = 100)]
pub struct Cli {
    /// What holds for every verb.
    #[command(flatten)]
    pub common: CommonArgs,
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Judge calibrations, by other tools too, on a dataset beside our own estimate of it
    Audit(audit::AuditArgs),
    /// Calibrate from a dataset: calibration.json, rig.rays and report.html
    Calibrate(calibrate::CalibrateArgs),
    /// Compare two calibrations of one rig: their difference, beside the predicted one
    Compare(compare::CompareArgs),
    /// Print what a shell needs to complete commands
    Completions(completions::CompletionsArgs),
    /// Run the whole chain on the data that comes with the program
    Demo(demo::DemoArgs),
    /// Find the board's corners in a dataset's images: corners.csv
    Detect(detect::DetectArgs),
    /// Ask a device how it is, have it test itself, or go back to the blob before
    Device(device::DeviceArgs),
    /// Run the publication's experiments with three methods: figures, tables, evaluation.json
    Evaluate(evaluate::EvaluateArgs),
    /// Write a blob for a flash tool or a compiler, or a rig for another tool
    Export(export::ExportArgs),
    /// Send a blob to a device
    Flash(flash::FlashArgs),
    /// Take a calibration by another tool: ours, with what was lost
    Import(import::ImportArgs),
    /// Say what a dataset, a calibration or a blob is
    Inspect(inspect::InspectArgs),
    /// Make a key for the owner of devices
    Keygen(keygen::KeygenArgs),
    /// Write the manual pages
    Man(man::ManArgs),
    /// Triangulate matches
    Measure(measure::MeasureArgs),
    /// Compare the ray field with a pinhole on the same boards
    Methods(methods::MethodsArgs),
    /// Pack a calibration for the device within a proven error
    Pack(pack::PackArgs),
    /// Look up the rays of single pixels
    Rays(rays::RaysArgs),
    /// Sign a blob for devices that have an owner
    Sign(sign::SignArgs),
    /// Draw the page of a calibration again, without its recording
    Report(report::ReportArgs),
    /// Make a dataset with known truth
    #[command(before_help = SIMULATE_EXAMPLE, after_help = SIMULATE_FORMATS)]
    Simulate(simulate::SimulateArgs),
    /// Draw a calibration target to print, with its description
    Target(target::TargetArgs),
    /// Say whether an old calibration still holds, by a few new poses, and what changed
    Verify(verify::VerifyArgs),
}
