//! The adjustment as a problem of Levenberg-Marquardt, weights and priors held fixed.

use super::equations::normal_equations::NormalEquations;
use super::model::{Layout, Model, Step};
use super::objective::{Weights, cost};
use super::observations::{Observations, ViewBasis};
use super::priors::Priors;
use calib_rays::numerics::levenberg::{self, Problem, StopReason, Tried};
use std::cell::Cell;

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

/// Steps that correct another, at most.
const MOST_CORRECTIONS: usize = 3;
/// Of the steps that correct another: what is determined a hundred times worse than by itself stays.
const CORRECTION_DAMPING: f64 = 1e-4;

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
    /// Cost where the search last linearized.
    at: Cell<f64>,
}

impl Adjustment<'_> {
    /// Where a step leads, brought back to the floor of a curved valley.
    ///
    /// Boards that hardly tilt leave a valley that is long, flat and curved: focal lengths and the
    /// boards' distances grow together, one additively in the field, the others in mm. A step along
    /// it that is right to first order climbs the wall; the directions that the data determine well
    /// take that back in a step or two of their own, the others held by the damping. Without that
    /// only steps too short to climb would be taken, and their number runs out (METHOD 2.5).
    fn corrected(&self, stepped: Model) -> Model {
        let limit = self.at.get();
        let mut reached = (self.cost(&stepped), stepped);
        for _ in 0..MOST_CORRECTIONS {
            if reached.0 < limit {
                break;
            }
            let Some(next) = self.strong_step(&reached.1) else {
                break;
            };
            let cost = self.cost(&next);
            if !(cost < reached.0) {
                break;
            }
            reached = (cost, next);
        }
        reached.1
    }

    fn strong_step(&self, from: &Model) -> Option<Model> {
        let equations = self.assembled(from);
        let step = equations.step(&equations.reduce(CORRECTION_DAMPING)?);
        Some(from.stepped(&self.layout, &step))
    }

    fn assembled(&self, model: &Model) -> NormalEquations {
        NormalEquations::assemble(
            model,
            &self.layout,
            self.observations,
            self.bases,
            self.weights,
            self.priors,
        )
    }
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
        self.at.set(self.cost(model));
        Some(self.assembled(model))
    }

    fn step(&self, equations: &NormalEquations, damping: f64) -> Option<Step> {
        Some(equations.step(&equations.reduce(damping)?))
    }

    fn moved(&self, model: &Model, step: &Step) -> Option<Model> {
        Some(self.corrected(model.stepped(&self.layout, step)))
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
        at: Cell::new(f64::INFINITY),
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
