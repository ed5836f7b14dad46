//! `compare`: for two calibrations, which it cannot do yet. Says where methods are compared.

use super::Outcome;
use super::error::Error;
use super::usage_error::UsageError;
use clap::Args;
use std::path::PathBuf;

/// The arguments, and those that `methods` had under this name.
#[derive(Debug, Args)]
#[command(before_help = "Example:\n  calib-offline methods recordings/monday")]
pub struct CompareArgs {
    /// Two calibrations
    #[arg(value_name = "CALIBRATION")]
    pub files: Vec<PathBuf>,
    /// Of `methods`
    #[arg(short, long, hide = true)]
    pub output: Option<PathBuf>,
    /// Of `methods`
    #[arg(long, hide = true)]
    pub folds: Option<String>,
    /// Of `methods`
    #[arg(long, hide = true)]
    pub force: bool,
}

/// Refuses.
///
/// # Errors
/// [`UsageError::CompareIsMethods`].
pub fn run(_: &CompareArgs) -> Result<Outcome, Error> {
    Err(UsageError::CompareIsMethods.into())
}
