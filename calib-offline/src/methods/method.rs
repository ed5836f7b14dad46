//! What a method is: what it is given, and what it is asked for.

use super::{MethodError, Own, Solution};
use calib_estimate::adjust::Observations;
use calib_estimate::init::screening::Finding;
use calib_estimate::joint::Estimate;
use calib_judge::held_out::{Dealt, Estimated};
use calib_judge::{Folds, estimate_folds};
use calib_rays::progress::Progress;
use std::collections::BTreeMap;
use std::fmt::Debug;

/// A joint estimate, and what was found wrong with views on the way.
pub type JointFound = (Estimate, Vec<Finding>);

/// What a method is given.
#[derive(Debug, Clone, Copy)]
pub struct Given<'a> {
    /// The views.
    pub observations: &'a Observations,
    /// Names of the cameras, in order.
    pub names: &'a [String],
    /// Stage placement of the poses (by number) that belong to one.
    pub placements: &'a BTreeMap<usize, usize>,
    /// The joint estimate of these views, if their screening has made it.
    pub joint: Option<&'a Result<JointFound, MethodError>>,
}

/// A way from views to a rig.
pub trait Method: Debug + Sync {
    /// Its name in files.
    fn name(&self) -> &'static str;

    /// What it is called in words.
    fn title(&self) -> &'static str;

    /// From all views.
    ///
    /// # Errors
    /// [`MethodError`] if the data cannot determine the answer.
    fn fit(&self, given: &Given, progress: &dyn Progress) -> Result<Solution, MethodError>;

    /// From the views of some poses, which are among those given. The cameras of the rig are named by
    /// number.
    ///
    /// # Errors
    /// As [`Self::fit`].
    fn fit_some_poses(
        &self,
        training: &Observations,
        given: &Given,
    ) -> Result<Estimated, MethodError>;
}

/// A method's answers without the poses (or points) of each fold, for the check on boards that it never saw. Without
/// some points it goes on from its answer to all of them, `own`, if it can and there is one.
pub fn fit_folds(
    method: &dyn Method,
    given: &Given,
    observations: &Observations,
    folds: usize,
    own: Option<&dyn Own>,
    progress: &dyn Progress,
) -> Folds {
    let own = own.filter(|_| Dealt::of(observations) == Some(Dealt::Points));
    let fit = |training: &Observations| {
        let again = own.and_then(|own| own.again(training));
        let found = again.unwrap_or_else(|| method.fit_some_poses(training, given));
        found.map_err(|error| error.reason())
    };
    estimate_folds(observations, folds, &fit, progress)
}
