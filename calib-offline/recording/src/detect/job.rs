//! The images to look at, and what loading them gave.

use super::error::DetectError;
use crate::dataset::Dataset;
use crate::dataset::image::ImageError;
use calib_rays::geometry::SensorSize;
use std::path::PathBuf;

/// An image to look at.
pub(super) struct Job<'a> {
    pub camera_idx: usize,
    pub pose: usize,
    pub path: &'a PathBuf,
    pub sensor: SensorSize,
}

/// What the images show, if every file could be loaded.
pub(super) fn all_loaded<T>(
    dataset: &Dataset,
    jobs: &[Job<'_>],
    loaded: Vec<Result<T, ImageError>>,
) -> Result<Vec<T>, DetectError> {
    let broken = loaded.iter().filter(|image| image.is_err()).count();
    jobs.iter()
        .zip(loaded)
        .map(|(job, image)| {
            image.map_err(|source| DetectError::BrokenImage {
                camera: dataset.cameras[job.camera_idx].name.clone(),
                pose: job.pose,
                more: broken - 1,
                source: Box::new(source),
            })
        })
        .collect()
}
