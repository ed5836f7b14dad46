//! What `calibrate` says of recordings with one planted fault, and what a user would then measure:
//! the tables of `VERDICTS.md`.
//!
//! `cargo bench -p calib-offline --bench verdicts -- [--draws N] [--first SEED] [--rig plain|wide|window]
//! [--fault NAME]... [--beside PATH] [--threads N] [--weak]`. Every recording goes to a folder, and a
//! program as a user has it (today's, and another one `--beside` it) calibrates it and measures 400
//! exact matches of the true rig, as it is at the end of the recording.

mod arguments;
mod program;
mod summary;
mod table;
mod weak;

use arguments::{Arguments, Case};
use program::{Outcome, Program};
use rayon::prelude::*;
use std::error::Error;
use std::process::ExitCode;

type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;

fn main() -> ExitCode {
    match Arguments::read(std::env::args().skip(1)).and_then(|arguments| run(&arguments)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let mut programs = vec![Program::built()];
    programs.extend(arguments.beside.iter().map(|path| Program::other(path)));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()?;
    let cases = arguments.cases();
    let outcomes = pool.install(|| outcomes(&programs, &cases))?;
    if !arguments.is_weak_only {
        for &rig in &arguments.rigs {
            println!("\n### Rig: {}, {} draws\n", rig.name(), arguments.draws);
            table::print(rig, &programs, &cases, &outcomes);
        }
        summary::print(&programs, &cases, &outcomes);
    }
    weak::print(&programs, &cases, &outcomes)
}

/// Of every case, what every program says.
fn outcomes(programs: &[Program], cases: &[Case]) -> Result<Vec<Vec<Outcome>>> {
    cases
        .par_iter()
        .map(|case| {
            let recorded = case.recorded()?;
            let of_program = |program| program::outcome(program, &recorded);
            let outcomes = programs.iter().map(of_program).collect::<Result<Vec<_>>>();
            eprintln!("{case}: {}", told(&outcomes));
            outcomes
        })
        .collect()
}

/// The verdicts on a recording, for whoever waits.
fn told(outcomes: &Result<Vec<Outcome>>) -> String {
    match outcomes {
        Ok(outcomes) => {
            let told = outcomes.iter().map(|outcome| {
                let cause = outcome.cause.as_ref();
                let cause = cause.map_or("no cause", |(code, _)| code.as_str());
                let error = outcome.error.map_or(f64::NAN, |error| error.rms);
                format!("{}, {cause}, {error:.3} mm", outcome.verdict)
            });
            told.collect::<Vec<_>>().join("; ")
        }
        Err(error) => error.to_string(),
    }
}
