//! Which poses are used, and which are held out to check the result. Always by whole poses: the
//! corners of one board share its pose, so single corners would not be independent.

use calib_rays::observed::{View, poses};
use std::collections::BTreeSet;

/// Views that go on and poses that the user left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// In the order given.
    pub used: Vec<View>,
    /// Views of poses left out, in the order given.
    pub excluded: Vec<View>,
}

/// Separates the poses that the user leaves out.
pub fn without_excluded(views: Vec<View>, excluded_poses: &BTreeSet<usize>) -> Selection {
    let (excluded, used) = views
        .into_iter()
        .partition(|view| excluded_poses.contains(&view.pose));
    Selection { used, excluded }
}

/// One round of a check: fit on `train`, judge on `held_out`.
#[derive(Debug, Clone, PartialEq)]
pub struct Fold {
    /// Views of all poses but those held out.
    pub train: Vec<View>,
    /// Views of the poses held out.
    pub held_out: Vec<View>,
}

/// Deals the poses to `fold_count` folds in turn, by rising pose number: pose number k in that
/// order is held out in fold `k % fold_count`, every pose exactly once. Neighboring poses of a
/// stage so fall into different folds. Fewer poses than folds give as many folds as poses.
pub fn folds_by_pose(views: &[View], fold_count: usize) -> Vec<Fold> {
    let poses: Vec<usize> = poses(views).into_iter().collect();
    (0..fold_count.min(poses.len()))
        .map(|fold| {
            let held: BTreeSet<usize> = poses
                .iter()
                .copied()
                .skip(fold)
                .step_by(fold_count)
                .collect();
            let (held_out, train) = views
                .iter()
                .cloned()
                .partition(|view| held.contains(&view.pose));
            Fold { train, held_out }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn views(poses: &[usize]) -> Vec<View> {
        poses
            .iter()
            .flat_map(|&pose| {
                [0, 1].map(|camera_idx| View {
                    camera_idx,
                    pose,
                    corners: Vec::new(),
                })
            })
            .collect()
    }

    #[test]
    fn every_pose_is_held_out_once_with_all_its_views() {
        let views = views(&[1000, 1003, 1006, 2000, 2003, 2006, 2009]);
        let folds = folds_by_pose(&views, 3);
        assert_eq!(folds.len(), 3);
        let held: Vec<Vec<usize>> = folds
            .iter()
            .map(|f| poses(&f.held_out).into_iter().collect())
            .collect();
        assert_eq!(
            held,
            [vec![1000, 2000, 2009], vec![1003, 2003], vec![1006, 2006]]
        );
        for fold in &folds {
            assert_eq!(fold.train.len() + fold.held_out.len(), views.len());
            assert!(poses(&fold.train).is_disjoint(&poses(&fold.held_out)));
        }
    }

    #[test]
    fn more_folds_than_poses_hold_out_one_each() {
        assert_eq!(folds_by_pose(&views(&[4, 9]), 5).len(), 2);
        assert!(folds_by_pose(&[], 5).is_empty());
    }

    #[test]
    fn excluded_poses_are_kept_apart() {
        let selection = without_excluded(views(&[0, 1, 2]), &BTreeSet::from([1, 7]));
        assert_eq!(selection.used.len(), 4);
        assert!(selection.excluded.iter().all(|view| view.pose == 1));
    }
}
