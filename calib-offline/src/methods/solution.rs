//! What a method found, whichever it was: all that the record, the report and a comparison need.

use super::MethodError;
use crate::report::record::{AlternatingRecord, ChoicesRecord};
use calib_estimate::adjust::robust::{StudentT, relative_weights, reweight};
use calib_estimate::adjust::{Observations, StopReason};
use calib_estimate::init::screening::Finding;
use calib_estimate::joint::Simpler;
use calib_judge::half_data::{FirstHalf, Split};
use calib_judge::held_out::Estimated;
use calib_judge::known_points::{Points, measure};
use calib_judge::model_choice::ModelChoice;
use calib_judge::{Cause, CrossChecks, Declared, ExpectedError, Folds, Task, TaskError};
use calib_rays::board::BoardShape;
use calib_rays::field::{RayTable, Rig};
use calib_rays::geometry::{RigidTransform, SensorSize};
use calib_rays::measure::{PointSource, RigSource, Sighting};
use calib_rays::numerics::median;
use nalgebra::Vector2;
use std::fmt::Debug;

/// A calibration as a method gives it.
#[derive(Debug)]
pub struct Solution {
    /// Name of the method.
    pub method: &'static str,
    /// What went in: poses that the method could not place are not in it.
    pub observations: Observations,
    /// What was found wrong with views on the way.
    pub findings: Vec<Finding>,
    /// The cameras. Its frame is the board at the datum pose.
    pub rig: Rig,
    /// Largest difference of the rig's rays from the method's own, px; 0 where these are the rig's.
    pub conversion_error_px: f64,
    /// Per pose of the observations.
    pub rig_from_board: Vec<RigidTransform>,
    /// Out-of-plane shape of the board.
    pub board_shape: BoardShape,
    /// Observed minus predicted, px, per view and corner; `None` where nothing is predicted.
    pub residuals: Vec<Vec<Option<Vector2<f64>>>>,
    /// Per view and corner: whether it was learned from, and not rejected as an outlier. With a weight
    /// of 0 it still may be, where no ray of the rig tells how well it fits.
    pub is_used: Vec<Vec<bool>>,
    /// Robust weight per view and corner, 0 to 1; 0 is a corner that is rejected or has no residual.
    pub robust_weights: Vec<Vec<f64>>,
    /// Standard deviation of the corner noise per axis, px.
    pub sigma_px: f64,
    /// What was minimized, after each step.
    pub costs: Vec<f64>,
    /// Why it stopped, in words.
    pub stop_reason: String,
    /// Whether it came to rest.
    pub settled: bool,
    /// What the method chose by itself, if it chooses.
    pub choices: Option<ChoicesRecord>,
    /// How the published procedure went, if it was that.
    pub alternating: Option<AlternatingRecord>,
    /// What else the method has.
    pub own: Box<dyn Own>,
}

/// What a method has beside a rig. One that has no more leaves all as it is.
pub trait Own: Debug + Send + Sync {
    /// What it measures points with (rig frame), where its own rays are not those of the rig.
    fn rays(&self) -> Option<&dyn PointSource<Number = f64>> {
        None
    }

    /// Its own rays of a camera's pixels, where they are not those of the rig.
    fn ray_table(&self, _camera_idx: usize, _sensor: SensorSize) -> Option<RayTable> {
        None
    }

    /// Checks of the calibration against itself; `rig` is that of the solution, `splits` are the ways to
    /// halve its poses, none if halves are not to be compared.
    fn check(&self, _rig: &Rig, _splits: &[(Split, FirstHalf)]) -> Option<CrossChecks> {
        None
    }

    /// Its answer from a part of the points of all its poses, made again from where it ended; `None` if it can only
    /// begin anew.
    fn again(&self, _training: &Observations) -> Option<Result<Estimated, MethodError>> {
        None
    }

    /// Whether it has anything to do without that boards it never saw could speak against.
    fn may_be_simpler(&self) -> bool {
        false
    }

    /// What the boards that each fold never saw say to its choice of a model. Where a simpler one is taken, the folds are
    /// made what that makes of them.
    fn judged_by(&self, _folds: &mut Folds) -> Option<ModelChoice> {
        None
    }

    /// The solution by a simpler model; `None` if it has no other.
    fn made_simpler(
        &self,
        _to: Simpler,
        _findings: &[Finding],
        _names: &[String],
    ) -> Option<Result<Solution, MethodError>> {
        None
    }

    /// Numbers that the data determine, poses apart; 0 if that is not known.
    fn freedom(&self) -> f64 {
        0.0
    }

    /// RMS of what it leaves open of points at its working distance, mm; `rig` is that of the solution.
    fn left_open_mm(&self, _rig: &Rig) -> Option<f64> {
        None
    }

    /// What a measurement with it can be expected to be off by; `rig` is that of the solution.
    ///
    /// # Errors
    /// [`TaskError`]; by default that it is not known.
    fn expected_error(
        &self,
        _rig: &Rig,
        _task: &Task,
        _declared: &Declared,
    ) -> Result<ExpectedError, TaskError> {
        Err(TaskError::NoCovariance)
    }

    /// What explains its residuals better than noise, most important first; `rig` is that of the
    /// solution.
    fn suspects(&self, _rig: &Rig) -> Vec<Cause> {
        Vec::new()
    }
}

impl Solution {
    /// Holds the choice of the model against boards that no fold learned from, and takes what they speak for.
    ///
    /// # Errors
    /// What an estimate by the simpler model says.
    pub fn held_against(self, folds: &mut Folds, names: &[String]) -> Result<Self, MethodError> {
        let found = self.own.judged_by(folds);
        let taken = found.iter().flat_map(|found| &found.compared);
        let taken = taken.filter(|one| one.taken).map(|one| one.without).next();
        let simpler = taken.and_then(|to| self.own.made_simpler(to, &self.findings, names));
        let mut solution = simpler.unwrap_or(Ok(self))?;
        if let Some(choices) = &mut solution.choices {
            choices.unseen = found;
        }
        Ok(solution)
    }

    /// Points of matches by the method's own rays, rig frame, mm.
    pub fn measure(&self, matches: &[Vec<Sighting<f64>>]) -> Points {
        if let Some(rays) = self.own.rays() {
            return measure(rays, matches);
        }
        // Without a frame there is always a source.
        RigSource::new(&self.rig, None).map_or_else(
            || vec![None; matches.len()],
            |source| measure(&source, matches),
        )
    }

    /// Median distance of the boards from the first camera, mm; 0 without any.
    pub fn distance_mm(&self) -> f64 {
        let Some(camera) = self.rig.cameras.first() else {
            return 0.0;
        };
        let middle = self.observations.board.center_in_board();
        let place = camera.rig_from_camera.translation_mm;
        let poses = self.rig_from_board.iter();
        median(poses.map(|pose| (pose.point(&middle) - place).norm())).unwrap_or(0.0)
    }

    /// What a pixel in the middle of the first camera is at that distance, mm.
    pub fn mm_per_px(&self) -> f64 {
        let Some(camera) = self.rig.cameras.first() else {
            return 0.0;
        };
        let sample = camera.field.sample(camera.field.sensor.center());
        self.distance_mm() * sample.ds.determinant().abs().sqrt()
    }

    /// Number of different poses that went in; one that was split counts once.
    pub fn pose_count(&self) -> usize {
        self.observations.different_pose_count()
    }

    /// Corners rejected as outliers; one without a residual is none.
    pub fn rejected_count(&self) -> usize {
        let views = self.residuals.iter().zip(&self.robust_weights);
        views.map(|(r, w)| unused(r, w).rejected).sum()
    }

    /// Lengths of the residual vectors of the corners that were not rejected, px.
    pub fn used_residuals_px(&self) -> Vec<f64> {
        self.residuals
            .iter()
            .flatten()
            .zip(self.robust_weights.iter().flatten())
            .filter(|(_, weight)| **weight > 0.0)
            .filter_map(|(residual, _)| residual.map(|r| r.norm()))
            .collect()
    }
}

/// Corners of a view that did not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unused {
    /// Rejected as outliers.
    pub rejected: usize,
    /// No ray to compare with: outside the calibrated area, or behind the camera.
    pub without_ray: usize,
}

/// Tells a view's corners of weight 0 apart.
pub fn unused(residuals: &[Option<Vector2<f64>>], weights: &[f64]) -> Unused {
    let without_ray = residuals.iter().filter(|r| r.is_none()).count();
    let pairs = residuals.iter().zip(weights);
    Unused {
        rejected: pairs
            .filter(|(residual, weight)| residual.is_some() && **weight == 0.0)
            .count(),
        without_ray,
    }
}

/// The views of the poses that were placed, and where their boards were: the others take no part.
pub(super) fn placed_part(
    observations: &Observations,
    rig_from_board: &[Option<RigidTransform>],
) -> (Observations, Vec<RigidTransform>) {
    let used = observations.with_pose_indices(|pose_idx| rig_from_board[pose_idx].is_some());
    (used, rig_from_board.iter().flatten().copied().collect())
}

/// Whether an adjustment ended where it would stay.
pub(super) fn came_to_rest(stop: StopReason) -> bool {
    matches!(stop, StopReason::Converged | StopReason::NoFurtherDecrease)
}

/// Noise that residuals show, and how much each counts: as in the joint estimate, but for the corners far from
/// all others, which take no part. What a model leaves that does not fit has tails of its own.
pub(super) fn weighted(
    residuals: &[Vec<Option<Vector2<f64>>>],
    observations: &Observations,
) -> (StudentT, Vec<Vec<f64>>) {
    let (noise, _) = reweight(residuals, observations, 1.0, None, false);
    let mut weights = relative_weights(residuals, observations, &noise);
    let views = weights.iter_mut().zip(residuals).zip(&observations.views);
    for ((weights, residuals), view) in views {
        for ((weight, residual), corner) in weights.iter_mut().zip(residuals).zip(&view.corners) {
            let squared = residual.map(|r| r.norm_squared() * corner.relative_weight);
            if squared.is_some_and(|squared| !noise.is_near(squared)) {
                *weight = 0.0;
            }
        }
    }
    (noise, weights)
}

/// Which weights are above 0.
pub(super) fn positive(weights: &[Vec<f64>]) -> Vec<Vec<bool>> {
    let views = weights.iter();
    views
        .map(|weights| weights.iter().map(|weight| *weight > 0.0).collect())
        .collect()
}
