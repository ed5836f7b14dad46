//! The joint estimate as a method.

use super::solution::{came_to_rest, positive};
use super::{Given, Method, MethodError, Own, Solution};
use crate::report::record::ChoicesRecord;
use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::init::screening::Finding;
use calib_estimate::joint::{Estimate, EstimateError, Simpler, estimate, estimate_screened};
use calib_judge::half_data::{FirstHalf, Split};
use calib_judge::held_out::Estimated;
use calib_judge::model_choice::{ModelChoice, model_choice};
use calib_judge::suspects::{left_open_mm, suspects};
use calib_judge::working_volume::span;
use calib_judge::{
    Cause, CrossChecks, Declared, ExpectedError, Folds, Task, TaskError, cross_check,
    expected_error,
};
use calib_rays::field::Rig;
use calib_rays::progress::Progress;

/// Ray fields, poses and board shape of all views together.
#[derive(Debug, Clone, Copy)]
pub struct Joint;

impl Method for Joint {
    fn name(&self) -> &'static str {
        "joint"
    }

    fn title(&self) -> &'static str {
        "ray field, joint"
    }

    /// Screens the views, unless that was done, and estimates.
    fn fit(&self, given: &Given, progress: &dyn Progress) -> Result<Solution, MethodError> {
        let (estimate, findings) = if let Some(found) = given.joint {
            progress.begin("estimate", 1);
            found.clone()?
        } else {
            progress.begin("initialize", 1);
            let start = start_rig(given.observations)?;
            progress.end();
            progress.begin("estimate", 1);
            estimate_screened(given.observations, start)?
        };
        progress.end();
        solution(estimate, findings, given.names)
    }

    fn fit_some_poses(&self, training: &Observations, _: &Given) -> Result<Estimated, MethodError> {
        let start = start_rig(training)?;
        let estimate = estimate(&start.observations, &start)?;
        Ok(estimated(estimate, training))
    }
}

/// An estimate as a method gives it.
fn solution(
    mut estimate: Estimate,
    findings: Vec<Finding>,
    names: &[String],
) -> Result<Solution, MethodError> {
    let mut rig = estimate.rig(names);
    estimate.fill_uncertainty(&mut rig)?;
    let choices = choices(&mut estimate)?;
    Ok(Solution {
        method: Joint.name(),
        findings,
        rig,
        conversion_error_px: 0.0,
        rig_from_board: estimate.rig_from_board(),
        board_shape: estimate.model.board_shape.clone(),
        observations: estimate.observations.clone(),
        residuals: estimate.residuals.clone(),
        is_used: positive(&estimate.robust_weights),
        robust_weights: estimate.robust_weights.clone(),
        sigma_px: estimate.noise.variance_px2.sqrt(),
        costs: estimate.costs.clone(),
        stop_reason: estimate.stop.to_string(),
        settled: came_to_rest(estimate.stop),
        choices: Some(choices),
        alternating: None,
        own: Box::new(estimate),
    })
}

/// An estimate as a fold has it.
fn estimated(estimate: Estimate, training: &Observations) -> Estimated {
    Estimated {
        rig: estimate.rig(&training.numbered_cameras()),
        board_shape: estimate.model.board_shape.clone(),
        joint: Some(Box::new(estimate)),
    }
}

impl Own for Estimate {
    fn check(&self, rig: &Rig, splits: &[(Split, FirstHalf)]) -> Option<CrossChecks> {
        Some(cross_check(self, rig, splits))
    }

    fn again(&self, training: &Observations) -> Option<Result<Estimated, MethodError>> {
        let again = self.of_part_of_points(training.clone());
        let again = again.map(|estimate| estimated(estimate, training));
        Some(again.map_err(MethodError::from))
    }

    fn may_be_simpler(&self) -> bool {
        !Simpler::of(self).is_empty()
    }

    fn judged_by(&self, folds: &mut Folds) -> Option<ModelChoice> {
        model_choice(self, folds)
    }

    fn made_simpler(
        &self,
        to: Simpler,
        findings: &[Finding],
        names: &[String],
    ) -> Option<Result<Solution, MethodError>> {
        let simpler = self.made_simpler(to).map_err(MethodError::from);
        Some(simpler.and_then(|estimate| solution(estimate, findings.to_vec(), names)))
    }

    fn freedom(&self) -> f64 {
        Self::freedom(self)
    }

    fn left_open_mm(&self, rig: &Rig) -> Option<f64> {
        let distances = span(&self.board_distances_mm(rig));
        left_open_mm(&mut self.clone(), rig, &distances)
    }

    fn expected_error(
        &self,
        rig: &Rig,
        task: &Task,
        declared: &Declared,
    ) -> Result<ExpectedError, TaskError> {
        expected_error(self, rig, task, declared)
    }

    fn suspects(&self, rig: &Rig) -> Vec<Cause> {
        suspects(self, rig)
    }
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
        unseen: None,
    })
}
