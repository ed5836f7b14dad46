//! How strongly smoothness holds and how much a corner counts, from the data themselves.

use crate::adjust::model::Layout;
use crate::adjust::normal_equations::{CameraPriors, Priors};
use crate::adjust::robust::StudentT;
use crate::adjust::{Model, Observations};
use nalgebra::{DMatrix, Vector2};
use std::collections::HashMap;

/// Smoothness weight at the start, 1/rad^2: directions may move by 1e-3 rad.
const START_PRECISION: f64 = 1e6;
/// Beyond this a direction is held to round-off and a larger weight changes nothing.
const MOST_PRECISION: f64 = 1e14;
/// Longest step of a weight's logarithm in one update.
const LONGEST_LOG_STEP: f64 = 7.0;
/// Steps grow by this factor as long as they keep their sign: plain updates creep when a weight
/// wants to be infinite.
const STEP_GROWTH: f64 = 1.6;
const MOST_GROWTH: f64 = 5.0;
/// Least effective share of corners, however alike neighbors err.
const LEAST_EFFECTIVE_SHARE: f64 = 1.0 / 25.0;

/// The smoothness weights of all cameras: one per camera and degree.
#[derive(Debug, Clone)]
pub struct Smoothness {
    groups: Vec<Group>,
}

/// The directions of one camera and one degree beyond the structured ones.
#[derive(Debug, Clone)]
struct Group {
    camera_idx: usize,
    degree: usize,
    members: Vec<usize>,
    precision: f64,
    last_log_step: f64,
    growth: f64,
    effective: f64,
}

/// What the evidence found for one group.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothnessFound {
    /// Index of the camera.
    pub camera_idx: usize,
    /// Total degree of the directions.
    pub degree: usize,
    /// Number of directions.
    pub directions: usize,
    /// Of these, how many the data determine.
    pub effective: f64,
    /// Inverse variance of a direction's amount, 1/rad^2.
    pub precision: f64,
}

impl Smoothness {
    /// The weights at their start, for the bases of the model's cameras.
    pub fn new(model: &Model) -> Self {
        let mut groups: Vec<Group> = Vec::new();
        for (camera_idx, camera) in model.cameras.iter().enumerate() {
            for (direction, degree) in camera.basis.penalized_degrees().iter().enumerate() {
                let Some(degree) = *degree else { continue };
                let existing = groups
                    .iter_mut()
                    .find(|g| g.camera_idx == camera_idx && g.degree == degree);
                match existing {
                    Some(group) => group.members.push(direction),
                    None => groups.push(Group {
                        camera_idx,
                        degree,
                        members: vec![direction],
                        precision: START_PRECISION,
                        last_log_step: 0.0,
                        growth: 1.0,
                        effective: 0.0,
                    }),
                }
            }
        }
        Self { groups }
    }

    /// The same with every weight so large that only structured directions move.
    pub fn structured_only(model: &Model) -> Self {
        let mut smoothness = Self::new(model);
        for group in &mut smoothness.groups {
            group.precision = MOST_PRECISION;
        }
        smoothness
    }

    /// As priors of an adjustment.
    pub fn priors(&self, model: &Model, board: f64) -> Priors {
        let mut cameras: Vec<_> = model.cameras.iter().map(CameraPriors::free).collect();
        for group in &self.groups {
            for member in &group.members {
                cameras[group.camera_idx].direction[*member] = group.precision;
            }
        }
        Priors { cameras, board }
    }

    /// One fixed-point step of every weight (MacKay): `lambda <- gamma / |a|^2` with
    /// `gamma = dim - lambda tr(covariance)`, the number of directions that the data determine.
    /// Returns the sum of all gamma.
    pub fn update(&mut self, model: &Model, layout: &Layout, covariance: &DMatrix<f64>) -> f64 {
        let mut total = 0.0;
        for group in &mut self.groups {
            let camera = &model.cameras[group.camera_idx];
            let amounts = camera.basis.amounts(&camera.field.direction.polynomial);
            let offset = layout.cameras[group.camera_idx].direction.start;
            let trace: f64 = group
                .members
                .iter()
                .map(|k| covariance[(offset + k, offset + k)])
                .sum();
            let squared: f64 = group.members.iter().map(|k| amounts[*k].powi(2)).sum();
            let dimension = group.members.len() as f64;
            group.effective =
                (dimension - group.precision * trace).clamp(1e-6 * dimension, dimension);
            total += group.effective;
            let wanted = (group.effective / squared.max(f64::MIN_POSITIVE)).min(MOST_PRECISION);
            let log_step = (wanted / group.precision).ln();
            group.growth = if log_step * group.last_log_step > 0.0 {
                (group.growth * STEP_GROWTH).min(MOST_GROWTH)
            } else {
                1.0
            };
            group.last_log_step = log_step;
            let taken = (log_step * group.growth).clamp(-LONGEST_LOG_STEP, LONGEST_LOG_STEP);
            group.precision = (group.precision * taken.exp()).min(MOST_PRECISION);
        }
        total
    }

    /// What was found, per camera and degree.
    pub fn found(&self) -> Vec<SmoothnessFound> {
        self.groups
            .iter()
            .map(|group| SmoothnessFound {
                camera_idx: group.camera_idx,
                degree: group.degree,
                directions: group.members.len(),
                effective: group.effective,
                precision: group.precision,
            })
            .collect()
    }
}

/// Correlation of the residuals of neighboring corners within a view, over both board directions,
/// robustly weighted; `None` if no two neighbors were seen.
///
/// Real boards and detectors err alike at neighboring corners (0.25 to 0.7 on real sets); simulated
/// noise does not (METHOD 9A). It must be measured after the field is flexible, so that misfit of
/// the field does not count.
pub fn neighbor_correlation(
    residuals: &[Vec<Option<Vector2<f64>>>],
    observations: &Observations,
    noise: &StudentT,
) -> Option<f64> {
    let (mut product, mut power) = (0.0, 0.0);
    for (view, residuals) in observations.views.iter().zip(residuals) {
        let by_label: HashMap<(usize, usize), Vector2<f64>> = view
            .corners
            .iter()
            .zip(residuals)
            .filter_map(|(corner, residual)| Some(((corner.row, corner.col), (*residual)?)))
            .collect();
        for corner in &view.corners {
            let Some(here) = by_label.get(&(corner.row, corner.col)) else {
                continue;
            };
            for neighbor in [(corner.row + 1, corner.col), (corner.row, corner.col + 1)] {
                let Some(there) = by_label.get(&neighbor) else {
                    continue;
                };
                let w1 = noise.weight(here.norm_squared());
                let w2 = noise.weight(there.norm_squared());
                product += (w1 * w2).sqrt() * here.dot(there);
                if w1 * w2 > 0.0 {
                    power += (w1 * here.norm_squared() + w2 * there.norm_squared()) / 2.0;
                }
            }
        }
    }
    (power > 0.0).then(|| product / power)
}

/// The share of corners that count as independent, given the correlation of neighbors:
/// `((1 - rho) / (1 + rho))^2`, one factor per direction of the board.
pub fn effective_share(correlation: f64) -> f64 {
    let rho = correlation.clamp(0.0, 1.0);
    ((1.0 - rho) / (1.0 + rho))
        .powi(2)
        .max(LEAST_EFFECTIVE_SHARE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn independent_corners_all_count_and_alike_ones_hardly() {
        assert_eq!(effective_share(-0.02), 1.0);
        assert!((effective_share(0.5) - 1.0 / 9.0).abs() < 1e-15);
        assert_eq!(effective_share(1.0), LEAST_EFFECTIVE_SHARE);
    }
}
