//! Boards measured with a rig as it was: lengths and gaps.

use crate::measured_board::MeasuredBoard;
use crate::neighbor_noise::neighbor_noise_mm;
use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::ViewBlock;
use calib_rays::field::Rig;
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::rms;
use serde::Serialize;
use std::collections::HashMap;

/// What a rig measures on some boards.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeasuredBoards {
    /// Corners measured.
    pub points: usize,
    /// RMS error of the distance between neighboring corners, mm.
    pub neighbor_rms_mm: f64,
    /// What the noise of the corners alone makes of it, mm.
    pub neighbor_noise_mm: f64,
    /// Mean error of that distance: the boards look so much larger than they are, percent.
    pub scale_percent: f64,
    /// RMS gap between the two rays of a corner, mm.
    pub gap_rms_mm: f64,
}

/// Measures the boards of all poses that `is_meant` says with the first two cameras that saw each; `None`
/// if there are none. `sigma_px` is the noise of a pixel coordinate.
pub fn measured_boards(
    rig: &Rig,
    observations: &Observations,
    sigma_px: f64,
    is_meant: impl Fn(usize) -> bool,
) -> Option<MeasuredBoards> {
    let meant = observations.with_pose_indices(is_meant);
    let (mut errors, mut gaps_mm) = (Vec::new(), Vec::new());
    let mut points = 0;
    for pose_idx in 0..meant.poses.len() {
        let views: Vec<&ViewBlock> = meant
            .views
            .iter()
            .filter(|view| view.pose_idx == pose_idx)
            .collect();
        let [first, second, ..] = views[..] else {
            continue;
        };
        let others: HashMap<(usize, usize), PixelPoint> = second
            .corners
            .iter()
            .map(|corner| ((corner.row, corner.col), corner.pixel))
            .collect();
        let mut board = MeasuredBoard::default();
        for corner in &first.corners {
            let found = others.get(&(corner.row, corner.col)).and_then(|other| {
                let pair = [
                    (first.camera_idx, corner.pixel),
                    (second.camera_idx, *other),
                ];
                rig.triangulate(&pair).ok()
            });
            if let Some(found) = found {
                board.corners.push((corner.row, corner.col, found.point_mm));
                gaps_mm.push(found.gap_mm);
            }
        }
        points += board.corners.len();
        errors.extend(board.neighbor_errors(&meant.board));
    }
    let square_mm = meant.board.square_mm;
    Some(MeasuredBoards {
        points,
        neighbor_rms_mm: rms(&errors)? * square_mm,
        neighbor_noise_mm: neighbor_noise_mm(rig, &meant, sigma_px)?,
        scale_percent: 100.0 * errors.iter().sum::<f64>() / errors.len() as f64,
        gap_rms_mm: rms(&gaps_mm)?,
    })
}
