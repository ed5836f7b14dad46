//! How an error is told: what failed, why, and what to do about it.

use super::error::Error;
use super::output::{Console, Paint};
use super::settings::{Narration, Settings, Words};
use calib_judge::Cause;
use calib_rays::remedy::Remedy;
use serde::Serialize;
use std::error::Error as _;
use std::ffi::OsString;
use std::process::ExitCode;

/// What `--json` prints for an error.
#[derive(Debug, Serialize)]
struct ErrorObject {
    schema: &'static str,
    exit_code: u8,
    /// From what was attempted to the innermost cause.
    error: Vec<String>,
    remedy: Option<String>,
    /// What is wrong with the recording, most likely first.
    causes: Vec<Cause>,
}

const SCHEMA: &str = "calib-offline/error/1";

/// Tells of a command that failed.
pub(super) fn of_command(error: &Error, console: &Console) -> ExitCode {
    let mut chain = vec![error.to_string()];
    let mut cause = error.source();
    while let Some(inner) = cause {
        let text = inner.to_string();
        // Some errors already end with their cause.
        if !chain.last().is_some_and(|outer| outer.ends_with(&text)) {
            chain.push(text);
        }
        cause = inner.source();
    }
    let word = console.painted("error:", Paint::Red);
    console.error_line(&format!("{word} {}", chain[0]));
    for inner in &chain[1..] {
        console.error_line(&format!("  {inner}"));
    }
    let remedy = error.remedy();
    if let Some(remedy) = &remedy {
        console.error_line(&format!("try: {remedy}"));
    }
    let exit_code = error.exit_code();
    if console.settings().json {
        let object = ErrorObject {
            schema: SCHEMA,
            exit_code,
            error: chain,
            remedy,
            causes: error.causes(),
        };
        console.result("", &object);
    }
    ExitCode::from(exit_code)
}

/// Tells of arguments that were not understood, or gives the help that was asked for.
pub(super) fn of_arguments(
    error: &clap::Error,
    mut arguments: impl Iterator<Item = OsString>,
) -> ExitCode {
    // A reader that has gone away is no error.
    let _ = error.print();
    if !error.use_stderr() {
        return ExitCode::SUCCESS;
    }
    if arguments.any(|argument| argument == "--json") {
        let text = error.render().to_string();
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        let console = Console::new(Settings {
            json: true,
            narration: Narration::Errors,
            color: false,
            bars: false,
            words: Words::StandardOutput,
        });
        let object = ErrorObject {
            schema: SCHEMA,
            exit_code: 2,
            error: lines.take(1).map(str::to_owned).collect(),
            remedy: Some("see calib-offline --help".to_owned()),
            causes: Vec::new(),
        };
        console.result("", &object);
    }
    ExitCode::from(2)
}
