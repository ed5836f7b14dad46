//! The images to look at, and what loading them gave.

use super::error::{DetectError, OddImage};
use crate::dataset::Dataset;
use crate::dataset::image::{GrayImage, ImageError};
use calib_rays::geometry::SensorSize;
use rayon::prelude::*;
use std::path::PathBuf;

/// An image to look at.
pub(super) struct Job<'a> {
    pub camera_idx: usize,
    pub pose: usize,
    pub path: &'a PathBuf,
    pub sensor: SensorSize,
}

/// Compares the sizes in the images' headers with the manifest's, before any image is searched. A file without a
/// header is left to the loading.
///
/// # Errors
/// [`DetectError::WrongSizes`], with every image of another size.
pub(super) fn check_sizes(dataset: &Dataset, jobs: &[Job<'_>]) -> Result<(), DetectError> {
    let odd = |job: &Job<'_>| {
        let found = GrayImage::size_of(job.path).ok()?;
        (found != job.sensor).then(|| OddImage {
            camera: dataset.cameras[job.camera_idx].name.clone(),
            pose: job.pose,
            file: job.path.file_name().map_or_else(
                || job.path.display().to_string(),
                |name| name.to_string_lossy().into_owned(),
            ),
            found,
            expected: job.sensor,
        })
    };
    let images: Vec<OddImage> = jobs.par_iter().filter_map(odd).collect();
    if images.is_empty() {
        return Ok(());
    }
    Err(DetectError::WrongSizes {
        are_all: images.len() == jobs.len(),
        images,
    })
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
