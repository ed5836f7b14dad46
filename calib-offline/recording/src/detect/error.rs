//! Why images cannot be searched.

use super::consistency::ConsistencyError;
use crate::dataset::image::ImageError;
use calib_rays::remedy::Remedy;

/// Why a dataset's images could not be searched as a whole.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// There is nothing to look at.
    #[error(
        "the dataset names no images: give every [[camera]] of dataset.toml the key images or \
         image_list, or corners.csv"
    )]
    NoImages,
    /// A file that should be an image of this camera and is not: damaged, or of another size.
    /// An image that merely shows no board is refused and no error.
    #[error(
        "the image of camera {camera}, pose {pose}, cannot be used{}",
        if *more == 0 { String::new() } else { format!(", and {more} more images cannot either") }
    )]
    BrokenImage {
        /// Name of the camera.
        camera: String,
        /// Number of the pose.
        pose: usize,
        /// Other images that cannot be used.
        more: usize,
        /// What is wrong with the first.
        source: Box<ImageError>,
    },
    /// The images cannot be numbered alike.
    #[error(transparent)]
    Consistency(#[from] ConsistencyError),
}

impl Remedy for DetectError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::NoImages => "add images = \"folder/*.png\" to each [[camera]] of dataset.toml",
            Self::BrokenImage { source, .. } => return source.remedy(),
            Self::Consistency(_) => {
                "look at the images with --overlay DIR; a board with an odd and an even number of corners cannot be turned unnoticed"
            }
        };
        Some(text.to_owned())
    }
}
