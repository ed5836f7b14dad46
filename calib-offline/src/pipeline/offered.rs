//! What a dataset offers to any method, and why none could make use of it.

use super::corners::Corners;
use super::error::{CalibrateError, NoKnownPose, NoSuchPose};
use crate::methods::MethodError;
use calib_estimate::adjust::Observations;
use calib_judge::plausibility::{FITS_PER_WIDTH, Sheet, misread};
use calib_judge::verdict::Grade;
use calib_judge::{Cause, Code};
use calib_rays::observed::View;
use calib_recording::dataset::split::without_excluded;
use calib_recording::dataset::sufficiency::{SufficiencyError, check_sufficiency};
use calib_recording::dataset::{Dataset, ExpectedOptics};
use calib_recording::detect;
use calib_recording::detect::verdict::Outcome;

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
pub fn offered(dataset: &Dataset, corners: &Corners) -> Result<Offered, CalibrateError> {
    check_excluded(dataset, &corners.views)?;
    let views = without_excluded(corners.views.clone(), &dataset.excluded_poses).used;
    check_sufficiency(dataset, &views)
        .map_err(|error| with_refusals(dataset, error, corners.detection.as_ref()))?;
    check_known(dataset, &views)?;
    let sensors = dataset.cameras.iter().map(|camera| camera.sensor).collect();
    Ok(Offered {
        observations: Observations::new(dataset.board.clone(), sensors, &views)
            .with_flatness(dataset.certificate.and_then(|c| c.flatness_mm_sd))
            .with_known_poses(dataset.known_poses.clone())
            .with_declared_central(declared_central(
                dataset.cameras.iter().map(|camera| camera.optics),
            )),
        views,
    })
}

/// Cameras that look through nothing and into nothing, by what is declared of each.
pub(super) fn declared_central(
    declared: impl Iterator<Item = Option<ExpectedOptics>>,
) -> Vec<bool> {
    declared
        .map(|optics| optics == Some(ExpectedOptics::Plain))
        .collect()
}

/// Why no method had an answer: what is wrong with the recording on its face, if anything is.
pub fn explained(error: MethodError, dataset: &Dataset, used: &[View]) -> CalibrateError {
    if let Some(known) = misread(dataset, used) {
        return CalibrateError::Misread {
            file: known.file(dataset),
            known,
            source: Some(error),
        };
    }
    let causes = Sheet::of(dataset, used).causes;
    // What was not seen explains no failure.
    let explains = |cause: &&Cause| cause.grade > Grade::Pass && cause.code != Code::Coverage;
    match causes.iter().find(explains) {
        Some(first) => CalibrateError::Implausible {
            first: Box::new(first.clone()),
            causes,
            source: error,
        },
        None => error.into(),
    }
}

/// Refuses an answer that leaves so much of every corner that what was known beforehand must be wrong, and says how
/// it would fit.
///
/// # Errors
/// [`CalibrateError::Misread`].
pub fn check_known_fits(
    dataset: &Dataset,
    views: &[View],
    sigma_px: f64,
) -> Result<(), CalibrateError> {
    let widths = dataset.cameras.iter().map(|camera| camera.sensor.width);
    let narrowest_px = widths.min().map_or(0.0, f64::from);
    let is_grid = dataset.board.layout.is_grid() && dataset.known_poses.is_empty();
    if is_grid || sigma_px <= FITS_PER_WIDTH * narrowest_px {
        return Ok(());
    }
    match misread(dataset, views) {
        Some(known) => Err(CalibrateError::Misread {
            file: known.file(dataset),
            known,
            source: None,
        }),
        None => Ok(()),
    }
}

/// Names of the cameras, in order.
pub fn camera_names(dataset: &Dataset) -> Vec<String> {
    dataset.cameras.iter().map(|c| c.name.clone()).collect()
}

/// Every pose that is left out must be one: a slip in a number would leave the bad pose in.
fn check_excluded(dataset: &Dataset, views: &[View]) -> Result<(), NoSuchPose> {
    let last_seen = views.iter().map(|view| view.pose).max();
    let last_image = dataset.image_pose_count().checked_sub(1);
    let last = last_seen.max(last_image).unwrap_or(0);
    match dataset.excluded_poses.iter().find(|pose| **pose > last) {
        Some(&pose) => Err(NoSuchPose { pose, last }),
        None => Ok(()),
    }
}

/// Poses that are known must be among those that were seen: a file for another recording would be passed over.
fn check_known(dataset: &Dataset, views: &[View]) -> Result<(), NoKnownPose> {
    let known = &dataset.known_poses;
    let Some((&first, _)) = known.first_key_value() else {
        return Ok(());
    };
    if views.iter().any(|view| known.contains_key(&view.pose)) {
        return Ok(());
    }
    let file = dataset.known_poses_file.clone().unwrap_or_default();
    Err(NoKnownPose { file, first })
}

/// Too few corners, with the reason for which images were refused.
fn with_refusals(
    dataset: &Dataset,
    source: SufficiencyError,
    detection: Option<&detect::Detection>,
) -> CalibrateError {
    let images = detection.map_or(&[][..], |detection| &detection.images);
    let mut refused = images.iter().filter_map(|image| match &image.outcome {
        Outcome::Refused(reason) => Some((image, reason)),
        Outcome::Used { .. } => None,
    });
    let Some((image, reason)) = refused.next() else {
        return source.into();
    };
    let path = image.path.strip_prefix(&dataset.folder);
    let path = path.unwrap_or(&image.path);
    CalibrateError::FewImages {
        first: format!("{}: {reason}", path.display()),
        refused: 1 + refused.count(),
        total: images.len(),
        source,
    }
}
