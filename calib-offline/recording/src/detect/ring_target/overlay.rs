//! The images of the target with what was found in them drawn over.

use super::{Located, TargetDetection};
use crate::dataset::Dataset;
use crate::dataset::image::GrayImage;
use crate::detect::overlay::{Canvas, OverlayError, save_all};
use calib_rays::observed::Corner;
use calib_rays::progress::Progress;
use nalgebra::Vector2;
use std::path::Path;

/// The image; of every marker both edges as fitted, a dot on its center and its place on the target,
/// row 0 in orange, marker (0, 0) in red. A refused image is framed in red.
pub fn draw(image: &GrayImage, located: Option<&Located>) -> Canvas {
    let mut canvas = Canvas::new(image);
    let Some(located) = located else {
        canvas.frame();
        return canvas;
    };
    let corners: Vec<Corner> = located
        .markers
        .iter()
        .map(|marker| Corner {
            row: marker.row,
            col: marker.col,
            pixel: marker.ring.pixel,
            sigma_px: None,
        })
        .collect();
    canvas.corners(&corners);
    for marker in &located.markers {
        let ring = &marker.ring;
        // The ellipses lie about the middle of the ring's image.
        let middle = Vector2::new(marker.uncorrected.u, marker.uncorrected.v);
        canvas.ellipse(&middle, &ring.shape);
        canvas.ellipse(&middle, &(ring.shape * ring.ratio));
    }
    canvas
}

/// Writes the overlay of every image to `target_CAMERA_POSE.png` in the folder, which is made if
/// need be. Files of these names are replaced.
///
/// # Errors
/// [`OverlayError`].
pub fn write_all(
    folder: &Path,
    dataset: &Dataset,
    detection: &TargetDetection,
    progress: &dyn Progress,
) -> Result<(), OverlayError> {
    save_all(folder, &detection.images, progress, |image| {
        let camera = dataset.cameras.get(image.camera_idx)?;
        let pixels = GrayImage::load(&image.path).ok()?;
        let name = format!("target_{}_{:03}.png", camera.name, image.pose);
        Some((name, draw(&pixels, image.outcome.as_ref().ok())))
    })
}
