//! Why images cannot be searched.

use super::consistency::ConsistencyError;
use super::grid_size::GridSize;
use super::seen_board::SeenBoard;
use crate::dataset::image::ImageError;
use calib_rays::geometry::SensorSize;
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
    /// Images that are not as large as the manifest says.
    #[error("{}", wrong_sizes(images))]
    WrongSizes {
        /// Each of them.
        images: Vec<OddImage>,
        /// Whether that is every image.
        are_all: bool,
    },
    /// Whole boards of another size than the manifest's.
    #[error(
        "{count} of {of} images show a whole board of {found} inner corners{}, the manifest says {stated}",
        if *stated_count == 0 { "" } else { ", and few the one that is stated" }
    )]
    WrongCount {
        /// The size that is seen.
        found: GridSize,
        /// The manifest's.
        stated: GridSize,
        /// Images that show it.
        count: usize,
        /// Images that show the manifest's.
        stated_count: usize,
        /// All images.
        of: usize,
    },
    /// Images of another target than the one described, beside some that fit it.
    #[error(
        "{count} images show {seen}, the manifest describes {stated}, and the {used_count} images that would fit it may \
         show parts of the other"
    )]
    WrongTarget {
        /// What is seen.
        seen: SeenBoard,
        /// What the manifest describes.
        stated: String,
        /// Images that show the other.
        count: usize,
        /// Images that would be used.
        used_count: usize,
    },
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
            Self::WrongSizes { images, are_all } => {
                return Some(odd_sizes_remedy(images, *are_all));
            }
            Self::WrongCount { found, stated, .. } => return Some(found.hint(*stated)),
            Self::WrongTarget { seen, .. } => return Some(seen.what_to_write()),
            Self::BrokenImage { source, .. } => return source.remedy(),
            Self::Consistency(ConsistencyError::CirclesBetweenCameras { .. }) => {
                "mark some of the circles (direction), or add poses that tilt the grid in different directions"
            }
            Self::Consistency(_) => {
                "look at the images with --overlay DIR; a board with an odd and an even number of corners cannot be turned unnoticed"
            }
        };
        Some(text.to_owned())
    }
}

/// An image of another size than its camera's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OddImage {
    /// Name of the camera.
    pub camera: String,
    /// Number of the pose.
    pub pose: usize,
    /// Name of the file.
    pub file: String,
    /// Its size.
    pub found: SensorSize,
    /// The manifest's.
    pub expected: SensorSize,
}

/// Images listed one by one; the rest is counted.
const LISTED: usize = 20;

fn wrong_sizes(images: &[OddImage]) -> String {
    let list: Vec<String> = images
        .iter()
        .take(LISTED)
        .map(|image| {
            let OddImage {
                camera,
                pose,
                file,
                found,
                expected,
            } = image;
            format!("camera {camera}, pose {pose} ({file}): {found} pixels, not {expected}")
        })
        .collect();
    let more = match images.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!("; and {more} more"),
    };
    format!(
        "images are not as large as the manifest says: {}{more}",
        list.join("; ")
    )
}

fn odd_sizes_remedy(images: &[OddImage], are_all: bool) -> String {
    let mut poses: Vec<usize> = images.iter().map(|image| image.pose).collect();
    poses.sort_unstable();
    poses.dedup();
    let poses: Vec<String> = poses.iter().map(usize::to_string).collect();
    let is_turned = |image: &OddImage| {
        (image.found.width, image.found.height) == (image.expected.height, image.expected.width)
    };
    let as_recorded = "use the images as they came from the sensor (not scaled, not cropped)";
    if images.iter().all(is_turned) {
        "width and height swapped? Correct them in dataset.toml".to_owned()
    } else if are_all {
        format!("correct width and height of the cameras in dataset.toml, or {as_recorded}")
    } else {
        format!(
            "leave these poses out: exclude = [{}] under [dataset] in dataset.toml; or {as_recorded}",
            poses.join(", ")
        )
    }
}
