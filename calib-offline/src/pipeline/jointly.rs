//! The joint estimate as a method of the pipeline.

use super::Method;
use super::solution::{FoldError, Solution, Solved, Task, folds_wanted};
use crate::error::Error;
use crate::evaluate::half_data::first_half;
use crate::evaluate::held_out::Estimated;
use crate::evaluate::{cross_check, estimate_folds};
use crate::report::record::ChoicesRecord;
use calib_estimate::adjust::{Observations, StopReason};
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::{Estimate, EstimateError, estimate, estimate_screened};
use calib_rays::progress::Progress;

/// Screens, estimates, and checks: against itself, and without the poses of each fold.
///
/// # Errors
/// Data that cannot determine the answer.
pub fn joint_solution(
    offered: &Observations,
    task: &Task,
    progress: &dyn Progress,
) -> Result<Solved, Error> {
    progress.begin("initialize", 1);
    let start = start_rig(offered)?;
    progress.end();

    progress.begin("estimate", 1);
    let (mut estimate, findings) = estimate_screened(offered, start)?;
    let mut rig = estimate.rig(task.names);
    estimate.fill_uncertainty(&mut rig)?;
    progress.end();

    let choices = choices(&mut estimate)?;
    let folds = folds_wanted(&estimate.observations, task.folds);
    let half = first_half(estimate.observations.poses.iter().copied(), task.placement);
    let half = (task.folds > 0).then_some(&half);
    progress.begin("cross-checks", folds);
    let (folds, checks) = rayon::join(
        || estimate_folds(&estimate.observations, folds, &estimate_joint, progress),
        || cross_check(&estimate, &rig, half),
    );
    progress.end();
    let is_settled = matches!(
        estimate.stop,
        StopReason::Converged | StopReason::NoFurtherDecrease
    );
    Ok(Solved {
        solution: Solution {
            method: Method::Joint,
            findings,
            rig,
            rig_from_board: estimate.rig_from_board(),
            board_shape: estimate.model.board_shape,
            observations: estimate.observations,
            residuals: estimate.residuals,
            robust_weights: estimate.robust_weights,
            sigma_px: estimate.noise.variance_px2.sqrt(),
            costs: estimate.costs,
            stop_reason: estimate.stop.to_string(),
            settled: is_settled,
            choices: Some(choices),
            alternating: None,
            ray_sources: None,
            checks: Some(checks),
        },
        folds,
    })
}

/// The joint estimate of some training poses. The cameras of its rig are named by number.
///
/// # Errors
/// [`FoldError`].
pub fn estimate_joint(training: &Observations) -> Result<Estimated, FoldError<EstimateError>> {
    let start = start_rig(training)?;
    let estimate = estimate(&start.observations, &start).map_err(FoldError::Estimate)?;
    Ok(Estimated {
        rig: estimate.rig(&training.numbered_cameras()),
        board_shape: estimate.model.board_shape,
    })
}

fn choices(estimate: &mut Estimate) -> Result<ChoicesRecord, EstimateError> {
    let (board_peak_to_valley_mm, board_peak_to_valley_sd_mm) =
        estimate.board_peak_to_valley_mm()?;
    Ok(ChoicesRecord {
        tried: estimate.choices.clone(),
        smoothness: estimate.smoothness.clone(),
        noise_freedom: estimate.noise.freedom,
        neighbor_correlation: estimate.neighbor_correlation,
        effective_share: estimate.effective_share,
        board_peak_to_valley_mm,
        board_peak_to_valley_sd_mm,
    })
}
