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
    /// Of no pixels yet.
    pub fn none() -> Self {
        Self {
            normal: SMatrix::zeros(),
            right: SVector::zeros(),
            cost: 0.0,
            pixels: 0,
        }
    }

    /// From each pixel's value, and what the model says of it with the derivatives by its unknowns.
    pub fn of(pixels: impl Iterator<Item = (f64, (f64, SVector<f64, N>))>) -> Self {
        let mut sum = Self::none();
        for (value, (predicted, gradient)) in pixels {
            sum.add(value - predicted, &gradient);
        }
        sum
    }

    /// One more pixel. Only the lower triangle is summed: no more is read.
    #[inline]
    pub fn add(&mut self, residual: f64, gradient: &SVector<f64, N>) {
        for k in 0..N {
            for i in k..N {
                self.normal[(i, k)] += gradient[i] * gradient[k];
            }
        }
        self.right.axpy(residual, gradient, 1.0);
        self.cost += residual * residual;
        self.pixels += 1;
    }

    /// Many pixels at once, from their own sums; of `normal`, the lower triangle counts.
    pub fn add_sums(
        &mut self,
        normal: &SMatrix<f64, N, N>,
        right: &SVector<f64, N>,
        cost: f64,
        pixels: usize,
    ) {
        self.normal += normal;
        self.right += right;
        self.cost += cost;
        self.pixels += pixels;
    }

    /// The covariance of unknowns: of those that stand at a bound, or that no pixel tells anything of,
    /// it says nothing.
    fn inverse(
        mut self,
        unknowns: &SVector<f64, N>,
        ranges: &[Range],
    ) -> Option<SMatrix<f64, N, N>> {
        for range in ranges {
            let k = range.unknown;
            if unknowns[k] <= range.least || unknowns[k] >= range.most || self.normal[(k, k)] <= 0.0
            {
                self.hold(k, 0.0);
            }
        }
        Some(self.normal.cholesky()?.inverse())
    }

    /// The step, its diagonal enlarged by `1 + damping`. Where it would lead out of a range it leads to
    /// the bound, and the others' steps are those that go with it.
    fn step(
        &self,
        damping: f64,
        unknowns: &SVector<f64, N>,
        ranges: &[Range],
    ) -> Option<SVector<f64, N>> {
        let mut damped = *self;
        for k in 0..N {
            damped.normal[(k, k)] *= 1.0 + damping;
        }
        for range in ranges {
            if damped.normal[(range.unknown, range.unknown)] <= 0.0 {
                damped.hold(range.unknown, 0.0);
            }
        }
        let mut step = damped.solved()?;
        for range in ranges {
            let k = range.unknown;
            let within = range.clamped(unknowns[k] + step[k], unknowns[k]) - unknowns[k];
            if within != step[k] {
                damped.hold(k, within);
                step = damped.solved()?;
            }
        }
        Some(step)
    }

    fn solved(&self) -> Option<SVector<f64, N>> {
        Some(self.normal.cholesky()?.solve(&self.right))
    }

    /// Sets the step of an unknown.
    fn hold(&mut self, k: usize, step: f64) {
        for i in 0..N {
            let pair = (i.max(k), i.min(k));
            self.right[i] -= self.normal[pair] * step;
            self.normal[pair] = 0.0;
        }
        self.normal[(k, k)] = 1.0;
        self.right[k] = step;
    }
}

/// Where an unknown means something.
#[derive(Debug, Clone, Copy)]
pub struct Range {
    /// Which one.
    pub unknown: usize,
    /// Its least value.
    pub least: f64,
    /// Its greatest.
    pub most: f64,
    /// No step makes it less than this part of what it was; 0 for one that may be.
    pub shrink: f64,
}

impl Range {
    fn clamped(&self, next: f64, before: f64) -> f64 {
        let shrunk = if self.shrink > 0.0 {
            self.shrink * before
        } else {
            self.least
        };
        next.clamp(self.least.max(shrunk).min(self.most), self.most)
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
struct EdgeFit<'a, const N: usize, E> {
    limits: &'a Limits,
    ranges: &'a [Range],
    equations: E,
}

impl<const N: usize, E> Problem for EdgeFit<'_, N, E>
where
    E: Fn(&SVector<f64, N>) -> Option<NormalEquations<N>>,
{
    type State = (SVector<f64, N>, NormalEquations<N>);
    type Equations = Self::State;
    type Step = SVector<f64, N>;

    fn cost(&self, (_, at): &Self::State) -> f64 {
        at.cost
    }

    fn linearize(&self, state: &Self::State) -> Option<Self::Equations> {
        Some(*state)
    }

    fn step(&self, (unknowns, at): &Self::Equations, damping: f64) -> Option<Self::Step> {
        at.step(damping, unknowns, self.ranges)
    }

    fn moved(&self, (unknowns, _): &Self::State, step: &Self::Step) -> Option<Self::State> {
        let next = unknowns + step;
        let at_next = (self.equations)(&next)?;
        Some((next, at_next))
    }

    /// A short step ends it whether or not it still improves the fit.
    fn is_settled(&self, tried: &Tried<Self>) -> bool {
        tried.step.rows(0, self.limits.placing).amax() < self.limits.step
    }
}

/// Levenberg-Marquardt from `start`. Unknowns stay in their `ranges`; `equations` are `None` where there is no model at all, and so is then the fit.
pub fn fit<const N: usize>(
    start: SVector<f64, N>,
    limits: &Limits,
    ranges: &[Range],
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
        ranges,
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
        covariance: at.inverse(&unknowns, ranges)? * variance,
        residual_rms: (at.cost / count).sqrt(),
    })
}
