//! The procedure from top to bottom, one call per step: the file to read first.
//!
//! A dataset's corners become observations; initialization finds lenses and poses, and the views
//! that cannot be what they claim; the joint estimate adjusts everything and looks at the views
//! once more; held-out boards judge it; the record says all of it.

mod summary;

use crate::adjust::Observations;
use crate::dataset::corners::load_corners;
use crate::dataset::split::without_excluded;
use crate::dataset::sufficiency::check_sufficiency;
use crate::dataset::{Dataset, View};
use crate::detect::{self, DetectSettings};
use crate::error::{Error, UsageError};
use crate::evaluate::held_out::{HeldOut, held_out};
use crate::evaluate::verdict::Thresholds;
use crate::init::rig::start_rig;
use crate::joint::estimate_screened;
use crate::progress::Progress;
use crate::report::Calibration;
use clap::ValueEnum;

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

/// How to calibrate. Nothing here needs to be chosen by the user. Poses are left out by the
/// dataset's own list.
#[derive(Debug, Clone)]
pub struct CalibrateSettings {
    /// Which estimate.
    pub method: Method,
    /// Folds of the held-out check; 0 leaves it out.
    pub folds: usize,
    /// What counts as good.
    pub thresholds: Thresholds,
    /// How images are searched, if the dataset has no corners.
    pub detect: DetectSettings,
}

impl Default for CalibrateSettings {
    fn default() -> Self {
        Self {
            method: Method::Joint,
            folds: 5,
            thresholds: Thresholds::default(),
            detect: DetectSettings::default(),
        }
    }
}

/// Corners of a dataset, and where they come from.
#[derive(Debug)]
pub struct Corners {
    /// The views.
    pub views: Vec<View>,
    /// The verdicts per image, if the corners were detected and not read.
    pub detection: Option<detect::Detection>,
}

/// Corners from `corners.csv` if there is one, else from the images.
///
/// # Errors
/// Unreadable or inconsistent files; images that cannot be labelled.
pub fn corners(
    dataset: &Dataset,
    settings: &DetectSettings,
    progress: &dyn Progress,
) -> Result<Corners, Error> {
    if let Some(views) = load_corners(dataset)? {
        return Ok(Corners {
            views,
            detection: None,
        });
    }
    let detection = detect::detect_dataset(dataset, settings, progress)?;
    Ok(Corners {
        views: detection.views.clone(),
        detection: Some(detection),
    })
}

/// Calibrates a dataset.
///
/// Deterministic: the same input gives the same result on the same build, whatever the number of
/// threads.
///
/// # Errors
/// The stage's own error: unusable input, or data that cannot determine the answer.
pub fn calibrate(
    dataset: &Dataset,
    settings: &CalibrateSettings,
    progress: &dyn Progress,
) -> Result<Calibration, Error> {
    let corners = corners(dataset, &settings.detect, progress)?;
    calibrate_corners(dataset, &corners, settings, progress)
}

/// [`calibrate`] from corners that are there already.
///
/// # Errors
/// Data that cannot determine the answer.
pub fn calibrate_corners(
    dataset: &Dataset,
    corners: &Corners,
    settings: &CalibrateSettings,
    progress: &dyn Progress,
) -> Result<Calibration, Error> {
    if settings.method != Method::Joint {
        return Err(Error::Usage(UsageError::NoSuchMethod {
            method: settings.method.name(),
        }));
    }
    let selection = without_excluded(corners.views.clone(), &dataset.excluded_poses);
    check_sufficiency(dataset, &selection.used)?;
    let sensors = dataset.cameras.iter().map(|camera| camera.sensor).collect();
    let observations = Observations::new(dataset.board, sensors, &selection.used);

    progress.begin("initialize", 1);
    let start = start_rig(&observations)?;
    progress.end();

    progress.begin("estimate", 1);
    let (estimate, findings) = estimate_screened(&observations, start)?;
    progress.end();

    let unseen = if estimate.pose_count() >= 2 * crate::dataset::sufficiency::MIN_POSES {
        progress.begin("check on held-out poses", settings.folds);
        let unseen = held_out(&estimate.observations, settings.folds, progress);
        progress.end();
        unseen
    } else {
        HeldOut::default()
    };
    Ok(summary::record(&summary::Parts {
        dataset,
        corners,
        observations: &observations,
        estimate: &estimate,
        findings: &findings,
        held_out: &unseen,
        thresholds: &settings.thresholds,
    }))
}
