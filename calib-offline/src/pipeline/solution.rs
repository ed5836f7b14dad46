//! What a method found, whichever it was: all that the record, the report and a comparison need.

use super::Method;
use crate::evaluate::{CrossChecks, Folds};
use crate::report::record::{AlternatingRecord, ChoicesRecord};
use calib_estimate::adjust::Observations;
use calib_estimate::alternating::rays::RaySource;
use calib_estimate::init::InitError;
use calib_estimate::init::screening::Finding;
use calib_rays::board::BoardShape;
use calib_rays::field::Rig;
use calib_rays::geometry::RigidTransform;
use calib_rays::observed::MIN_POSES;
use nalgebra::Vector2;

/// What a method is to do.
pub struct Task<'a> {
    /// Names of the cameras, in order.
    pub names: &'a [String],
    /// Folds of the check on unseen boards; 0 leaves it out, and the comparison of two halves too.
    pub folds: usize,
    /// Placement of the stage that a pose belongs to.
    pub placement: &'a (dyn Fn(usize) -> Option<usize> + Sync),
}

/// A calibration as a method gives it.
#[derive(Debug)]
pub struct Solution {
    /// Which method.
    pub method: Method,
    /// What went in: poses that the method could not place are not in it.
    pub observations: Observations,
    /// What was found wrong with views on the way.
    pub findings: Vec<Finding>,
    /// The cameras. Its frame is the board at the datum pose.
    pub rig: Rig,
    /// Per pose of the observations.
    pub rig_from_board: Vec<RigidTransform>,
    /// Out-of-plane shape of the board.
    pub board_shape: BoardShape,
    /// Observed minus predicted, px, per view and corner; `None` where nothing is predicted.
    pub residuals: Vec<Vec<Option<Vector2<f64>>>>,
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
    /// One ray per pixel and camera as the method has them; `None` where it has a field.
    pub ray_sources: Option<Vec<RaySource>>,
    /// Checks of the calibration against itself, where the method has them.
    pub checks: Option<CrossChecks>,
}

impl Solution {
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

/// A solution, and the same method's answers without the poses of each fold.
#[derive(Debug)]
pub struct Solved {
    /// From all poses.
    pub solution: Solution,
    /// For the check on unseen boards.
    pub folds: Folds,
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

/// Why some training poses gave no estimate; `E` is the method's own error.
#[derive(Debug, thiserror::Error)]
pub enum FoldError<E> {
    /// No start.
    #[error(transparent)]
    Start(#[from] InitError),
    /// No estimate.
    #[error(transparent)]
    Estimate(E),
}

/// So many folds, or none with too few poses to leave some out.
pub fn folds_wanted(used: &Observations, folds: usize) -> usize {
    if used.different_pose_count() >= 2 * MIN_POSES {
        folds
    } else {
        0
    }
}
