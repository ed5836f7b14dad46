//! Where the corners of a dataset come from.

use super::error::CalibrateError;
use calib_rays::observed::View;
use calib_rays::progress::Progress;
use calib_recording::dataset::Dataset;
use calib_recording::dataset::corners::load_corners;
use calib_recording::detect::{self, DetectSettings};

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
) -> Result<Corners, CalibrateError> {
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
