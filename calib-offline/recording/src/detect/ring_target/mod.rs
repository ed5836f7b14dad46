//! The measurement target in images: ring markers found, numbered and measured.
//!
//! Per image: areas with a hole ([`components`], [`candidates`]), both edges of each ring fitted
//! ([`ring_fit`]), rows and columns from neighbor to neighbor ([`grid`]), the target's direction
//! from its larger markers ([`placement`]), and at last the fit anew with what the perspective does
//! to the middle of a circle ([`local_map`], [`perspective`]). [`locate()`] has the order. Every image
//! gets a verdict ([`verdict`]); what cannot be numbered without doubt is refused.
//!
//! Labels are right-handed in the image, as those of the board: a target in a mirror is refused.

pub mod candidates;
pub mod components;
mod detection;
mod error;
pub mod grid;
pub mod join;
pub mod local_map;
pub mod locate;
pub mod located;
pub mod markers;
pub mod overlay;
pub mod perspective;
pub mod placement;
pub mod ring_fit;
pub mod ring_model;
mod settings;
pub mod verdict;

pub use detection::TargetDetection;
pub use error::TargetError;
pub use join::{MarkerMatch, join_markers};
pub use locate::locate;
pub use locate::printed;
pub use located::{LabelledMarker, Located};
pub use settings::TargetSettings;
pub use verdict::{TargetFigures, TargetImage, TargetRefusal};

use super::job::{Job, all_loaded, check_sizes};
use crate::dataset::image::GrayImage;
use crate::dataset::{Dataset, TargetSpec, load_markers};
use calib_rays::observed::{Corner, View};
use calib_rays::progress::Progress;
use rayon::prelude::*;

/// Finds the target in every image of it and labels its markers.
///
/// Images are searched in parallel; the result does not depend on the number of threads. Images
/// without a usable target are refused one by one with a reason and are no error, all of them
/// included.
///
/// # Errors
/// [`TargetError`] if there is no target or no image of it, or a file is no image of its camera.
pub fn detect_target(
    dataset: &Dataset,
    settings: &TargetSettings,
    progress: &dyn Progress,
) -> Result<TargetDetection, TargetError> {
    let target = dataset.target.as_ref().ok_or(TargetError::NoTarget)?;
    let jobs = jobs(dataset, target);
    if jobs.is_empty() {
        return Err(TargetError::NoImages);
    }
    check_sizes(dataset, &jobs)?;
    progress.begin("detecting markers", jobs.len());
    let loaded = jobs
        .par_iter()
        .map(|job| {
            let result = GrayImage::load_sized(job.path, job.sensor).map(|image| {
                let outcome = locate(&image, target, settings);
                let figures = outcome
                    .as_ref()
                    .ok()
                    .and_then(|located| TargetFigures::of(&image, located, target));
                (outcome, figures)
            });
            progress.advance();
            result
        })
        .collect();
    progress.end();
    let images: Vec<TargetImage> = jobs
        .iter()
        .zip(all_loaded(dataset, &jobs, loaded)?)
        .map(|(job, (outcome, figures))| TargetImage {
            camera_idx: job.camera_idx,
            pose: job.pose,
            path: job.path.clone(),
            outcome,
            figures,
        })
        .collect();
    let views = images.iter().filter_map(|image| view(image, settings));
    Ok(TargetDetection {
        views: views.collect(),
        images,
    })
}

/// The labelled markers of a dataset: those of `markers.csv` if there are any, else those found in
/// the images.
///
/// # Errors
/// [`TargetError`]; that no image could be used is one here.
pub fn target_views(
    dataset: &Dataset,
    settings: &TargetSettings,
    progress: &dyn Progress,
) -> Result<Vec<View>, TargetError> {
    if dataset.target.is_none() {
        return Err(TargetError::NoTarget);
    }
    match load_markers(dataset)? {
        Some(views) => Ok(views),
        None => detect_target(dataset, settings, progress)?.into_views(),
    }
}

/// The images to look at, by camera and pose.
fn jobs<'a>(dataset: &Dataset, target: &'a TargetSpec) -> Vec<Job<'a>> {
    let by_camera = dataset.cameras.iter().zip(&target.images).enumerate();
    by_camera
        .flat_map(|(camera_idx, (camera, images))| {
            images.iter().enumerate().map(move |(pose, path)| Job {
                camera_idx,
                pose,
                path,
                sensor: camera.sensor,
            })
        })
        .collect()
}

fn view(image: &TargetImage, settings: &TargetSettings) -> Option<View> {
    let located = image.outcome.as_ref().ok()?;
    let corner = |marker: &LabelledMarker| Corner {
        row: marker.row,
        col: marker.col,
        pixel: marker.ring.pixel,
        sigma_px: Some(marker.ring.sigma_px.hypot(settings.sigma_floor_px)),
    };
    Some(View {
        camera_idx: image.camera_idx,
        pose: image.pose,
        corners: located.markers.iter().map(corner).collect(),
    })
}
