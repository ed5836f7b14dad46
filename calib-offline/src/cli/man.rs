//! `man`: the manual pages, from the definitions that are parsed by.

use super::Outcome;
use super::error::Error;
use super::output::Console;
use super::place::check_results_folder;
use calib_recording::atomic_file::{WriteError, make_folder, write_set};
use clap::{Args, Command};
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline man -o ~/.local/share/man/man1
  man calib-offline-calibrate";

const FORMATS: &str = "\
Writes calib-offline.1 and a page for each verb, calib-offline-VERB.1.

With --json, schema calib-offline/man/1:
  output
  pages    their names, in order";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct ManArgs {
    /// The folder to write the pages to
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Replace pages that stand there
    #[arg(long)]
    pub force: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct ManObject<'a> {
    schema: &'static str,
    output: &'a Path,
    pages: Vec<&'a str>,
}

/// Runs the verb; `program` is the whole program's command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &ManArgs, program: Command, console: &Console) -> Result<Outcome, Error> {
    let pages = pages(program).map_err(|source| WriteError::Io {
        path: args.output.clone(),
        source,
    })?;
    let names: Vec<&str> = pages.iter().map(|(name, _)| name.as_str()).collect();
    check_results_folder(&args.output, &names, args.force)?;
    make_folder(&args.output)?;
    let files: Vec<(PathBuf, &[u8])> = pages
        .iter()
        .map(|(name, page)| (args.output.join(name), page.as_slice()))
        .collect();
    write_set(&files)?;
    let words = format!("{} pages written to {}", names.len(), args.output.display());
    let object = ManObject {
        schema: "calib-offline/man/1",
        output: &args.output,
        pages: names,
    };
    console.result(&words, &object);
    Ok(Outcome::Done)
}

/// The pages with their names: that of the program, and one for each verb.
fn pages(mut program: Command) -> std::io::Result<Vec<(String, Vec<u8>)>> {
    // So that each verb has the options that hold for all.
    program.build();
    let mut pages = vec![page(program.clone(), "calib-offline")?];
    for verb in program
        .get_subcommands()
        .filter(|verb| verb.get_name() != "help")
    {
        let name = format!("calib-offline-{}", verb.get_name());
        pages.push(page(verb.clone().display_name(name.clone()), &name)?);
    }
    Ok(pages)
}

fn page(command: Command, name: &str) -> std::io::Result<(String, Vec<u8>)> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command)
        .title(name.to_uppercase())
        .render(&mut page)?;
    Ok((format!("{name}.1"), page))
}
