//! The procedure top to bottom.

use crate::dataset::split::without_excluded;
use crate::dataset::{CornersError, Dataset, check_sufficiency, load_corners};
use crate::error::{Error, UsageError};
use crate::progress::Progress;
use crate::report::Calibration;
use clap::ValueEnum;

/// How to calibrate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CalibrateSettings {
    /// Which estimate.
    pub method: Method,
    /// Seed of everything drawn at random.
    pub seed: u64,
}

/// Which estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// All cameras and poses together.
    Joint,
    /// The published procedure.
    Alternating,
}

impl Method {
    /// The name in files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::Alternating => "alternating",
        }
    }
}

/// Calibrates from a dataset.
///
/// # Errors
/// [`Error`], of the stage that failed.
pub fn calibrate(
    dataset: &Dataset,
    settings: &CalibrateSettings,
    progress: &dyn Progress,
) -> Result<Calibration, Error> {
    progress.begin("reading corners", 0);
    let views = load_corners(dataset)?.ok_or_else(|| CornersError::Read {
        file: dataset.corners_path(),
        source: std::io::ErrorKind::NotFound.into(),
    })?;
    progress.end();
    let selection = without_excluded(views, &dataset.excluded_poses);
    check_sufficiency(dataset, &selection.used)?;
    Err(Error::Usage(UsageError::NoSuchMethod {
        method: settings.method.name(),
    }))
}
