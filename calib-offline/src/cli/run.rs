//! From the arguments of the process to its exit code: each verb's work is in its own file.

use super::args::{Cli, Verb};
use super::error::Error;
use super::outcome::Outcome;
use super::output::Console;
use super::settings::{Settings, Words};
use super::usage_error::UsageError;
use super::{
    audit, calibrate, compare, completions, demo, device, evaluate, export, failure, flash, import,
    inspect, keygen, man, measure, methods, pack, rays, recording, report, sign, target, verify,
};
use calib_recording::atomic_file::is_standard_output;
use clap::{ArgMatches, Command, CommandFactory as _, FromArgMatches as _};
use std::path::PathBuf;
use std::process::ExitCode;

/// The command with options that take a number below zero as their value, and no option of its own: what is wrong with
/// it the reader of the value says best.
fn with_negative_numbers(command: Command) -> Command {
    let command = command.mut_args(|arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    });
    command.mut_subcommands(with_negative_numbers)
}

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    let parsed = with_negative_numbers(Cli::command())
        .try_get_matches()
        .and_then(|matches| Ok((Cli::from_arg_matches(&matches)?, writes_to_stdout(&matches))));
    let (cli, file_on_stdout) = match parsed {
        Ok(parsed) => parsed,
        Err(error) => return failure::of_arguments(&error, std::env::args_os()),
    };
    let is_one_too_many = file_on_stdout && cli.common.json;
    let words = if file_on_stdout && !is_one_too_many {
        Words::BesideFile
    } else {
        Words::StandardOutput
    };
    let settings = Settings::resolve(&cli.common, words);
    let console = Console::new(settings);
    if is_one_too_many {
        let error = Error::Usage(UsageError::TwoOnStandardOutput);
        return failure::of_command(&error, &console);
    }
    if let Some(threads) = cli.common.threads {
        // Fails only if the pool exists already; then it has the threads it has.
        let _ = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global();
    }
    let code = match run(&cli.verb, &console) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::VerdictFail) => ExitCode::from(1),
        Ok(Outcome::Undetermined) => ExitCode::from(3),
        Err(error) => failure::of_command(&error, &console),
    };
    let lost = console.take_lost();
    lost.map_or(code, |source| {
        failure::of_command(&Error::Output(source), &console)
    })
}

/// Whether the verb's own file goes to standard output.
fn writes_to_stdout(matches: &ArgMatches) -> bool {
    let Some((_, verb)) = matches.subcommand() else {
        return false;
    };
    // Not every verb has an output.
    let output = verb.try_get_one::<PathBuf>("output");
    output.is_ok_and(|output| output.is_some_and(|output| is_standard_output(output)))
}

fn run(verb: &Verb, console: &Console) -> Result<Outcome, Error> {
    match verb {
        Verb::Audit(args) => audit::run(args, console),
        Verb::Calibrate(args) => calibrate::run(args, console, &crate::pipeline::calibrate),
        Verb::Compare(args) => compare::run(args, console),
        Verb::Completions(args) => Ok(completions::run(args, Cli::command(), console)),
        Verb::Demo(args) => demo::run(args, console),
        Verb::Detect(args) => recording::detect(args, console),
        Verb::Device(args) => device::run(args, console),
        Verb::Evaluate(args) => evaluate::run(args, console),
        Verb::Export(args) => export::run(args, console),
        Verb::Flash(args) => flash::run(args, console),
        Verb::Import(args) => import::run(args, console),
        Verb::Inspect(args) => inspect::run(args, console),
        Verb::Keygen(args) => keygen::run(args, console),
        Verb::Man(args) => man::run(args, Cli::command(), console),
        Verb::Measure(args) => measure::run(args, console),
        Verb::Methods(args) => methods::run(args, console),
        Verb::Pack(args) => pack::run(args, console),
        Verb::Rays(args) => rays::run(args, console),
        Verb::Sign(args) => sign::run(args, console),
        Verb::Report(args) => report::run(args, console),
        Verb::Simulate(args) => recording::simulate(args, console),
        Verb::Target(args) => target::run(args, console),
        Verb::Verify(args) => verify::run(args, console),
    }
}
