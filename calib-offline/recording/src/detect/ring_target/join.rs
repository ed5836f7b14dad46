//! One marker in all cameras: pixels that belong together.

use crate::dataset::TargetSpec;
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::View;
use std::collections::BTreeMap;

/// A marker that every camera saw.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerMatch {
    /// `(pose * rows + row) * cols + col`.
    pub id: usize,
    /// Index of the target pose.
    pub pose: usize,
    /// Row on the target.
    pub row: usize,
    /// Column on the target.
    pub col: usize,
    /// Where each camera saw it, in the dataset's order.
    pub pixels: Vec<PixelPoint>,
}

/// The markers that all of `camera_count` cameras saw, by id.
pub fn join_markers(target: &TargetSpec, views: &[View], camera_count: usize) -> Vec<MarkerMatch> {
    let mut by_label: BTreeMap<(usize, usize, usize), Vec<Option<PixelPoint>>> = BTreeMap::new();
    for view in views {
        for corner in &view.corners {
            let pixels = by_label
                .entry((view.pose, corner.row, corner.col))
                .or_insert_with(|| vec![None; camera_count]);
            if let Some(pixel) = pixels.get_mut(view.camera_idx) {
                *pixel = Some(corner.pixel);
            }
        }
    }
    by_label
        .into_iter()
        .filter_map(|((pose, row, col), pixels)| {
            Some(MarkerMatch {
                id: target.marker_id(pose, row, col),
                pose,
                row,
                col,
                pixels: pixels.into_iter().collect::<Option<_>>()?,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::observed::Corner;

    #[test]
    fn only_markers_that_all_cameras_saw_are_joined() {
        let target = TargetSpec {
            rows: 7,
            cols: 9,
            pitch_mm: 12.0,
            outer_radius_mm: 4.0,
            direction_outer_radius_mm: 5.0,
            direction: vec![(1, 2)],
            images: Vec::new(),
        };
        let view = |camera_idx, pose, labels: &[(usize, usize)]| View {
            camera_idx,
            pose,
            corners: labels
                .iter()
                .map(|&(row, col)| Corner {
                    row,
                    col,
                    pixel: PixelPoint::new(col as f64 + 100.0 * camera_idx as f64, row as f64),
                    sigma_px: None,
                })
                .collect(),
        };
        let views = [
            view(0, 1, &[(0, 0), (2, 3)]),
            view(1, 1, &[(2, 3), (4, 4)]),
            view(0, 2, &[(0, 0)]),
        ];
        let matches = join_markers(&target, &views, 2);
        assert_eq!(matches.len(), 1);
        assert_eq!(matches[0].id, (7 + 2) * 9 + 3);
        assert_eq!(matches[0].pixels[1], PixelPoint::new(103.0, 2.0));
        assert_eq!(join_markers(&target, &views, 1).len(), 3);
    }
}
