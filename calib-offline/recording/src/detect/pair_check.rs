//! Whether two cameras' corners belong together: do they agree on an epipolar geometry?

use super::epipolar::{FundamentalMatrix, Match};
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::View;
use std::collections::BTreeMap;

/// How well the corners of a camera and of the first one agree on a common epipolar geometry.
///
/// Lens distortion leaves a few pixels in wide lenses. A pose that stands out was not exposed at
/// the same instant, or is mislabelled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairCheck {
    /// The camera compared with camera 0.
    pub camera_idx: usize,
    /// Poses seen by both.
    pub pose_count: usize,
    /// Median distance from the epipolar line, px.
    pub median_px: f64,
    /// The pose with the largest median of its own.
    pub worst_pose: usize,
    /// That median, px.
    pub worst_px: f64,
}

/// Compares every camera with the first.
pub(super) fn pair_checks(views: &[View]) -> Vec<PairCheck> {
    let last = views.iter().map(|v| v.camera_idx).max().unwrap_or(0);
    (1..=last)
        .filter_map(|camera_idx| pair_check(views, camera_idx))
        .collect()
}

fn pair_check(views: &[View], camera_idx: usize) -> Option<PairCheck> {
    let mut by_pose: BTreeMap<usize, Vec<Match>> = BTreeMap::new();
    for second in views.iter().filter(|v| v.camera_idx == camera_idx) {
        let first = views
            .iter()
            .find(|v| v.camera_idx == 0 && v.pose == second.pose);
        let matches = first.map(|first| matches_of(first, second));
        if let Some(matches) = matches.filter(|m| !m.is_empty()) {
            by_pose.insert(second.pose, matches);
        }
    }
    let all: Vec<Match> = by_pose.values().flatten().copied().collect();
    let fundamental = FundamentalMatrix::from_matches(&all)?;
    let (worst_pose, worst_px) = by_pose
        .iter()
        .filter_map(|(&pose, matches)| Some((pose, fundamental.median_distance_px(matches)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(PairCheck {
        camera_idx,
        pose_count: by_pose.len(),
        median_px: fundamental.median_distance_px(&all)?,
        worst_pose,
        worst_px,
    })
}

/// Pixels of the same corner in two views.
pub(super) fn matches_of(first: &View, second: &View) -> Vec<Match> {
    let by_label: BTreeMap<(usize, usize), PixelPoint> = first
        .corners
        .iter()
        .map(|c| ((c.row, c.col), c.pixel))
        .collect();
    second
        .corners
        .iter()
        .filter_map(|c| Some((*by_label.get(&(c.row, c.col))?, c.pixel)))
        .collect()
}
