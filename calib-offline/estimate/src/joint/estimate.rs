//! The estimate from start to end.

use super::choice::{self, Candidate, Choice, Chosen};
use super::error::EstimateError;
use super::evidence::{Smoothness, SmoothnessFound};
use super::fit::{Fit, LAST};
use super::pinhole_lens::are_pinholes;
use super::pinholes::among_pinholes;
use super::places::weighted_by_places;
use super::rebase::rebase;
use crate::adjust::levenberg::Settings;
use crate::adjust::robust::{StudentT, relative_weights};
use crate::adjust::{CameraModel, Model, Observations, StopReason};
use crate::init::rig::RigStart;
use calib_rays::field::polynomial::term_count;
use calib_rays::field::structured::StructuredBasis;
use nalgebra::Vector2;

/// Total degree of the field's polynomial (METHOD 2.1, 9A).
const DEGREE: usize = 7;
/// Adjustments with structured directions only, so many and each to such a precision: what they
/// leave is far below what the rounds after them change. Two or three steps each, more where boards
/// hardly tilt.
const STRUCTURED_ROUNDS: usize = 3;
const STRUCTURED: Settings = Settings {
    max_iterations: 30,
    relative_decrease: 1e-4,
};
/// How often the base lenses are fitted anew.
const BASE_ROUNDS: usize = 2;
/// Last adjustments, each with residuals taken where the one before sees the corners.
const ANCHORS: usize = 2;

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
    /// Share of the corners that counts as independent because of it, 0 to 1.
    pub effective_share: f64,
    /// Smoothness per camera and family.
    pub smoothness: Vec<SmoothnessFound>,
    /// What the evidence decided.
    pub choices: Vec<Choice>,
    /// Objective after each accepted step of the last adjustment.
    pub costs: Vec<f64>,
    /// Why the last adjustment ended.
    pub stop: StopReason,
    /// What offsets would have gained where some cameras are declared to have none.
    pub forbidden: Option<Forbidden>,
    /// The fit behind it all.
    pub(crate) fit: Fit,
}

/// A model with offsets for all cameras, of which some are declared to have none.
#[derive(Debug, Clone)]
pub struct Forbidden {
    /// Twice the log evidence that it would gain.
    pub gain: f64,
    /// The fit.
    pub(crate) fit: Box<Fit>,
}

/// Estimates everything from a start.
///
/// # Errors
/// [`EstimateError::Singular`] if the data leave a parameter open.
pub fn estimate(observations: &Observations, start: &RigStart) -> Result<Estimate, EstimateError> {
    let mut observations =
        observations.with_pose_indices(|pose_idx| start.rig_from_board[pose_idx].is_some());
    let model = starting_model(start, &observations);

    // What every lens may use, then where its center of distortion is.
    let smoothness = Smoothness::structured_only(&model);
    let mut fit = Fit::new(model, smoothness, &observations);
    fit.rejects = false;
    for _ in 0..STRUCTURED_ROUNDS {
        fit.adjust(&observations, STRUCTURED);
    }
    let ideal = fit.clone();
    for _ in 0..BASE_ROUNDS {
        fit = fit.changed(&observations, |model| rebase(model, &observations));
        fit.adjust(&observations, STRUCTURED);
    }
    if let Some(weighted) = weighted_by_places(&observations, &fit) {
        observations = weighted;
        fit = fit.on(&observations);
        fit.adjust(&observations, STRUCTURED);
    }
    fit.smoothness = Smoothness::new(&fit.model);
    fit.rejects = true;

    // What the evidence asks for beyond, first as if corners were independent: only a field that
    // fits shows how much they are not.
    let settled = Candidate::settle(fit, f64::NEG_INFINITY, &observations)?;
    let Chosen {
        mut best,
        tried: mut choices,
        mut forbidden,
    } = choice::choose(settled, Some(&ideal), &observations);
    let correlation = best.fit.measure_correlation(&observations);
    if best.fit.share < 1.0 {
        best = Candidate::settle(best.fit, f64::NEG_INFINITY, &observations)?;
        best = choice::simplify(best, &mut choices, &observations);
        forbidden = forbidden.and_then(|mut candidate| {
            candidate.fit.share = best.fit.share;
            Candidate::settle(candidate.fit, f64::NEG_INFINITY, &observations).ok()
        });
    }
    let forbidden = forbidden.map(|candidate| Forbidden {
        gain: candidate.evidence - best.evidence,
        fit: Box::new(candidate.fit),
    });
    let fit = anchored(best.fit, &observations);
    Ok(Estimate {
        forbidden,
        ..finish(fit, observations, correlation, choices)
    })
}

/// The last adjustments of a fit, with residuals taken where it sees the corners.
pub(super) fn anchored(mut fit: Fit, observations: &Observations) -> Fit {
    for _ in 0..ANCHORS {
        let anchored = observations.anchored(fit.residuals());
        fit = fit.on(&anchored);
        if are_pinholes(&fit.model) {
            fit = among_pinholes(&fit, &anchored).unwrap_or(fit);
        }
        fit.adjust(&anchored, LAST);
    }
    fit.on(observations)
}

fn starting_model(start: &RigStart, observations: &Observations) -> Model {
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
                offset_basis: None,
                camera_from_rig: *camera_from_rig,
            }
        })
        .collect();
    Model {
        cameras,
        rig_from_board: start.rig_from_board.iter().flatten().copied().collect(),
        known_poses: observations.known_of_poses(),
        board_shape: start.observations.board.unknown_shape(),
    }
}

/// What a fit that is as good as it gets says.
pub(super) fn finish(
    fit: Fit,
    observations: Observations,
    neighbor_correlation: f64,
    choices: Vec<Choice>,
) -> Estimate {
    let residuals = fit.residuals().to_vec();
    let robust_weights = relative_weights(&residuals, &observations, &fit.noise);
    Estimate {
        smoothness: fit.smoothness.found(&fit.model),
        model: fit.model.clone(),
        observations,
        residuals,
        robust_weights,
        noise: fit.noise,
        neighbor_correlation,
        effective_share: fit.share,
        choices,
        forbidden: None,
        costs: fit.costs.clone(),
        stop: fit.stop,
        fit,
    }
}
