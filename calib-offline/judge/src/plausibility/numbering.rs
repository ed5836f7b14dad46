//! How poses are counted.

use super::finding::cause;
use super::look::Look;
use crate::cause::{Cause, Code};
use crate::verdict::Grade;

/// Poses that count from 1 without a gap: nothing depends on it but what is said of them.
pub fn from_one(look: &Look<'_>) -> Option<Cause> {
    let poses = &look.observations.poses;
    let counted = poses
        .iter()
        .zip(1..)
        .all(|(pose, expected)| *pose == expected);
    let is_excluded = look.dataset.excluded_poses.contains(&0);
    (counted && !poses.is_empty() && !is_excluded && !look.dataset.has_images()).then(|| {
        cause(
            Code::PoseNumbering,
            Grade::Pass,
            "1 pose".to_owned(),
            0.0,
            "poses are counted from 1; it does no harm, but everything here counts from 0, the entries of \
             [stage] too unless there are as many of them as poses"
                .to_owned(),
        )
    })
}
