//! What target an image shows instead of the one that is described, found without the description.
//!
//! Corners are looked at first, with markers in their cells, then tags, then circles and rings. What
//! the description says serves only to choose between the ways in which one print can be described.

mod charuco;
pub mod corners;
mod lattice;
mod stated;
mod tags;

use super::super::chessboard::{RawCorner, Size, parts_at};
use super::super::seen_board::SeenBoard;
use super::super::verdict::Refusal;
use crate::dataset::image::GrayImage;
pub use lattice::measured_diameter;
pub use stated::Stated;
pub(super) use tags::spacing_of;

/// The refusal of an image that clearly shows another target; `None` if it does not.
pub fn other(image: &GrayImage, stated: &Stated) -> Option<Refusal> {
    let seen = seen(image, stated)?;
    (!seen.may_be(&stated.board)).then(|| refusal(seen, stated))
}

/// The words of that refusal.
pub fn refusal(seen: SeenBoard, stated: &Stated) -> Refusal {
    Refusal::OtherBoard {
        stated: stated.words.clone(),
        seen,
    }
}

/// The target that an image shows.
fn seen(image: &GrayImage, stated: &Stated) -> Option<SeenBoard> {
    let parts: Vec<Vec<RawCorner>> = [Size::Full, Size::Half]
        .into_iter()
        .flat_map(|size| parts_at(image, size))
        .collect();
    let largest = parts.iter().max_by_key(|part| part.len());
    largest
        .and_then(|part| charuco::seen(image, part, stated))
        .or_else(|| tags::seen(image))
        .or_else(|| largest.and_then(|part| corners::seen(image, part)))
        .or_else(|| lattice::seen(image, stated))
}
