//! The procedure from top to bottom, one call per step: the file to read first.
//!
//! A dataset's corners become observations; initialization finds lenses and poses, and the views
//! that cannot be what they claim; the joint estimate adjusts everything and looks at the views
//! once more; held-out boards and the calibration itself judge it; the record says all of it.

pub mod alternatingly;
pub mod jointly;
mod left_out;
pub mod solution;
mod summary;

use crate::error::{DATA_UNDETERMINED, Error, UsageError};
use crate::evaluate::verdict::Thresholds;
use crate::evaluate::{Folds, held_out};
use crate::report::Calibration;
use alternatingly::alternating_solution;
use calib_estimate::adjust::Observations;
use calib_estimate::alternating::rays::RaySource;
use calib_rays::field::RayTable;
use calib_rays::observed::View;
use calib_rays::progress::Progress;
use calib_recording::dataset::corners::{load_corners, poses};
use calib_recording::dataset::split::without_excluded;
use calib_recording::dataset::sufficiency::{SufficiencyError, check_sufficiency};
use calib_recording::dataset::{Dataset, stage};
use calib_recording::detect::suspicion::suspicious_labels;
use calib_recording::detect::verdict::Outcome;
use calib_recording::detect::{self, DetectSettings};
use clap::ValueEnum;
use jointly::joint_solution;
use solution::{Solved, Task};

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
    /// Whether a table with one ray per pixel is made of every camera.
    pub ray_tables: bool,
}

impl Default for CalibrateSettings {
    fn default() -> Self {
        Self {
            method: Method::Joint,
            folds: 5,
            thresholds: Thresholds::default(),
            detect: DetectSettings::default(),
            ray_tables: false,
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
    /// One ray per pixel as the method has them; `None` where it has fields.
    pub ray_sources: Option<Vec<RaySource>>,
}

/// A calibration, and what else was asked for.
#[derive(Debug)]
pub struct Calibrated {
    /// The calibration.
    pub calibration: Calibration,
    /// One ray per pixel of each camera, in the rig's order; empty unless asked for. Those of the
    /// published procedure are its own, before they are smoothed into the calibration's field.
    pub ray_tables: Vec<RayTable>,
}

impl From<Calibration> for Calibrated {
    fn from(calibration: Calibration) -> Self {
        Self {
            calibration,
            ray_tables: Vec::new(),
        }
    }
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
) -> Result<Calibrated, Error> {
    let corners = corners(dataset, &settings.detect, progress)?;
    let checked = calibrate_corners(dataset, &corners, settings, progress)?;
    let mut calibrated = Calibrated::from(checked.calibration);
    if settings.ray_tables {
        let cameras = &calibrated.calibration.rig.cameras;
        progress.begin("ray tables", cameras.len());
        calibrated.ray_tables = cameras
            .iter()
            .enumerate()
            .map(|(camera_idx, camera)| {
                let sources = checked.ray_sources.as_ref();
                let table = match sources.and_then(|sources| sources.get(camera_idx)) {
                    Some(source) => source.table(camera.field.sensor),
                    None => RayTable::of_camera(camera),
                };
                progress.advance();
                table
            })
            .collect();
        progress.end();
    }
    Ok(calibrated)
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
    let Offered {
        views,
        observations,
    } = offered(dataset, corners)?;
    let names = camera_names(dataset);
    let all_poses = poses(&corners.views);
    let task = Task {
        names: &names,
        folds: settings.folds,
        placement: &|pose| stage::entry(dataset, &all_poses, pose).placement,
    };
    let found = match settings.method {
        Method::Joint => joint_solution(&observations, &task, progress),
        Method::Alternating => alternating_solution(&observations, &task, progress),
    };
    let Solved { solution, folds } = found.map_err(|error| explained(error, dataset, &views))?;
    let calibration = summary::record(&summary::Parts {
        dataset,
        corners,
        observations: &observations,
        solution: &solution,
        held_out: &held_out(&folds),
        thresholds: &settings.thresholds,
    });
    Ok(Checked {
        calibration,
        offered: observations,
        folds,
        ray_sources: solution.ray_sources,
    })
}

/// What a dataset offers to any method.
#[derive(Debug)]
pub struct Offered {
    /// As the dataset has them.
    pub views: Vec<View>,
    /// Arranged for adjustment.
    pub observations: Observations,
}

/// What a dataset offers to any method: its corners without the poses that the user leaves out.
///
/// # Errors
/// A pose to leave out that is none; too few corners.
pub fn offered(dataset: &Dataset, corners: &Corners) -> Result<Offered, Error> {
    check_excluded(dataset, &corners.views)?;
    let views = without_excluded(corners.views.clone(), &dataset.excluded_poses).used;
    check_sufficiency(dataset, &views)
        .map_err(|error| with_refusals(dataset, error, corners.detection.as_ref()))?;
    let sensors = dataset.cameras.iter().map(|camera| camera.sensor).collect();
    Ok(Offered {
        observations: Observations::new(dataset.board, sensors, &views),
        views,
    })
}

/// An error, with labels that contradict each other if they explain it: they are looked for only where
/// the data determined no answer.
pub fn explained(error: Error, dataset: &Dataset, used: &[View]) -> Error {
    if error.exit_code() != DATA_UNDETERMINED {
        return error;
    }
    match suspicious_labels(dataset, used) {
        Some(suspicion) => Error::Labels {
            suspicion,
            source: Box::new(error),
        },
        None => error,
    }
}

/// Names of the cameras, in order.
pub fn camera_names(dataset: &Dataset) -> Vec<String> {
    dataset.cameras.iter().map(|c| c.name.clone()).collect()
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
