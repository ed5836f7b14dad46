//! What is known of the parameters beforehand: smoothness, and what is plausible. As densities they
//! are Gaussian priors, as terms of the objective they are its regularization (METHOD 2.3).

use super::equations::knots::thin_plate;
use super::model::{CameraModel, Model};
use calib_rays::numerics::banded::BandedMatrix;
use nalgebra::DVector;
use std::sync::Arc;

/// Inverse variances of the parameters that smoothness or plausibility holds back.
#[derive(Debug, Clone)]
pub struct Priors {
    /// Per camera.
    pub cameras: Vec<CameraPriors>,
    /// Of each coefficient of the board's shape, 1/mm^2.
    pub board: f64,
}

/// Priors of one camera.
#[derive(Debug, Clone)]
pub struct CameraPriors {
    /// Per amount of the direction's polynomial, 1/rad^2; 0 for a free direction.
    pub direction: DVector<f64>,
    /// Per amount of the offset's polynomial, 1/mm^2; empty for a central camera.
    pub offset: DVector<f64>,
    /// Weight of the spline's thin-plate energy, 1/rad^2.
    pub spline: f64,
    /// That energy; `None` without a spline.
    pub thin_plate: Option<Arc<BandedMatrix>>,
}

impl CameraPriors {
    /// No prior on the polynomials, nothing for the spline yet.
    pub fn free(camera: &CameraModel) -> Self {
        let thin_plate = camera
            .knot_order()
            .map(|order| Arc::new(thin_plate(&order)));
        Self::with_energy(camera, thin_plate)
    }

    /// The same, given the energy of the camera's spline.
    pub fn with_energy(camera: &CameraModel, thin_plate: Option<Arc<BandedMatrix>>) -> Self {
        Self {
            direction: DVector::zeros(camera.basis.len()),
            offset: DVector::zeros(camera.offset_amounts().len()),
            spline: 0.0,
            thin_plate,
        }
    }

    fn cost(&self, camera: &CameraModel) -> f64 {
        let weighted = |amounts: &DVector<f64>, weights: &DVector<f64>| -> f64 {
            amounts
                .iter()
                .zip(weights.iter())
                .map(|(a, w)| w * a * a)
                .sum()
        };
        let amounts = camera.basis.amounts(&camera.field.direction.polynomial);
        let spline = self.thin_plate.as_ref().map_or(0.0, |energy| {
            let amounts = camera.spline_amounts();
            self.spline * energy.times(&amounts).dot(&amounts)
        });
        weighted(&amounts, &self.direction)
            + weighted(&camera.offset_amounts(), &self.offset)
            + spline
    }
}

impl Priors {
    /// What the priors add to the objective.
    pub fn cost(&self, model: &Model) -> f64 {
        let cameras: f64 = model
            .cameras
            .iter()
            .zip(&self.cameras)
            .map(|(camera, priors)| priors.cost(camera))
            .sum();
        let board: f64 = model.board_shape.terms.iter().map(|t| t.2 * t.2).sum();
        cameras + self.board * board
    }
}
