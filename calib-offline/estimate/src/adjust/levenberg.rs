//! Levenberg-Marquardt on the blocked normal equations, weights and priors held fixed.

use super::equations::normal_equations::NormalEquations;
use super::model::Model;
use super::objective::{Weights, cost};
use super::observations::{Observations, ViewBasis};
use super::priors::Priors;

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

/// Why the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// A further step would change next to nothing.
    Converged,
    /// The allowed number of iterations is used up.
    IterationLimit,
    /// No step, however short, lowers the objective any more.
    NoFurtherDecrease,
    /// The equations are singular: something is not determined by the data.
    Singular,
}

impl std::fmt::Display for StopReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged: a further step would change next to nothing",
            Self::IterationLimit => "stopped at the iteration limit",
            Self::NoFurtherDecrease => "stopped: no step lowers the cost any more",
            Self::Singular => "stopped: the data do not determine some parameter",
        })
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

/// Damping of the first step, and the least there is: at that level a step is Gauss-Newton's.
const FIRST_DAMPING: f64 = 1e-4;
const LEAST_DAMPING: f64 = 1e-12;
const MOST_DAMPING: f64 = 1e8;

/// Lowers the objective from a starting model.
pub fn minimize(
    start: Model,
    observations: &Observations,
    bases: &[ViewBasis],
    weights: &Weights,
    priors: &Priors,
    settings: Settings,
) -> Outcome {
    let layout = start.layout();
    let mut model = start;
    let mut current = cost(&model, observations, bases, weights, priors);
    let mut costs = vec![current];
    let mut damping = FIRST_DAMPING;
    let mut stop = StopReason::IterationLimit;
    'iterations: for _ in 0..settings.max_iterations {
        let equations =
            NormalEquations::assemble(&model, &layout, observations, bases, weights, priors);
        loop {
            if damping > MOST_DAMPING {
                stop = StopReason::NoFurtherDecrease;
                break 'iterations;
            }
            let Some(reduced) = equations.reduce(damping) else {
                if damping >= 1.0 {
                    stop = StopReason::Singular;
                    break 'iterations;
                }
                damping = (damping * 100.0).max(1e-6);
                continue;
            };
            let step = equations.step(&reduced);
            let promised = equations.predicted_decrease(&step, damping);
            let stepped = model.stepped(&layout, &step);
            let reached = cost(&stepped, observations, bases, weights, priors);
            let settled = promised <= settings.relative_decrease * current;
            let accepted = reached < current;
            if accepted {
                model = stepped;
                current = reached;
                costs.push(current);
                damping = (damping / 10.0).max(LEAST_DAMPING);
            }
            if settled {
                stop = StopReason::Converged;
                break 'iterations;
            }
            if accepted {
                break;
            }
            damping = damping.max(1e-8) * 10.0;
        }
    }
    for pose in &mut model.rig_from_board {
        *pose = pose.orthonormalized();
    }
    for camera in &mut model.cameras {
        camera.camera_from_rig = camera.camera_from_rig.orthonormalized();
    }
    Outcome { model, costs, stop }
}
