//! Least squares for models of blurred edges: few unknowns, and all pixels of a window.

use nalgebra::{SMatrix, SVector};

/// The normal equations of a model with N unknowns.
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

/// Levenberg-Marquardt from `start`. `keep_in_range` changes unknowns that went where the model means
/// nothing; `equations` are `None` where there is no model at all, and so is then the fit.
pub fn fit<const N: usize>(
    start: SVector<f64, N>,
    limits: &Limits,
    keep_in_range: impl Fn(&mut SVector<f64, N>),
    equations: impl Fn(&SVector<f64, N>) -> Option<NormalEquations<N>>,
) -> Option<Fitted<N>> {
    let mut unknowns = start;
    let mut at = equations(&unknowns)?;
    let mut damping = 1e-3;
    for _ in 0..limits.iterations {
        let mut damped = at.normal;
        for k in 0..N {
            damped[(k, k)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&at.right);
        let mut next = unknowns + step;
        keep_in_range(&mut next);
        let at_next = equations(&next)?;
        if at_next.cost <= at.cost {
            (unknowns, at) = (next, at_next);
            damping = (damping * 0.1).max(1e-9);
        } else {
            damping *= 10.0;
        }
        // A short step ends it whether or not it still improves the fit.
        if step.rows(0, limits.placing).amax() < limits.step {
            break;
        }
    }
    let count = at.pixels as f64;
    let variance = at.cost / (count - N as f64);
    Some(Fitted {
        unknowns,
        covariance: at.normal.cholesky()?.inverse() * variance,
        residual_rms: (at.cost / count).sqrt(),
    })
}
