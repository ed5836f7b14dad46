//! The adjustment as a problem of Levenberg-Marquardt, weights and priors held fixed.

use super::equations::normal_equations::NormalEquations;
use super::model::{Layout, Model, Step};
use super::objective::{Weights, cost};
use super::observations::{Observations, ViewBasis};
use super::priors::Priors;
use calib_rays::numerics::levenberg::{self, Problem, StopReason, Tried};

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Most linearizations.
    pub max_iterations: usize,
    /// Stop when a step promises to lower the objective by less than this share of it.
    pub relative_decrease: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_iterations: 30,
            relative_decrease: 1e-9,
        }
    }
}

impl Settings {
    fn of_search(&self) -> levenberg::Settings {
        levenberg::Settings {
            max_linearizations: self.max_iterations,
            max_steps: usize::MAX,
            first_damping: 1e-4,
            least_damping: 1e-12,
            most_damping: 1e8,
            growth: 10.0,
            growth_from: 1e-8,
            singular_damping: 1.0,
            least_after_singular: 1e-6,
            accepts_equal: false,
        }
    }
}

/// The state reached, and how.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Best state found.
    pub model: Model,
    /// Objective at the start and after each accepted step.
    pub costs: Vec<f64>,
    /// Why it ended.
    pub stop: StopReason,
}

struct Adjustment<'a> {
    layout: Layout,
    observations: &'a Observations,
    bases: &'a [ViewBasis],
    weights: &'a Weights,
    priors: &'a Priors,
    relative_decrease: f64,
}

impl Problem for Adjustment<'_> {
    type State = Model;
    type Equations = NormalEquations;
    type Step = Step;

    fn cost(&self, model: &Model) -> f64 {
        cost(
            model,
            self.observations,
            self.bases,
            self.weights,
            self.priors,
        )
    }

    fn linearize(&self, model: &Model) -> Option<NormalEquations> {
        Some(NormalEquations::assemble(
            model,
            &self.layout,
            self.observations,
            self.bases,
            self.weights,
            self.priors,
        ))
    }

    fn step(&self, equations: &NormalEquations, damping: f64) -> Option<Step> {
        Some(equations.step(&equations.reduce(damping)?))
    }

    fn moved(&self, model: &Model, step: &Step) -> Option<Model> {
        Some(model.stepped(&self.layout, step))
    }

    fn is_settled(&self, tried: &Tried<Self>) -> bool {
        let promised = tried
            .equations
            .predicted_decrease(tried.step, tried.damping);
        promised <= self.relative_decrease * tried.cost
    }
}

/// Lowers the objective from a starting model.
pub fn minimize(
    start: Model,
    observations: &Observations,
    bases: &[ViewBasis],
    weights: &Weights,
    priors: &Priors,
    settings: Settings,
) -> Outcome {
    let adjustment = Adjustment {
        layout: start.layout(),
        observations,
        bases,
        weights,
        priors,
        relative_decrease: settings.relative_decrease,
    };
    let outcome = levenberg::minimize(&adjustment, start, &settings.of_search());
    let mut model = outcome.state;
    for pose in &mut model.rig_from_board {
        *pose = pose.orthonormalized();
    }
    for camera in &mut model.cameras {
        camera.camera_from_rig = camera.camera_from_rig.orthonormalized();
    }
    Outcome {
        model,
        costs: outcome.costs,
        stop: outcome.stop,
    }
}
