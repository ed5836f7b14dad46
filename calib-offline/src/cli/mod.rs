//! The command line: what was asked for, who does it, and how the outcome is told.
//!
//! Arguments ([`args`]) become settings ([`settings`]); every verb has a file of its own and
//! returns an [`Outcome`]; everything shown goes through [`output::Console`].

pub mod args;
pub mod calibrate;
pub mod compare;
pub mod demo;
pub mod detect;
pub mod detect_target;
pub mod device;
pub mod error;
pub mod evaluate;
pub mod export;
mod failure;
pub mod flash;
pub mod inspect;
pub mod measure;
pub mod methods;
pub mod output;
pub mod pack;
pub mod place;
pub mod progress;
mod recording;
mod rig_file;
pub mod settings;
pub mod simulate;
pub mod usage_error;

use args::{Cli, Verb};
use clap::Parser;
use error::Error;
use output::Console;
use settings::Settings;
use std::process::ExitCode;

/// How a command that ran to its end came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Done: exit code 0.
    Done,
    /// Done, but the verdict is "fail": exit code 1.
    VerdictFail,
}

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return failure::of_arguments(&error, std::env::args_os()),
    };
    let console = Console::new(Settings::resolve(&cli.common));
    if let Some(threads) = cli.common.threads {
        // Fails only if the pool exists already; then it has the threads it has.
        let _ = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global();
    }
    match run(&cli.verb, &console) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::VerdictFail) => ExitCode::from(1),
        Err(error) => failure::of_command(&error, &console),
    }
}

fn run(verb: &Verb, console: &Console) -> Result<Outcome, Error> {
    match verb {
        Verb::Calibrate(args) => calibrate::run(args, console, &crate::pipeline::calibrate),
        Verb::Compare(args) => compare::run(args),
        Verb::Demo(args) => demo::run(args, console),
        Verb::Detect(args) => recording::detect(args, console),
        Verb::Device(args) => device::run(args, console),
        Verb::Evaluate(args) => evaluate::run(args, console),
        Verb::Export(args) => export::run(args, console),
        Verb::Flash(args) => flash::run(args, console),
        Verb::Inspect(args) => inspect::run(args, console),
        Verb::Measure(args) => measure::run(args, console),
        Verb::Methods(args) => methods::run(args, console),
        Verb::Pack(args) => pack::run(args, console),
        Verb::Simulate(args) => recording::simulate(args, console),
    }
}
