//! Cross-validation by pose: what the calibration does with boards that it never saw.

use super::measured_board::MeasuredBoard;
use super::resection::residuals_with_free_pose;
use crate::adjust::Observations;
use crate::adjust::observations::ViewBlock;
use crate::dataset::Corner;
use crate::field::{MeasureError, Rig};
use crate::init::rig::start_rig;
use crate::joint::{Estimate, estimate};
use crate::progress::Progress;
use rayon::prelude::*;

/// Errors on held-out boards, all folds together.
#[derive(Debug, Clone, Default)]
pub struct HeldOut {
    /// Number of folds that were estimated.
    pub folds: usize,
    /// Length of the residual vector of every held-out corner with its board's pose refitted, px.
    pub residuals_px: Vec<f64>,
    /// Relative error of the distance of neighboring corners.
    pub neighbor_errors: Vec<f64>,
    /// Distance of triangulated corners from the best-placed flat board, mm.
    pub rigid_errors_mm: Vec<f64>,
    /// Held-out corners outside the calibrated area of their fold.
    pub outside_count: usize,
    /// Folds whose training poses gave no estimate.
    pub failed_folds: usize,
}

/// Fold of the pose with this index: poses are dealt in turn, so that every fold spans the stage.
pub fn fold_of(pose_idx: usize, folds: usize) -> usize {
    pose_idx % folds.max(1)
}

/// Estimates each fold from the other folds' poses and measures its boards.
///
/// Cost: `folds` estimates, run in parallel with ordered results.
pub fn held_out(observations: &Observations, folds: usize, progress: &dyn Progress) -> HeldOut {
    let per_fold: Vec<Option<HeldOut>> = (0..folds)
        .into_par_iter()
        .map(|fold| {
            let result = evaluate_fold(observations, folds, fold);
            progress.advance();
            result
        })
        .collect();
    let mut all = HeldOut::default();
    for fold in per_fold {
        match fold {
            Some(fold) => {
                all.folds += 1;
                all.residuals_px.extend(fold.residuals_px);
                all.neighbor_errors.extend(fold.neighbor_errors);
                all.rigid_errors_mm.extend(fold.rigid_errors_mm);
                all.outside_count += fold.outside_count;
            }
            None => all.failed_folds += 1,
        }
    }
    all
}

fn evaluate_fold(observations: &Observations, folds: usize, fold: usize) -> Option<HeldOut> {
    let in_fold = |pose: usize| {
        observations
            .poses
            .binary_search(&pose)
            .is_ok_and(|idx| fold_of(idx, folds) == fold)
    };
    let training = observations.with_poses(|pose| !in_fold(pose));
    let unseen = observations.with_poses(in_fold);
    let start = start_rig(&training).ok()?;
    let estimate = estimate(&start.observations, &start).ok()?;
    Some(measure(&estimate, &unseen))
}

/// Measures unseen boards with an estimate.
fn measure(estimate: &Estimate, unseen: &Observations) -> HeldOut {
    let names: Vec<String> = (0..unseen.sensors.len()).map(|k| k.to_string()).collect();
    let rig = estimate.rig(&names);
    let mut result = HeldOut::default();
    for view in &unseen.views {
        let corners: Vec<Corner> = covered(&rig, view, &mut result.outside_count);
        let residuals = residuals_with_free_pose(
            &rig.cameras[view.camera_idx].field,
            &unseen.board,
            &estimate.model.board_shape,
            &corners,
        );
        result
            .residuals_px
            .extend(residuals.into_iter().flatten().map(|r| r.norm()));
    }
    for pose_idx in 0..unseen.poses.len() {
        let views: Vec<&ViewBlock> = unseen
            .views
            .iter()
            .filter(|view| view.pose_idx == pose_idx)
            .collect();
        let [left, right, ..] = views[..] else {
            continue;
        };
        let mut board = MeasuredBoard::default();
        for corner in &left.corners {
            let other = right
                .corners
                .iter()
                .find(|other| (other.row, other.col) == (corner.row, corner.col));
            let Some(other) = other else { continue };
            let sightings = [
                (left.camera_idx, corner.pixel),
                (right.camera_idx, other.pixel),
            ];
            match rig.triangulate(&sightings) {
                Ok(point) => board.corners.push((corner.row, corner.col, point.point_mm)),
                Err(MeasureError::Outside { .. } | MeasureError::Triangulate(_)) => {}
            }
        }
        result
            .neighbor_errors
            .extend(board.neighbor_errors(&unseen.board));
        result
            .rigid_errors_mm
            .extend(board.rigid_errors_mm(&unseen.board));
    }
    result
}

/// The corners of a view inside the calibrated area; the others are counted.
fn covered(rig: &Rig, view: &ViewBlock, outside_count: &mut usize) -> Vec<Corner> {
    let coverage = &rig.cameras[view.camera_idx].coverage;
    view.corners
        .iter()
        .filter_map(|corner| {
            if !coverage.contains(corner.pixel) {
                *outside_count += 1;
                return None;
            }
            Some(Corner {
                row: corner.row,
                col: corner.col,
                pixel: corner.pixel,
                sigma_px: None,
            })
        })
        .collect()
}
