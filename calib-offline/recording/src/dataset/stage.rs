//! Which entry of the stage's lists belongs to which pose.
//!
//! Entry k belongs to pose number k where poses are numbered without gaps from 0, as images are.
//! Corners may carry numbers of their own (1000, 1003, ...): then entry k belongs to the k-th
//! smallest number. Which of the two holds follows from the length of the list; a list that fits
//! neither is an error.

use super::Dataset;
use super::corners::error::CornersError;
use calib_rays::observed::{View, poses};
use std::collections::{BTreeMap, BTreeSet};

/// What the stage says of one pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageEntry {
    /// Dial reading, degrees.
    pub angle_deg: Option<f64>,
    /// Number of the placement; poses of one placement share one axis.
    pub placement: Option<usize>,
}

/// How a list of entries is addressed by pose numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Addressing {
    ByNumber,
    ByOrder,
}

fn addressing(
    entry_count: usize,
    image_pose_count: usize,
    poses: &BTreeSet<usize>,
) -> Option<Addressing> {
    let last = *poses.last()?;
    if entry_count == last + 1 || (entry_count == image_pose_count && last < entry_count) {
        Some(Addressing::ByNumber)
    } else if entry_count == poses.len() {
        Some(Addressing::ByOrder)
    } else {
        None
    }
}

/// What the stage says of `pose`, one of `poses` (all poses of the dataset that have corners).
/// Nothing is known where there is no stage, or its lists do not fit.
pub fn entry(dataset: &Dataset, poses: &BTreeSet<usize>, pose: usize) -> StageEntry {
    let Some(stage) = &dataset.stage else {
        return StageEntry::default();
    };
    let index = |entry_count| match addressing(entry_count, dataset.image_pose_count(), poses)? {
        Addressing::ByNumber => Some(pose),
        Addressing::ByOrder => poses.iter().position(|p| *p == pose),
    };
    let angle_deg = stage
        .angles_deg
        .as_ref()
        .and_then(|list| list.get(index(list.len())?).copied());
    let placement = stage
        .placement
        .as_ref()
        .and_then(|list| list.get(index(list.len())?).copied());
    StageEntry {
        angle_deg,
        placement,
    }
}

/// Placement of the poses that belong to one, of all poses in `views` (all views of the dataset).
pub fn placements(dataset: &Dataset, views: &[View]) -> BTreeMap<usize, usize> {
    let all = poses(views);
    all.iter()
        .filter_map(|pose| Some((*pose, entry(dataset, &all, *pose).placement?)))
        .collect()
}

/// Refuses lists that fit the poses of the corners neither by number nor by order.
pub(super) fn check_lengths(dataset: &Dataset, views: &[View]) -> Result<(), CornersError> {
    let Some(stage) = &dataset.stage else {
        return Ok(());
    };
    let poses = poses(views);
    let lengths = [
        ("angles_deg", stage.angles_deg.as_ref().map(Vec::len)),
        ("placement", stage.placement.as_ref().map(Vec::len)),
    ];
    for (key, length) in lengths {
        let Some(have) = length else { continue };
        if addressing(have, dataset.image_pose_count(), &poses).is_none() {
            return Err(CornersError::StageLength {
                file: dataset.folder.join(Dataset::MANIFEST),
                key,
                have,
                poses: poses.len(),
                first: poses.first().copied().unwrap_or(0),
                last: poses.last().copied().unwrap_or(0),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(poses: &[usize]) -> BTreeSet<usize> {
        poses.iter().copied().collect()
    }

    #[test]
    fn a_pose_nobody_saw_keeps_its_entry() {
        // Four entries, pose 2 has no corners: still addressed by number.
        assert_eq!(
            addressing(4, 0, &set(&[0, 1, 3])),
            Some(Addressing::ByNumber)
        );
        // The last image has none: the number of images settles it.
        assert_eq!(
            addressing(5, 5, &set(&[0, 1, 3])),
            Some(Addressing::ByNumber)
        );
    }

    #[test]
    fn numbers_with_gaps_are_taken_in_order() {
        assert_eq!(
            addressing(3, 0, &set(&[1000, 1003, 2000])),
            Some(Addressing::ByOrder)
        );
    }

    #[test]
    fn any_other_length_is_refused() {
        assert_eq!(addressing(3, 0, &set(&[0, 1])), None);
        assert_eq!(addressing(1, 0, &set(&[0, 1])), None);
        assert_eq!(addressing(0, 0, &set(&[])), None);
    }
}
