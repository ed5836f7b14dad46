//! A fit in progress: a model, its smoothness weights and its noise, taken forward in rounds.

use super::correlation::{effective_share, neighbor_correlation};
use super::error::EstimateError;
use super::evidence::Smoothness;
use crate::adjust::equations::normal_equations::NormalEquations;
use crate::adjust::equations::schur_complement::SchurComplement;
use crate::adjust::levenberg::{self, Settings};
use crate::adjust::model::Layout;
use crate::adjust::objective::{self, Weights};
use crate::adjust::observations::ViewBasis;
use crate::adjust::priors::Priors;
use crate::adjust::robust::{StudentT, reweight};
use crate::adjust::{Model, Observations, StopReason};
use nalgebra::Vector2;

/// The adjustment where a round's step went too far.
const RETRY: Settings = Settings {
    max_iterations: 2,
    relative_decrease: 1e-9,
};

/// The last adjustment. It needs two or three steps; a share of 1e-8 of the objective moves no
/// parameter by a hundredth of its standard deviation.
pub const LAST: Settings = Settings {
    max_iterations: 30,
    relative_decrease: 1e-8,
};

/// A model on its way to the best one.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Where it is.
    pub model: Model,
    /// Its smoothness weights.
    pub smoothness: Smoothness,
    /// Standard deviation of each coefficient of the board's shape before anything is seen, mm.
    pub board_shape_sd_mm: f64,
    /// Distribution of the residuals.
    pub noise: StudentT,
    /// Share of corners that count as independent.
    pub share: f64,
    /// Whether corners far from everything else are left out; not while a lens is found.
    pub rejects: bool,
    /// Objective after each accepted step of the last adjustment.
    pub costs: Vec<f64>,
    /// Why the last adjustment ended.
    pub stop: StopReason,
    /// Number of parameters that the data determine.
    effective_parameters: f64,
    /// Whether the noise is that of residuals, and not yet its start.
    is_weighted: bool,
    bases: Vec<ViewBasis>,
    residuals: Vec<Vec<Option<Vector2<f64>>>>,
}

impl Fit {
    /// A fit that starts at a model, with the smoothness given.
    pub fn new(model: Model, smoothness: Smoothness, observations: &Observations) -> Self {
        let bases = model.view_bases(observations);
        let residuals = objective::residuals(&model, observations, &bases);
        Self {
            model,
            smoothness,
            board_shape_sd_mm: observations.board_shape_sd_mm,
            noise: StudentT {
                freedom: 4.0,
                variance_px2: 1.0,
            },
            share: 1.0,
            rejects: true,
            costs: Vec::new(),
            stop: StopReason::IterationLimit,
            effective_parameters: 0.0,
            is_weighted: false,
            bases,
            residuals,
        }
    }

    /// The same fit of a changed model: what the model gained starts from its start.
    pub fn changed(&self, observations: &Observations, change: impl FnOnce(&mut Model)) -> Self {
        let mut next = self.clone();
        change(&mut next.model);
        next.smoothness.cover(&next.model, next.noise.variance_px2);
        next.bases = next.model.changed_view_bases(observations, &self.bases);
        next.residuals = objective::residuals(&next.model, observations, &next.bases);
        next
    }

    /// The same fit of changed observations of the same views.
    pub fn on(&self, observations: &Observations) -> Self {
        let bases = self.model.view_bases(observations);
        let residuals = objective::residuals(&self.model, observations, &bases);
        Self {
            bases,
            residuals,
            ..self.clone()
        }
    }

    /// Number of parameters that the data determine.
    pub fn effective_parameters(&self) -> f64 {
        self.effective_parameters
    }

    /// The values of the fixed functions at every corner, per view.
    pub fn bases(&self) -> &[ViewBasis] {
        &self.bases
    }

    /// Observed minus predicted, px, per view and corner.
    pub fn residuals(&self) -> &[Vec<Option<Vector2<f64>>>] {
        &self.residuals
    }

    /// Weights from the residuals as they are, and the noise that they show.
    pub fn reweight(&mut self, observations: &Observations) -> Weights {
        let freedom = self.freedom(observations);
        let (noise, weights) = reweight(
            &self.residuals,
            observations,
            self.share * freedom,
            self.is_weighted.then_some(&self.noise),
            !self.rejects,
        );
        self.is_weighted = true;
        self.noise = StudentT {
            variance_px2: noise.variance_px2 / freedom,
            ..noise
        };
        weights
    }

    /// The residuals of a fit are smaller than the noise by the parameters that it used up: mean
    /// square of a residual over that of the noise.
    fn freedom(&self, observations: &Observations) -> f64 {
        let numbers = 2.0 * observations.corner_count() as f64;
        (1.0 - self.effective_parameters / numbers).max(0.1)
    }

    /// Variance of the noise per axis, px^2, over the corners that are not rejected. With heavy
    /// tails it is larger than the scale of the distribution.
    pub fn pixel_variance_px2(&self, observations: &Observations) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (residuals, view) in self.residuals.iter().zip(&observations.views) {
            for (residual, corner) in residuals.iter().zip(&view.corners) {
                let squared = residual.map(|r| r.norm_squared() * corner.relative_weight);
                if let Some(squared) = squared.filter(|s| self.noise.weight(*s) > 0.0) {
                    sum += squared;
                    count += 2.0;
                }
            }
        }
        if count > 0.0 {
            sum / count / self.freedom(observations)
        } else {
            self.noise.variance_px2
        }
    }

    /// The priors that go with the smoothness.
    pub fn priors(&self) -> Priors {
        self.smoothness.priors(
            &self.model,
            1.0 / (self.board_shape_sd_mm * self.board_shape_sd_mm),
        )
    }

    /// New weights, then an adjustment with them.
    pub fn adjust(&mut self, observations: &Observations, settings: Settings) {
        let weights = self.reweight(observations);
        let priors = self.priors();
        let outcome = levenberg::minimize(
            self.model.clone(),
            observations,
            &self.bases,
            &weights,
            &priors,
            settings,
        );
        self.model = outcome.model;
        self.costs = outcome.costs;
        self.stop = outcome.stop;
        self.residuals = objective::residuals(&self.model, observations, &self.bases);
    }

    /// One round: weights, one Gauss-Newton step, and new smoothness weights from the same
    /// equations. Returns twice the log evidence where the round began.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn round(&mut self, observations: &Observations) -> Result<f64, EstimateError> {
        let weights = self.reweight(observations);
        let priors = self.priors();
        let (layout, equations, reduced) = self.linearized(observations, &weights, &priors)?;
        let evidence = self.ln_marginal_likelihood_twice(&reduced, &priors);
        let stepped = self.model.stepped(&layout, &equations.step(&reduced));
        let cost = |model: &Model, residuals: &[Vec<Option<Vector2<f64>>>]| {
            objective::cost_of_residuals(residuals, model, observations, &weights, &priors)
        };
        let residuals = objective::residuals(&stepped, observations, &self.bases);
        if cost(&stepped, &residuals) < cost(&self.model, &self.residuals) {
            self.model = stepped;
            self.residuals = residuals;
        } else {
            self.adjust(observations, RETRY);
        }
        self.update_smoothness(&layout, &reduced, observations);
        Ok(evidence)
    }

    /// The equations where the fit stands, factorized without damping.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn equations(
        &mut self,
        observations: &Observations,
    ) -> Result<(Layout, NormalEquations, SchurComplement), EstimateError> {
        let weights = self.reweight(observations);
        self.linearized(observations, &weights, &self.priors())
    }

    fn linearized(
        &self,
        observations: &Observations,
        weights: &Weights,
        priors: &Priors,
    ) -> Result<(Layout, NormalEquations, SchurComplement), EstimateError> {
        let layout = self.model.layout();
        let equations = NormalEquations::assemble(
            &self.model,
            &layout,
            observations,
            &self.bases,
            weights,
            priors,
        );
        let reduced = equations.reduce(0.0).ok_or(EstimateError::Singular {
            free: layout.global_len,
            corner_count: observations.corner_count(),
        })?;
        Ok((layout, equations, reduced))
    }

    fn update_smoothness(
        &mut self,
        layout: &Layout,
        reduced: &SchurComplement,
        observations: &Observations,
    ) {
        self.smoothness.update(&self.model, layout, reduced);
        let (effective, held) = self.smoothness.effective(&self.model);
        let splines: usize = self
            .model
            .cameras
            .iter()
            .map(|camera| camera.spline_amounts().len())
            .sum();
        let free = layout.global_len + splines - held;
        // What is known beforehand uses nothing up.
        let known = self.model.known_poses.iter().flatten().count();
        let open_poses = observations.poses.len() - known.min(observations.poses.len());
        self.effective_parameters = free as f64 + effective + 6.0 * open_poses as f64;
    }

    /// Log likelihood of the residuals under the distribution found.
    pub fn log_likelihood(&self) -> f64 {
        let squared = self
            .residuals
            .iter()
            .flatten()
            .map(|residual| residual.map_or(f64::INFINITY, |r| r.norm_squared()));
        squared.map(|s| self.noise.log_density(s)).sum()
    }

    /// Measures how alike neighboring corners err and lets them count accordingly from now on.
    pub fn measure_correlation(&mut self, observations: &Observations) -> f64 {
        let correlation =
            neighbor_correlation(&self.residuals, observations, &self.noise).unwrap_or(0.0);
        self.share = effective_share(correlation);
        correlation
    }

    /// Twice the logarithm of the evidence, up to a constant that all models of the same data
    /// share (METHOD 2.4): likelihood of the residuals under their own distribution, with the
    /// effective number of corners, plus priors, minus what the parameters could have been.
    pub fn ln_marginal_likelihood_twice(&self, reduced: &SchurComplement, priors: &Priors) -> f64 {
        self.share * 2.0 * self.log_likelihood() - priors.cost(&self.model)
            + self.smoothness.ln_prior_determinant(&self.model)
            - reduced.ln_determinant()
    }
}
