//! Whether the camera named left stands on the left.

use super::finding::{cause, length};
use super::look::Look;
use super::measured::error_mm;
use super::whole_camera::WholeCamera;
use crate::cause::{Cause, Code};
use crate::verdict::Grade;

/// Names and their beginnings that say left, and that say right.
const LEFT: [&str; 3] = ["left", "links", "gauche"];
const RIGHT: [&str; 3] = ["right", "rechts", "droite"];

/// The side that a camera's name says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Right,
}

fn side(name: &str) -> Option<Side> {
    let name = name.to_lowercase();
    let words: Vec<&str> = name
        .split(|c: char| !c.is_alphabetic())
        .filter(|word| !word.is_empty())
        .collect();
    let says = |sides: &[&str], letter: &str| {
        words
            .iter()
            .any(|word| *word == letter || sides.iter().any(|side| word.contains(side)))
    };
    match (says(&LEFT, "l"), says(&RIGHT, "r")) {
        (true, false) => Some(Side::Left),
        (false, true) => Some(Side::Right),
        _ => None,
    }
}

/// Cameras whose names contradict their places: as seen by the first one, the second lies on the other
/// side. Only where they stand side by side in the image, not above each other.
pub fn sides(look: &Look<'_>, cameras: &[WholeCamera]) -> Option<Cause> {
    cameras.iter().find_map(|whole| {
        let names = [whole.reference, whole.camera_idx].map(|idx| look.name(idx));
        let expected = match names.map(side) {
            [Some(Side::Left), Some(Side::Right)] => 1.0,
            [Some(Side::Right), Some(Side::Left)] => -1.0,
            _ => return None,
        };
        let second_in_first = whole.agreed.second_from_first.inverse().translation_mm;
        let across_mm = expected * second_in_first.x;
        let beside = across_mm.abs() > second_in_first.y.abs().hypot(second_in_first.z) / 2.0;
        if across_mm >= 0.0 || !beside {
            return None;
        }
        let [first, second] = names;
        let cost_mm = error_mm(look, whole, |(camera, pixel)| (1 - camera, pixel));
        Some(cause(
            Code::CamerasExchanged,
            Grade::Doubtful,
            length(across_mm.abs()),
            cost_mm.unwrap_or_else(|| second_in_first.norm()),
            format!(
                "camera {second} stands {} on the other side of camera {first} than its name says: are \
                 their images exchanged? (So it is too if both cameras are mounted upside down: then name \
                 them by what the images show.)",
                length(across_mm.abs())
            ),
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_a_side_or_none() {
        for name in ["left", "cam_l", "Links", "camera-left", "l"] {
            assert_eq!(side(name), Some(Side::Left), "{name}");
        }
        for name in ["right", "R", "cam.r", "rechts"] {
            assert_eq!(side(name), Some(Side::Right), "{name}");
        }
        for name in ["cam0", "lr", "main", "left_right", "lower"] {
            assert_eq!(side(name), None, "{name}");
        }
    }
}
