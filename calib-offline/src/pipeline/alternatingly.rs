//! The published procedure as a method of the pipeline.

use super::Method;
use super::solution::{FoldError, Solution, Solved, Task, folds_wanted};
use crate::error::Error;
use crate::evaluate::estimate_folds;
use crate::evaluate::held_out::Estimated;
use crate::report::record::AlternatingRecord;
use calib_estimate::adjust::Observations;
use calib_estimate::adjust::robust::{relative_weights, reweight};
use calib_estimate::alternating::alternation::{Alternated, AlternationStop};
use calib_estimate::alternating::field_rig::FieldRig;
use calib_estimate::alternating::{
    AlternatingError, AlternatingEstimate, AlternatingSettings, estimate,
};
use calib_estimate::init::rig::{RigStart, start_rig};
use calib_estimate::reprojection::residuals;
use calib_rays::board::BoardShape;
use calib_rays::field::{BaseLens, Rig};
use calib_rays::progress::Progress;
use nalgebra::Vector2;

/// Screens, runs the published procedure, and checks it without the poses of each fold.
///
/// # Errors
/// Data that cannot determine the answer.
pub fn alternating_solution(
    offered: &Observations,
    task: &Task,
    progress: &dyn Progress,
) -> Result<Solved, Error> {
    progress.begin("initialize", 1);
    let start = start_rig(offered)?;
    progress.end();

    progress.begin("estimate", 1);
    let (found, fields) = estimate_rig(&start, task.names, task.placement)?;
    progress.end();

    // Poses that no camera placed take no part.
    let used = found
        .observations
        .with_pose_indices(|pose_idx| found.rig_from_board[pose_idx].is_some());
    let rig_from_board: Vec<_> = found.rig_from_board.iter().flatten().copied().collect();
    let board_shape = BoardShape::default();
    let mut residuals = residuals(&fields.rig, &rig_from_board, &board_shape, &used);
    drop_outside(&fields.rig, &used, &mut residuals);
    let (noise, _) = reweight(&residuals, &used, 1.0, None);
    let robust_weights = relative_weights(&residuals, &used, &noise);

    let folds = folds_wanted(&used, task.folds);
    progress.begin("cross-checks", folds);
    let estimate_fold = |training: &Observations| estimate_alternating(training, task.placement);
    let folds = estimate_folds(&used, folds, &estimate_fold, progress);
    progress.end();
    let record = record(&found, &fields);
    Ok(Solved {
        solution: Solution {
            method: Method::Alternating,
            findings: start.findings,
            rig: fields.rig,
            rig_from_board,
            board_shape,
            observations: used,
            residuals,
            robust_weights,
            sigma_px: noise.variance_px2.sqrt(),
            stop_reason: stop_reason(&found.alternated),
            settled: found.alternated.still_falling().is_none(),
            costs: found.alternated.rms_mm,
            choices: None,
            alternating: Some(record),
            ray_sources: Some(found.cameras),
            checks: None,
        },
        folds,
    })
}

/// The published procedure on some training poses. The cameras of its rig are named by number.
///
/// # Errors
/// [`FoldError`].
pub fn estimate_alternating(
    training: &Observations,
    placement: &dyn Fn(usize) -> Option<usize>,
) -> Result<Estimated, FoldError<AlternatingError>> {
    let start = start_rig(training)?;
    let names = training.numbered_cameras();
    let (_, fields) = estimate_rig(&start, &names, placement).map_err(FoldError::Estimate)?;
    Ok(Estimated {
        rig: fields.rig,
        board_shape: BoardShape::default(),
    })
}

/// The published procedure from a start, and its cameras as fields.
///
/// # Errors
/// [`AlternatingError`].
pub fn estimate_rig(
    start: &RigStart,
    names: &[String],
    placement: &dyn Fn(usize) -> Option<usize>,
) -> Result<(AlternatingEstimate, FieldRig), AlternatingError> {
    let found = estimate(start, placement, &AlternatingSettings::default())?;
    let bases: Vec<BaseLens> = start.fields.iter().map(|field| field.base).collect();
    let fields = found
        .rig(names, &bases)
        .ok_or(AlternatingError::FewBoards)?;
    Ok((found, fields))
}

/// Leaves corners outside the calibrated area without a residual: no pixel there has a ray, and what
/// a smooth field says of it would pass for an outlier.
fn drop_outside(
    rig: &Rig,
    observations: &Observations,
    residuals: &mut [Vec<Option<Vector2<f64>>>],
) {
    for (view, residuals) in observations.views.iter().zip(residuals) {
        let camera = rig.cameras.get(view.camera_idx);
        for (corner, residual) in view.corners.iter().zip(residuals) {
            if !camera.is_some_and(|camera| camera.coverage.contains(corner.pixel)) {
                *residual = None;
            }
        }
    }
}

fn stop_reason(alternated: &Alternated) -> String {
    let sweeps = alternated.rms_mm.len().saturating_sub(1);
    let stop = match alternated.stop {
        AlternationStop::StepBelowLimit => {
            format!("stopped after {sweeps} sweeps: no control point moves any more by what counts")
        }
        AlternationStop::SweepLimit => format!("stopped at the limit of {sweeps} sweeps"),
    };
    match alternated.still_falling() {
        None => stop,
        Some(share) => format!(
            "{stop}, with the cost still falling ({:.1} % in the last tenth of them): the poses are not \
             where they would come to rest",
            100.0 * share
        ),
    }
}

fn record(found: &AlternatingEstimate, fields: &FieldRig) -> AlternatingRecord {
    AlternatingRecord {
        spread: found.spread.clone(),
        starts: found.starts.clone(),
        circles: found.circles.clone(),
        projected: found.projected,
        sweeps: found.alternated.rms_mm.len().saturating_sub(1),
        last_step_mm: found.alternated.last_step_mm,
        still_falling: found.alternated.still_falling(),
        field_rms_error_px: fields.rms_error_px.clone(),
    }
}
