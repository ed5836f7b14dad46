//! The same numbering in every image of a target that looks the same after a turn.
//!
//! Each image has its columns counting to the right as nearly as can be. Where a board turns on from
//! pose to pose the numbering follows the pose before, and in a pose that several cameras see, the first
//! camera that sees it: cameras stand the same way up, or nearly so.

use super::found::{Found, PrintedTarget, quarter_turns};
use crate::dataset::Dataset;
use crate::dataset::target::turned;
use crate::detect::job::Job;
use crate::detect::verdict::Refusal;
use calib_rays::observed::Corner;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Turns the labels of every image to the numbering of the others.
pub(super) fn settle(
    target: &dyn PrintedTarget,
    dataset: &Dataset,
    jobs: &[Job<'_>],
    found: &mut [Result<Found, Refusal>],
) {
    let numberings = target.numberings();
    if numberings == 1 {
        return;
    }
    let size = (dataset.board.rows, dataset.board.cols);
    let mut order: Vec<usize> = (0..jobs.len()).collect();
    order.sort_by_key(|&k| (jobs[k].camera_idx, jobs[k].pose));
    // Where the columns of a pose point in the first camera that saw it, and of the camera's last pose.
    let mut of_pose: BTreeMap<usize, Vector2<f64>> = BTreeMap::new();
    let mut before: Option<(usize, Vector2<f64>)> = None;
    for k in order {
        let Ok(view) = &mut found[k] else { continue };
        let (camera_idx, pose) = (jobs[k].camera_idx, jobs[k].pose);
        let last = before.filter(|(camera, _)| *camera == camera_idx);
        let wanted = of_pose.get(&pose).copied().or(last.map(|(_, along)| along));
        let wanted = wanted.unwrap_or_else(Vector2::x);
        let step = 4 / numberings;
        let best = (0..numberings)
            .map(|turn| (turn * step, along_after(view, turn * step)))
            .max_by(|a, b| a.1.dot(&wanted).total_cmp(&b.1.dot(&wanted)));
        let Some((quarters, along)) = best else {
            continue;
        };
        relabel(&mut view.corners, size, quarters);
        view.quarter_turns = quarter_turns(&along);
        of_pose.entry(pose).or_insert(along);
        before = Some((camera_idx, along));
    }
}

/// Where the columns point after so many quarter turns of the labels: of length 1, or zero.
fn along_after(view: &Found, quarters: u8) -> Vector2<f64> {
    let (along_col, along_row) = directions(&view.corners);
    // What was row 0 becomes the last column: the new columns count against the old rows.
    let along = match quarters % 4 {
        0 => along_col,
        1 => -along_row,
        2 => -along_col,
        _ => along_row,
    };
    along.try_normalize(0.0).unwrap_or_default()
}

/// Mean steps between neighbors along the columns and along the rows, px.
fn directions(corners: &[Corner]) -> (Vector2<f64>, Vector2<f64>) {
    let by_label: BTreeMap<(usize, usize), Vector2<f64>> = corners
        .iter()
        .map(|c| ((c.row, c.col), Vector2::new(c.pixel.u, c.pixel.v)))
        .collect();
    let step = |row: usize, col: usize| -> Vector2<f64> {
        by_label
            .iter()
            .filter_map(|(&(r, c), at)| Some(by_label.get(&(r + row, c + col))? - at))
            .sum()
    };
    (step(0, 1), step(1, 0))
}

fn relabel(corners: &mut [Corner], size: (usize, usize), quarters: u8) {
    for corner in corners.iter_mut() {
        (corner.row, corner.col) = turned((corner.row, corner.col), size, quarters);
    }
    corners.sort_unstable_by_key(|corner| (corner.row, corner.col));
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::PixelPoint;

    #[test]
    fn relabelled_columns_point_where_it_was_said() {
        for quarters in [0, 2] {
            let mut corners: Vec<Corner> = (0..12)
                .map(|k| Corner {
                    row: k / 4,
                    col: k % 4,
                    pixel: PixelPoint::new(10.0 * (k % 4) as f64, 8.0 * (k / 4) as f64),
                    sigma_px: None,
                })
                .collect();
            let (along, _) = directions(&corners);
            let expected = if quarters == 0 { along } else { -along };
            relabel(&mut corners, (3, 4), quarters);
            assert_eq!(directions(&corners).0, expected);
        }
        // A quarter turn of a square grid.
        let mut corners: Vec<Corner> = (0..9)
            .map(|k| Corner {
                row: k / 3,
                col: k % 3,
                pixel: PixelPoint::new(10.0 * (k % 3) as f64, 10.0 * (k / 3) as f64),
                sigma_px: None,
            })
            .collect();
        let (_, along_row) = directions(&corners);
        relabel(&mut corners, (3, 3), 1);
        assert_eq!(directions(&corners).0, -along_row);
    }
}
