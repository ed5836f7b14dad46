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
pub mod grid;
pub mod join;
pub mod local_map;
pub mod locate;
pub mod overlay;
pub mod perspective;
pub mod placement;
pub mod ring_fit;
pub mod ring_model;
pub mod verdict;

pub use join::{MarkerMatch, join_markers};
pub use locate::{LabelledMarker, Located, locate};
pub use verdict::{TargetFigures, TargetImage, TargetRefusal};

use super::{DetectError, Job, all_loaded};
use crate::dataset::image::GrayImage;
use crate::dataset::{CornersError, Dataset, TargetSpec, load_markers};
use calib_rays::observed::{Corner, View};
use calib_rays::progress::Progress;
use rayon::prelude::*;

/// Choices in the search for the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetSettings {
    /// How often the centers are corrected for the perspective; 0 leaves the middles of the rings'
    /// images. The second time the map behind the correction is free of the first error.
    pub correction_rounds: usize,
    /// Added in quadrature to the standard deviation that each fit predicts from its own residuals,
    /// for what all models of an edge leave out, px.
    pub sigma_floor_px: f64,
}

impl Default for TargetSettings {
    fn default() -> Self {
        Self {
            correction_rounds: 2,
            sigma_floor_px: 0.003,
        }
    }
}

/// What was found in a dataset's images of the target.
#[derive(Debug)]
pub struct TargetDetection {
    /// The labelled markers by camera and pose, in the form of corners: `pose` is the index of the
    /// target image, row and column are those on the target.
    pub views: Vec<View>,
    /// One verdict per image, by camera and pose.
    pub images: Vec<TargetImage>,
}

/// Why a dataset has no labelled markers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TargetError {
    /// The manifest describes no target.
    #[error("{} describes no [target]", Dataset::MANIFEST)]
    NoTarget,
    /// There is nothing to look at.
    #[error("no camera of {} has target_images", Dataset::MANIFEST)]
    NoImages,
    /// A file that is no image of its camera.
    #[error(transparent)]
    Images(#[from] DetectError),
    /// Every image was refused.
    #[error("none of {total} images of the target could be used; the first: {first}")]
    AllRefused {
        /// Images looked at.
        total: usize,
        /// File and reason of the first one.
        first: String,
    },
    /// The markers that were there already.
    #[error("the labelled markers cannot be used")]
    Markers(#[from] CornersError),
}

impl TargetError {
    /// What to do about it.
    pub fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::NoTarget => {
                "describe it: [target] with kind = \"rings\", rows, cols, pitch_mm, outer_radius_mm, direction_outer_radius_mm, direction"
            }
            Self::NoImages => "add target_images = \"target/left/*.png\" to each [[camera]]",
            Self::Images(DetectError::BrokenImage { source, .. }) => return Some(source.remedy()),
            Self::Images(_) => return None,
            Self::AllRefused { .. } => {
                "look at the images with calib-offline detect DATASET --target --overlay DIR"
            }
            Self::Markers(CornersError::OutOfBoard { .. }) => {
                "rows and columns count from 0; correct them, or rows and cols of [target]"
            }
            Self::Markers(CornersError::NotText { .. } | CornersError::Empty { .. }) => {
                "restore markers.csv, or delete it and run calib-offline detect DATASET --target"
            }
            Self::Markers(error) => return error.remedy(),
        };
        Some(text.to_owned())
    }
}

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

impl TargetDetection {
    /// The views.
    ///
    /// # Errors
    /// [`TargetError::AllRefused`] if there are none.
    pub fn into_views(self) -> Result<Vec<View>, TargetError> {
        if !self.views.is_empty() {
            return Ok(self.views);
        }
        let first = self.images.iter().find_map(|image| {
            let refusal = image.outcome.as_ref().err()?;
            Some(format!("{}: {refusal}", image.path.display()))
        });
        Err(TargetError::AllRefused {
            total: self.images.len(),
            first: first.unwrap_or_default(),
        })
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
