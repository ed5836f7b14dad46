//! What is known of the parameters beforehand: smoothness, and what is plausible. As densities they
//! are Gaussian priors, as terms of the objective they are its regularization (METHOD 2.3).

use super::equations::knots::thin_plate;
use super::model::{CameraModel, Model};
use calib_rays::geometry::so3;
use calib_rays::numerics::banded::BandedMatrix;
use nalgebra::{DVector, Vector6};
use std::sync::Arc;

/// Inverse variances of the parameters that smoothness or plausibility holds back.
#[derive(Debug, Clone)]
pub struct Priors {
    /// Per camera.
    pub cameras: Vec<CameraPriors>,
    /// Of each coefficient of the board's shape, 1/mm^2.
    pub board: f64,
}

/// A pose that counts as exact is known so well: nothing that is measured tells it from one that is.
const EXACT_MM: f64 = 1e-5;
const EXACT_RAD: f64 = 1e-8;

/// How far a pose is from where it is known to be.
#[derive(Debug, Clone, Copy)]
pub struct FromKnown {
    /// By the step of a pose: rotation vector (rad), translation (mm).
    pub change: Vector6<f64>,
    /// Inverse variance of each.
    pub weight: Vector6<f64>,
}

impl FromKnown {
    fn cost(&self) -> f64 {
        self.change.map(|x| x * x).dot(&self.weight)
    }
}

/// The poses of a model that are known beforehand, by index.
pub fn known_poses(model: &Model) -> impl Iterator<Item = (usize, FromKnown)> + '_ {
    let poses = model.rig_from_board.iter().zip(&model.known_poses);
    poses.enumerate().filter_map(|(pose_idx, (pose, known))| {
        let known = known.as_ref()?;
        let at = &known.rig_from_board;
        let turned = so3::log(&(pose.rotation * at.rotation.transpose()));
        let moved = pose.translation_mm - at.translation_mm;
        let rad = known.sigma_rad.max(EXACT_RAD).powi(-2);
        let mm = known.sigma_mm.max(EXACT_MM).powi(-2);
        Some((
            pose_idx,
            FromKnown {
                change: Vector6::new(turned.x, turned.y, turned.z, moved.x, moved.y, moved.z),
                weight: Vector6::new(rad, rad, rad, mm, mm, mm),
            },
        ))
    })
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
        let poses: f64 = known_poses(model).map(|(_, known)| known.cost()).sum();
        cameras + self.board * board + poses
    }
}
