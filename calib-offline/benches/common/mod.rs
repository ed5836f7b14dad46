//! What the tables of `BENCHMARKS.md` share: arguments, and draws in parallel.

#[path = "../../tests/it/common/against_truth.rs"]
pub mod against_truth;
#[path = "../../tests/it/common/halves.rs"]
pub mod halves;

use calib_simulate::OpticsKind;
use clap::ValueEnum;
use rayon::prelude::*;
use std::fmt::Display;
use std::process::ExitCode;

pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// Noise draws of a row unless told otherwise.
const DRAWS: u64 = 5;

/// `[NAME ...] [--draws N] [--first SEED] [--detail]`.
pub struct Arguments {
    /// Rows asked for; none for all.
    pub names: Vec<String>,
    /// Noise draws of a row.
    pub draws: u64,
    /// Seed of the first.
    pub first: u64,
    /// Whether to print what each draw gave.
    pub detail: bool,
}

impl Arguments {
    fn read(arguments: impl Iterator<Item = String>) -> Result<Self> {
        let mut read = Self {
            names: Vec::new(),
            draws: DRAWS,
            first: 1,
            detail: false,
        };
        // Cargo says --bench to every one.
        let mut arguments = arguments.filter(|argument| argument != "--bench");
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                "--draws" => {
                    read.draws = arguments.next().ok_or("--draws needs a number")?.parse()?;
                }
                "--first" => {
                    read.first = arguments.next().ok_or("--first needs a seed")?.parse()?;
                }
                "--detail" => read.detail = true,
                _ => read.names.push(argument),
            }
        }
        Ok(read)
    }

    /// The optics asked for.
    pub fn optics(&self, all: &[OpticsKind]) -> Result<Vec<OpticsKind>> {
        if self.names.is_empty() {
            return Ok(all.to_vec());
        }
        let names = self.names.iter();
        let optics = names.map(|name| OpticsKind::from_str(name, true));
        Ok(optics.collect::<std::result::Result<_, String>>()?)
    }

    /// What each draw of a row gives, by their seeds; an error says row and seed.
    pub fn drawn<T: Send, E: Display>(
        &self,
        row: &str,
        draw: impl Fn(u64) -> std::result::Result<T, E> + Sync,
    ) -> Result<Vec<T>> {
        let drawn = (self.first..self.first + self.draws)
            .into_par_iter()
            .map(|seed| draw(seed).map_err(|error| format!("{row} {seed}: {error}")))
            .collect::<std::result::Result<_, String>>()?;
        Ok(drawn)
    }
}

/// Prints a table, or why there is none.
pub fn print_table(table: impl FnOnce(&Arguments) -> Result<()>) -> ExitCode {
    let arguments = Arguments::read(std::env::args().skip(1));
    match arguments.and_then(|arguments| table(&arguments)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
