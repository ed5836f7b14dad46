//! The estimate from start to end: rounds of re-weighting, adjustment and evidence.

use super::evidence::{Smoothness, SmoothnessFound, effective_share, neighbor_correlation};
use crate::adjust::levenberg::{self, Settings, StopReason};
use crate::adjust::normal_equations::{self, NormalEquations};
use crate::adjust::observations::ViewBasis;
use crate::adjust::robust::{StudentT, reweight};
use crate::adjust::{CameraModel, Model, Observations};
use crate::board::BoardShape;
use crate::field::polynomial::term_count;
use crate::field::structured::{RadialProfile, StructuredBasis};
use crate::init::rig::RigStart;
use nalgebra::Vector2;

/// Total degree of the field's polynomial (METHOD 9A).
const DEGREE: usize = 7;
/// Standard deviation of each coefficient of the board's shape before anything is seen, mm.
const BOARD_SHAPE_SD_MM: f64 = 0.1;
/// Rounds with structured directions only, with all directions, and with correlated corners.
const ROUNDS: [usize; 3] = [3, 6, 5];
/// Linearizations within a round.
const STEPS_PER_ROUND: usize = 3;

/// The result of the joint estimate.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// Fields, extrinsics, poses and board shape; the rig frame is that of camera 0.
    pub model: Model,
    /// What went in; poses that no camera could place are not in it.
    pub observations: Observations,
    /// Observed minus predicted, px, per view and corner; `None` behind the camera.
    pub residuals: Vec<Vec<Option<Vector2<f64>>>>,
    /// Robust weight per view and corner, 0 for a rejected one.
    pub robust_weights: Vec<Vec<f64>>,
    /// Distribution of the residuals.
    pub noise: StudentT,
    /// Correlation of neighboring corners' residuals.
    pub neighbor_correlation: f64,
    /// Smoothness per camera and degree.
    pub smoothness: Vec<SmoothnessFound>,
    /// Objective after each accepted step of the last adjustment.
    pub costs: Vec<f64>,
    /// Why the last adjustment ended.
    pub stop: StopReason,
}

/// Why there is no estimate.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// The normal equations are singular.
    #[error("the corners do not determine the cameras: {free} parameters, {corner_count} corners")]
    Singular {
        /// Number of global parameters.
        free: usize,
        /// Number of corners.
        corner_count: usize,
    },
}

/// The estimate in progress.
struct State {
    model: Model,
    observations: Observations,
    bases: Vec<ViewBasis>,
    smoothness: Smoothness,
    /// Share of corners that count as independent.
    share: f64,
    /// Number of parameters that the data determine, for the noise's degrees of freedom.
    effective_parameters: f64,
    noise: StudentT,
    costs: Vec<f64>,
    stop: StopReason,
}

/// Estimates everything from a start.
///
/// # Errors
/// [`EstimateError::Singular`] if the data leave a parameter open.
pub fn estimate(observations: &Observations, start: &RigStart) -> Result<Estimate, EstimateError> {
    let placed: Vec<usize> = observations
        .poses
        .iter()
        .zip(&start.rig_from_board)
        .filter(|(_, pose)| pose.is_some())
        .map(|(pose, _)| *pose)
        .collect();
    let observations = observations.with_poses(|pose| placed.contains(&pose));
    let cameras = start
        .fields
        .iter()
        .zip(&start.camera_from_rig)
        .map(|(field, camera_from_rig)| {
            let mut field = field.clone();
            let polynomial = &mut field.direction.polynomial;
            polynomial.degree = DEGREE;
            // Lower degrees come first, so a longer polynomial is the same one.
            polynomial
                .coefficients
                .resize(term_count(DEGREE), Vector2::zeros());
            CameraModel {
                basis: StructuredBasis::new(field.sensor, DEGREE, None),
                field,
                camera_from_rig: *camera_from_rig,
            }
        })
        .collect();
    let model = Model {
        cameras,
        rig_from_board: start.rig_from_board.iter().flatten().copied().collect(),
        board_shape: BoardShape::flat_of_degree_two(),
    };
    let bases = model.view_bases(&observations);
    let mut state = State {
        smoothness: Smoothness::structured_only(&model),
        model,
        observations,
        bases,
        share: 1.0,
        effective_parameters: 0.0,
        noise: StudentT {
            freedom: 4.0,
            variance_px2: 1.0,
        },
        costs: Vec::new(),
        stop: StopReason::IterationLimit,
    };
    for _ in 0..ROUNDS[0] {
        state.round(STEPS_PER_ROUND);
    }
    state.free_center_of_distortion();
    state.smoothness = Smoothness::new(&state.model);
    for _ in 0..ROUNDS[1] {
        state.round(STEPS_PER_ROUND);
        state.update_evidence()?;
    }
    let correlation = state.correlation();
    state.share = effective_share(correlation);
    for _ in 0..ROUNDS[2] {
        state.round(STEPS_PER_ROUND);
        state.update_evidence()?;
    }
    state.round(30);
    Ok(state.finish(correlation))
}

impl State {
    fn board_prior() -> f64 {
        1.0 / (BOARD_SHAPE_SD_MM * BOARD_SHAPE_SD_MM)
    }

    fn weights(&mut self) -> normal_equations::Weights {
        let residuals = normal_equations::residuals(&self.model, &self.observations, &self.bases);
        let numbers = 2.0 * self.observations.corner_count() as f64;
        // The residuals of a fit are smaller than the noise by the parameters that it used up.
        let freedom = (1.0 - self.effective_parameters / numbers).max(0.1);
        let (noise, weights) = reweight(&residuals, &self.observations, self.share * freedom);
        self.noise = StudentT {
            variance_px2: noise.variance_px2 / freedom,
            ..noise
        };
        weights
    }

    /// New weights, then an adjustment with them.
    fn round(&mut self, max_iterations: usize) {
        let weights = self.weights();
        let priors = self.smoothness.priors(&self.model, Self::board_prior());
        let outcome = levenberg::minimize(
            self.model.clone(),
            &self.observations,
            &self.bases,
            &weights,
            &priors,
            Settings {
                max_iterations,
                ..Settings::default()
            },
        );
        self.model = outcome.model;
        self.costs = outcome.costs;
        self.stop = outcome.stop;
    }

    /// Lets the center of the radial mapping move freely, now that the mapping is known.
    fn free_center_of_distortion(&mut self) {
        for camera in &mut self.model.cameras {
            let field = &camera.field;
            let profile = RadialProfile::of(field.sensor, field.base, &field.direction.polynomial);
            camera.basis = StructuredBasis::new(field.sensor, DEGREE, Some(&profile));
        }
    }

    fn update_evidence(&mut self) -> Result<(), EstimateError> {
        let layout = self.model.layout();
        let weights = self.weights();
        let priors = self.smoothness.priors(&self.model, Self::board_prior());
        let reduced = NormalEquations::assemble(
            &self.model,
            &layout,
            &self.observations,
            &self.bases,
            &weights,
            &priors,
        )
        .reduce(0.0)
        .ok_or(EstimateError::Singular {
            free: layout.global_len,
            corner_count: self.observations.corner_count(),
        })?;
        let smooth = self
            .smoothness
            .update(&self.model, &layout, &reduced.global_covariance());
        let penalized: usize = priors
            .cameras
            .iter()
            .map(|c| c.direction.iter().filter(|w| **w > 0.0).count())
            .sum();
        self.effective_parameters = (layout.global_len - penalized) as f64
            + smooth
            + 6.0 * self.observations.poses.len() as f64;
        Ok(())
    }

    fn correlation(&self) -> f64 {
        let residuals = normal_equations::residuals(&self.model, &self.observations, &self.bases);
        neighbor_correlation(&residuals, &self.observations, &self.noise).unwrap_or(0.0)
    }

    fn finish(self, neighbor_correlation: f64) -> Estimate {
        let residuals = normal_equations::residuals(&self.model, &self.observations, &self.bases);
        let robust_weights = residuals
            .iter()
            .zip(&self.observations.views)
            .map(|(residuals, view)| {
                residuals
                    .iter()
                    .zip(&view.corners)
                    .map(|(residual, corner)| {
                        let squared = residual.map(|r| r.norm_squared() * corner.relative_weight);
                        // The largest weight of the distribution is (nu + 2) / nu, at zero.
                        squared.map_or(0.0, |s| self.noise.weight(s) / self.noise.weight(0.0))
                    })
                    .collect()
            })
            .collect();
        Estimate {
            smoothness: self.smoothness.found(),
            model: self.model,
            observations: self.observations,
            residuals,
            robust_weights,
            noise: self.noise,
            neighbor_correlation,
            costs: self.costs,
            stop: self.stop,
        }
    }
}
