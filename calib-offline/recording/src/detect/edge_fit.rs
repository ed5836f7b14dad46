//! Least squares for models of blurred edges: few unknowns, and all pixels of a window.

use calib_rays::numerics::levenberg::{self, Problem, StopReason, Tried};
use nalgebra::{SMatrix, SVector};

/// The normal equations of a model with N unknowns.
#[derive(Clone, Copy)]
pub struct NormalEquations<const N: usize> {
    normal: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
    /// Sum of the squared residuals.
    cost: f64,
    pixels: usize,
}

impl<const N: usize> NormalEquations<N> {
    /// From each pixel's value, and what the model says of it with the derivatives by its unknowns.
    pub fn of(pixels: impl Iterator<Item = (f64, (f64, SVector<f64, N>))>) -> Self {
        let mut sum = Self {
            normal: SMatrix::zeros(),
            right: SVector::zeros(),
            cost: 0.0,
            pixels: 0,
        };
        for (value, (predicted, gradient)) in pixels {
            let residual = value - predicted;
            sum.normal.ger(1.0, &gradient, &gradient, 1.0);
            sum.right.axpy(residual, &gradient, 1.0);
            sum.cost += residual * residual;
            sum.pixels += 1;
        }
        sum
    }
}

/// When to stop.
pub struct Limits {
    /// Most steps.
    pub iterations: usize,
    /// A step that changes no unknown of the first `placing` by this much ends the iteration.
    pub step: f64,
    /// How many of the unknowns say where the edges are.
    pub placing: usize,
}

/// A model that fits best.
pub struct Fitted<const N: usize> {
    /// Its unknowns.
    pub unknowns: SVector<f64, N>,
    /// Their covariance from the residuals' own variance.
    pub covariance: SMatrix<f64, N, N>,
    /// RMS of the residuals.
    pub residual_rms: f64,
}

/// The model as a problem of Levenberg-Marquardt; a state keeps the equations that its cost came with.
struct EdgeFit<'a, const N: usize, K, E> {
    limits: &'a Limits,
    keep_in_range: K,
    equations: E,
}

impl<const N: usize, K, E> Problem for EdgeFit<'_, N, K, E>
where
    K: Fn(&mut SVector<f64, N>),
    E: Fn(&SVector<f64, N>) -> Option<NormalEquations<N>>,
{
    type State = (SVector<f64, N>, NormalEquations<N>);
    type Equations = NormalEquations<N>;
    type Step = SVector<f64, N>;

    fn cost(&self, (_, at): &Self::State) -> f64 {
        at.cost
    }

    fn linearize(&self, (_, at): &Self::State) -> Option<NormalEquations<N>> {
        Some(*at)
    }

    fn step(&self, equations: &NormalEquations<N>, damping: f64) -> Option<Self::Step> {
        let mut damped = equations.normal;
        for k in 0..N {
            damped[(k, k)] *= 1.0 + damping;
        }
        Some(damped.cholesky()?.solve(&equations.right))
    }

    fn moved(&self, (unknowns, _): &Self::State, step: &Self::Step) -> Option<Self::State> {
        let mut next = unknowns + step;
        (self.keep_in_range)(&mut next);
        let at_next = (self.equations)(&next)?;
        Some((next, at_next))
    }

    /// A short step ends it whether or not it still improves the fit.
    fn is_settled(&self, tried: &Tried<Self>) -> bool {
        tried.step.rows(0, self.limits.placing).amax() < self.limits.step
    }
}

/// Levenberg-Marquardt from `start`. `keep_in_range` changes unknowns that went where the model means
/// nothing; `equations` are `None` where there is no model at all, and so is then the fit.
pub fn fit<const N: usize>(
    start: SVector<f64, N>,
    limits: &Limits,
    keep_in_range: impl Fn(&mut SVector<f64, N>),
    equations: impl Fn(&SVector<f64, N>) -> Option<NormalEquations<N>>,
) -> Option<Fitted<N>> {
    let settings = levenberg::Settings {
        max_linearizations: usize::MAX,
        max_steps: limits.iterations,
        first_damping: 1e-3,
        least_damping: 1e-9,
        most_damping: f64::INFINITY,
        growth: 10.0,
        growth_from: 0.0,
        singular_damping: 0.0,
        least_after_singular: 0.0,
        accepts_equal: true,
    };
    let at_start = equations(&start)?;
    let problem = EdgeFit {
        limits,
        keep_in_range,
        equations,
    };
    let outcome = levenberg::minimize(&problem, (start, at_start), &settings);
    if matches!(outcome.stop, StopReason::Singular | StopReason::Undefined) {
        return None;
    }
    let (unknowns, at) = outcome.state;
    let count = at.pixels as f64;
    let variance = at.cost / (count - N as f64);
    Some(Fitted {
        unknowns,
        covariance: at.normal.cholesky()?.inverse() * variance,
        residual_rms: (at.cost / count).sqrt(),
    })
}
