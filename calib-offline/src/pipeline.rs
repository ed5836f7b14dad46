//! The procedure from top to bottom, one call per step: the file to read first.
//!
//! A dataset's corners become observations; initialization finds lenses and poses, and the views
//! that cannot be what they claim; the joint estimate adjusts everything and looks at the views
//! once more; held-out boards and the calibration itself judge it; the record says all of it.

mod left_out;
mod summary;

use crate::adjust::Observations;
use crate::dataset::corners::{load_corners, poses};
use crate::dataset::split::without_excluded;
use crate::dataset::sufficiency::{SufficiencyError, check_sufficiency};
use crate::dataset::{Dataset, View, stage};
use crate::detect::suspicion::suspicious_labels;
use crate::detect::verdict::Outcome;
use crate::detect::{self, DetectSettings};
use crate::error::{Error, UsageError};
use crate::evaluate::half_data::first_half;
use crate::evaluate::verdict::Thresholds;
use crate::evaluate::{Folds, cross_check, estimate_folds, held_out};
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
    /// Folds of the held-out check; 0 leaves it out, and the comparison of two halves with it.
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

/// A calibration, and what its held-out check was made from.
#[derive(Debug)]
pub struct Checked {
    /// The calibration.
    pub calibration: Calibration,
    /// What was offered to it, as recorded: no view left out, no pair taken apart.
    pub offered: Observations,
    /// The estimates of the held-out check, for whoever wants to measure with them.
    pub folds: Folds,
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
    let checked = calibrate_corners(dataset, &corners, settings, progress)?;
    Ok(checked.calibration)
}

/// [`calibrate`] from corners that are there already; keeps what the check was made from.
///
/// # Errors
/// Data that cannot determine the answer.
pub fn calibrate_corners(
    dataset: &Dataset,
    corners: &Corners,
    settings: &CalibrateSettings,
    progress: &dyn Progress,
) -> Result<Checked, Error> {
    if settings.method != Method::Joint {
        return Err(Error::Usage(UsageError::NoSuchMethod {
            method: settings.method.name(),
        }));
    }
    check_excluded(dataset, &corners.views)?;
    let selection = without_excluded(corners.views.clone(), &dataset.excluded_poses);
    check_sufficiency(dataset, &selection.used)
        .map_err(|error| with_refusals(dataset, error, corners.detection.as_ref()))?;
    // Labels that contradict each other are looked for only where they would explain a failure.
    let explained = |error: Error| match suspicious_labels(dataset, &selection.used) {
        Some(suspicion) => Error::Labels {
            suspicion,
            source: Box::new(error),
        },
        None => error,
    };
    let sensors = dataset.cameras.iter().map(|camera| camera.sensor).collect();
    let observations = Observations::new(dataset.board, sensors, &selection.used);

    progress.begin("initialize", 1);
    let start = start_rig(&observations).map_err(|error| explained(error.into()))?;
    progress.end();

    progress.begin("estimate", 1);
    let (mut estimate, findings) =
        estimate_screened(&observations, start).map_err(|error| explained(error.into()))?;
    let names: Vec<String> = dataset.cameras.iter().map(|c| c.name.clone()).collect();
    let mut rig = estimate.rig(&names);
    estimate.fill_uncertainty(&mut rig)?;
    progress.end();

    let board_peak_to_valley_mm = estimate.board_peak_to_valley_mm()?;

    let wanted = if estimate.pose_count() >= 2 * crate::dataset::sufficiency::MIN_POSES {
        settings.folds
    } else {
        0
    };
    let all_poses = poses(&corners.views);
    let placement = |pose| stage::entry(dataset, &all_poses, pose).placement;
    let half = first_half(estimate.observations.poses.iter().copied(), placement);
    let half = (settings.folds > 0).then_some(&half);
    progress.begin("cross-checks", wanted);
    let (folds, checks) = rayon::join(
        || estimate_folds(&estimate.observations, wanted, progress),
        || cross_check(&estimate, &rig, half),
    );
    progress.end();
    let calibration = summary::record(&summary::Parts {
        dataset,
        corners,
        observations: &observations,
        estimate: &estimate,
        rig,
        findings: &findings,
        board_peak_to_valley_mm,
        held_out: &held_out(&folds),
        checks,
        thresholds: &settings.thresholds,
    });
    Ok(Checked {
        calibration,
        offered: observations,
        folds,
    })
}

/// Every pose that is left out must be one: a slip in a number would leave the bad pose in.
fn check_excluded(dataset: &Dataset, views: &[View]) -> Result<(), UsageError> {
    let last_seen = views.iter().map(|view| view.pose).max();
    let last_image = dataset.image_pose_count().checked_sub(1);
    let last = last_seen.max(last_image).unwrap_or(0);
    match dataset.excluded_poses.iter().find(|pose| **pose > last) {
        Some(&pose) => Err(UsageError::NoSuchPose { pose, last }),
        None => Ok(()),
    }
}

/// Too few corners, with the reason for which images were refused.
fn with_refusals(
    dataset: &Dataset,
    source: SufficiencyError,
    detection: Option<&detect::Detection>,
) -> Error {
    let images = detection.map_or(&[][..], |detection| &detection.images);
    let mut refused = images.iter().filter_map(|image| match &image.outcome {
        Outcome::Refused(reason) => Some((image, reason)),
        Outcome::Used { .. } => None,
    });
    let Some((image, reason)) = refused.next() else {
        return Error::Sufficiency(source);
    };
    let path = image.path.strip_prefix(&dataset.folder);
    let path = path.unwrap_or(&image.path);
    Error::FewImages {
        first: format!("{}: {reason}", path.display()),
        refused: 1 + refused.count(),
        total: images.len(),
        source,
    }
}
