//! Levenberg-Marquardt: the one loop that lowers a cost by steps of damped equations. What the cost
//! is, and how its equations are solved, is the [`Problem`]'s.

/// What is to be made least.
pub trait Problem {
    /// Where the search stands, with all that is kept of the cost's evaluation there.
    type State;
    /// The problem linearized at a state.
    type Equations;
    /// What the equations ask for.
    type Step;

    /// The cost of a state; one that is not a number is never accepted.
    fn cost(&self, state: &Self::State) -> f64;

    /// The equations at a state; `None` where there are none, which ends the search.
    fn linearize(&self, state: &Self::State) -> Option<Self::Equations>;

    /// The step of the equations, their diagonal enlarged by the factor `1 + damping`; `None` if they
    /// are singular even so.
    fn step(&self, equations: &Self::Equations, damping: f64) -> Option<Self::Step>;

    /// The state after a step; `None` where the cost means nothing, which ends the search.
    fn moved(&self, state: &Self::State, step: &Self::Step) -> Option<Self::State>;

    /// Whether a step shows, accepted or not, that further ones would change next to nothing.
    fn is_settled(&self, tried: &Tried<Self>) -> bool;
}

/// A step that was tried.
pub struct Tried<'a, P: Problem + ?Sized> {
    /// The equations that asked for it.
    pub equations: &'a P::Equations,
    /// The step.
    pub step: &'a P::Step,
    /// Their damping.
    pub damping: f64,
    /// The cost before.
    pub cost: f64,
    /// The cost after.
    pub reached: f64,
}

/// How far a step goes, and when to give up. An accepted step lowers the damping to a tenth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Most linearizations.
    pub max_linearizations: usize,
    /// Most steps tried.
    pub max_steps: usize,
    /// Damping of the first step.
    pub first_damping: f64,
    /// The least there is: at that level a step is Gauss-Newton's.
    pub least_damping: f64,
    /// With more than this no step lowers the cost.
    pub most_damping: f64,
    /// A refused step raises the damping by this factor ...
    pub growth: f64,
    /// ... and from no less than this.
    pub growth_from: f64,
    /// Equations that are singular with this damping are so for good. Below, they are damped a hundred
    /// times as much ...
    pub singular_damping: f64,
    /// ... and no less than this.
    pub least_after_singular: f64,
    /// Whether a step is accepted that leaves the cost as it is, to the last bit.
    pub accepts_equal: bool,
}

/// Why the search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// A further step would change next to nothing.
    Converged,
    /// The allowed number of iterations is used up.
    IterationLimit,
    /// No step, however short, lowers the cost any more.
    NoFurtherDecrease,
    /// The equations are singular: something is not determined by the data.
    Singular,
    /// A step led where the cost means nothing.
    Undefined,
}

impl std::fmt::Display for StopReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged: a further step would change next to nothing",
            Self::IterationLimit => "stopped at the iteration limit",
            Self::NoFurtherDecrease => "stopped: no step lowers the cost any more",
            Self::Singular => "stopped: the data do not determine some parameter",
            Self::Undefined => "stopped: a step led where the cost means nothing",
        })
    }
}

/// The state reached, and how.
#[derive(Debug, Clone)]
pub struct Outcome<S> {
    /// Best state found.
    pub state: S,
    /// Cost at the start and after each accepted step.
    pub costs: Vec<f64>,
    /// Linearizations.
    pub linearizations: usize,
    /// Why it ended.
    pub stop: StopReason,
}

/// Lowers the cost from a starting state. Cost: one linearization per accepted step, one solution and
/// one evaluation of the cost per step tried.
pub fn minimize<P: Problem>(
    problem: &P,
    start: P::State,
    settings: &Settings,
) -> Outcome<P::State> {
    let mut state = start;
    let mut cost = problem.cost(&state);
    let mut costs = vec![cost];
    let mut damping = settings.first_damping;
    let (mut linearizations, mut steps) = (0, 0);
    let stop = 'search: loop {
        if linearizations == settings.max_linearizations || steps == settings.max_steps {
            break StopReason::IterationLimit;
        }
        let Some(equations) = problem.linearize(&state) else {
            break StopReason::Undefined;
        };
        linearizations += 1;
        while steps < settings.max_steps {
            if damping > settings.most_damping {
                break 'search StopReason::NoFurtherDecrease;
            }
            let Some(step) = problem.step(&equations, damping) else {
                if damping >= settings.singular_damping {
                    break 'search StopReason::Singular;
                }
                damping = (damping * 100.0).max(settings.least_after_singular);
                continue;
            };
            steps += 1;
            let Some(moved) = problem.moved(&state, &step) else {
                break 'search StopReason::Undefined;
            };
            let reached = problem.cost(&moved);
            let is_settled = problem.is_settled(&Tried {
                equations: &equations,
                step: &step,
                damping,
                cost,
                reached,
            });
            let is_accepted = reached < cost || (settings.accepts_equal && reached == cost);
            if is_accepted {
                state = moved;
                cost = reached;
                costs.push(cost);
                damping = (damping / 10.0).max(settings.least_damping);
            }
            if is_settled {
                break 'search StopReason::Converged;
            }
            if is_accepted {
                break;
            }
            damping = damping.max(settings.growth_from) * settings.growth;
        }
    };
    Outcome {
        state,
        costs,
        linearizations,
        stop,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    const SETTINGS: Settings = Settings {
        max_linearizations: 100,
        max_steps: 1000,
        first_damping: 1e-4,
        least_damping: 1e-12,
        most_damping: 1e8,
        growth: 10.0,
        growth_from: 1e-8,
        singular_damping: 1.0,
        least_after_singular: 1e-6,
        accepts_equal: false,
    };

    /// Rosenbrock's valley: residuals `10 (y - x^2)` and `1 - x`; undefined right of a wall.
    struct Valley {
        wall: f64,
        /// How much the second residual counts, 1 or 0.
        share: f64,
    }

    fn residuals(x: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(10.0 * (x.y - x.x * x.x), 1.0 - x.x)
    }

    impl Problem for Valley {
        type State = Vector2<f64>;
        type Equations = (Matrix2<f64>, Vector2<f64>);
        type Step = Vector2<f64>;

        fn cost(&self, x: &Self::State) -> f64 {
            let r = residuals(x);
            r.x * r.x + self.share * r.y * r.y
        }

        fn linearize(&self, x: &Self::State) -> Option<Self::Equations> {
            let jacobian = Matrix2::new(-20.0 * x.x, 10.0, -self.share, 0.0);
            Some((jacobian.tr_mul(&jacobian), jacobian.tr_mul(&residuals(x))))
        }

        fn step(&self, (normal, gradient): &Self::Equations, damping: f64) -> Option<Vector2<f64>> {
            let mut damped = *normal;
            for k in 0..2 {
                damped[(k, k)] *= 1.0 + damping;
            }
            Some(damped.cholesky()?.solve(&-gradient))
        }

        fn moved(&self, x: &Self::State, step: &Self::Step) -> Option<Self::State> {
            let next = x + step;
            (next.x < self.wall).then_some(next)
        }

        fn is_settled(&self, tried: &Tried<Self>) -> bool {
            tried.step.norm() < 1e-12
        }
    }

    #[test]
    fn the_bottom_of_a_bent_valley_is_found() {
        let valley = Valley {
            wall: f64::INFINITY,
            share: 1.0,
        };
        let outcome = minimize(&valley, Vector2::new(-1.2, 1.0), &SETTINGS);
        assert_eq!(outcome.stop, StopReason::Converged);
        assert!((outcome.state - Vector2::new(1.0, 1.0)).norm() < 1e-12);
        assert!(outcome.costs.windows(2).all(|pair| pair[1] < pair[0]));
        assert!(outcome.linearizations <= outcome.costs.len());
    }

    #[test]
    fn limits_count_linearizations_and_steps() {
        let valley = Valley {
            wall: f64::INFINITY,
            share: 1.0,
        };
        let start = Vector2::new(-1.2, 1.0);
        for settings in [
            Settings {
                max_linearizations: 2,
                ..SETTINGS
            },
            Settings {
                max_steps: 2,
                ..SETTINGS
            },
        ] {
            let outcome = minimize(&valley, start, &settings);
            assert_eq!(outcome.stop, StopReason::IterationLimit);
            assert!(outcome.linearizations <= 2 && outcome.costs.len() <= 3);
        }
        let none = minimize(
            &valley,
            start,
            &Settings {
                max_steps: 0,
                ..SETTINGS
            },
        );
        assert_eq!((none.state, none.linearizations), (start, 0));
    }

    #[test]
    fn a_step_beyond_what_is_defined_ends_the_search_where_it_was() {
        let valley = Valley {
            wall: 0.0,
            share: 1.0,
        };
        let start = Vector2::new(-1.2, 1.0);
        let outcome = minimize(&valley, start, &SETTINGS);
        assert_eq!(
            (outcome.stop, outcome.state),
            (StopReason::Undefined, start)
        );
    }

    #[test]
    fn equations_that_damping_does_not_mend_are_singular() {
        // Nothing depends on x at x = 0.
        let valley = Valley {
            wall: f64::INFINITY,
            share: 0.0,
        };
        let outcome = minimize(&valley, Vector2::new(0.0, 1.0), &SETTINGS);
        assert_eq!(outcome.stop, StopReason::Singular);
    }
}
