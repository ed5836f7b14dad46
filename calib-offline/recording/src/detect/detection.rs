//! What was found in a dataset's images.

use super::pair_check::{PairCheck, pair_checks};
use super::verdict::{ImageVerdict, Outcome};
use calib_rays::observed::View;

/// What was found in a dataset's images.
#[derive(Debug)]
pub struct Detection {
    /// The labelled corners, by camera and pose.
    pub views: Vec<View>,
    /// One verdict per image that was looked at, by camera and pose.
    pub images: Vec<ImageVerdict>,
    /// Images in which the board is turned against the way it has in most.
    pub turned: Vec<TurnedImage>,
    /// Whether the cameras' corners belong together, for each camera after the first.
    pub pair_checks: Vec<PairCheck>,
}

impl Detection {
    /// Of the views and verdicts, each by camera and pose.
    pub(super) fn of(views: Vec<View>, images: Vec<ImageVerdict>) -> Self {
        Self {
            turned: turned_images(&images),
            pair_checks: pair_checks(&views),
            views,
            images,
        }
    }
}

/// An image in which the board is turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TurnedImage {
    /// Index into the dataset's cameras.
    pub camera_idx: usize,
    /// Number of the pose.
    pub pose: usize,
    /// Quarter turns, clockwise on screen, against the majority of the images: 1 to 3.
    pub quarter_turns: u8,
}

/// The images turned against the majority. Of equally common turns, the smallest counts as the
/// majority's.
fn turned_images(images: &[ImageVerdict]) -> Vec<TurnedImage> {
    let turns = |image: &ImageVerdict| match image.outcome {
        Outcome::Used { quarter_turns, .. } => Some(quarter_turns),
        Outcome::Refused(_) => None,
    };
    let count = |turn: u8| images.iter().filter(|i| turns(i) == Some(turn)).count();
    let usual = (0..4u8).rev().max_by_key(|&turn| count(turn)).unwrap_or(0);
    images
        .iter()
        .filter_map(|image| {
            let turned = (turns(image)? + 4 - usual) % 4;
            (turned > 0).then_some(TurnedImage {
                camera_idx: image.camera_idx,
                pose: image.pose,
                quarter_turns: turned,
            })
        })
        .collect()
}
