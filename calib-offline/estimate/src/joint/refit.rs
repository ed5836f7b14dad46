//! The estimate made again from where it ended, with something changed: cheaper than a new one, as
//! the start is good and the choice of the model is kept.

use super::choice::Candidate;
use super::error::EstimateError;
use super::estimate::{Estimate, finish};
use super::fit::{Fit, LAST};
use super::pinhole_lens::are_pinholes;
use super::pinholes::among_pinholes;
use crate::adjust::{Model, Observations};
use calib_rays::board::BoardShape;

impl Estimate {
    /// The same model from some of the poses only (by their number in the dataset): fields, poses,
    /// extrinsics, board shape, smoothness weights and noise are found again; spline spacing,
    /// which camera is central, and the share of independent corners are kept.
    ///
    /// It starts where this estimate ended, and ends where those poses lead.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if those poses leave a parameter open.
    pub fn of_poses(&self, keep: impl Fn(usize) -> bool) -> Result<Self, EstimateError> {
        let observations = self.observations.with_poses(&keep);
        let kept = || {
            let poses = self.observations.poses.iter().enumerate();
            poses.filter(|(_, pose)| keep(**pose)).map(|(idx, _)| idx)
        };
        let known = |idx: usize| self.model.known_poses.get(idx).copied().flatten();
        let model = Model {
            rig_from_board: kept().map(|idx| self.model.rig_from_board[idx]).collect(),
            known_poses: kept().map(known).collect(),
            ..self.model.clone()
        };
        self.of_part(model, observations)
    }

    /// The same from the points with some labels (row, column) only, of all poses.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if those points leave a parameter open.
    pub fn of_points(&self, keep: impl Fn(usize, usize) -> bool) -> Result<Self, EstimateError> {
        self.of_part(self.model.clone(), self.observations.with_labels(keep))
    }

    /// The same from a part of its own points: `observations` are its own but for corners that are left out.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if those points leave a parameter open.
    pub fn of_part_of_points(&self, observations: Observations) -> Result<Self, EstimateError> {
        self.of_part(self.model.clone(), observations)
    }

    fn of_part(&self, model: Model, observations: Observations) -> Result<Self, EstimateError> {
        let mut fit = Fit::new(model, self.fit.smoothness.clone(), &observations);
        fit.share = self.fit.share;
        let settled = settled(fit, &observations)?;
        Ok(self.remade(settled.fit, observations))
    }

    /// The same with offsets for all cameras, where some are declared to have none.
    pub fn made_non_central(&self) -> Option<Self> {
        let fit = (*self.forbidden.as_ref()?.fit).clone();
        Some(self.remade(fit, self.observations.clone()))
    }

    /// Numbers that the data determine, poses apart.
    pub fn freedom(&self) -> f64 {
        let known = self.model.known_poses.iter().flatten().count();
        self.fit.effective_parameters() - 6.0 * (self.observations.poses.len() - known) as f64
    }

    /// The estimate with another fit, of the same choices.
    pub(crate) fn remade(&self, fit: Fit, observations: Observations) -> Self {
        let choices = self.choices.clone();
        finish(fit, observations, self.neighbor_correlation, choices)
    }

    /// Distance from the board's highest to its lowest corner, mm, and its standard deviation as
    /// far as the terms of the shape are independent.
    ///
    /// Cost: one assembly of the equations.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn board_peak_to_valley_mm(&mut self) -> Result<(f64, f64), EstimateError> {
        let (layout, _, reduced) = self.fit.equations(&self.observations)?;
        let variances = reduced.marginal_variances();
        let board = &self.observations.board;
        let shape: &BoardShape = &self.model.board_shape;
        let heights = (0..board.corner_count()).map(|k| {
            let corner = board.corner_in_board(k / board.cols, k % board.cols);
            (shape.height_mm(board, &corner), corner)
        });
        let heights: Vec<_> = heights.collect();
        let by_height = |a: &&(f64, _), b: &&(f64, _)| a.0.total_cmp(&b.0);
        let (Some((high, peak)), Some((low, valley))) = (
            heights.iter().max_by(by_height),
            heights.iter().min_by(by_height),
        ) else {
            return Ok((0.0, 0.0));
        };
        let differences = shape
            .products(board, peak)
            .zip(shape.products(board, valley))
            .map(|(a, b)| a - b);
        let variance: f64 = differences
            .zip(layout.board)
            .map(|(by_term, k)| by_term * by_term * variances[k])
            .sum();
        Ok((high - low, variance.sqrt()))
    }
}

/// Rounds until the evidence settles, then steps until the fit does.
pub(super) fn settled(fit: Fit, observations: &Observations) -> Result<Candidate, EstimateError> {
    let mut candidate = Candidate::settle(fit, f64::NEG_INFINITY, observations)?;
    if are_pinholes(&candidate.fit.model) {
        let pinholes = among_pinholes(&candidate.fit, observations);
        candidate.fit = pinholes.unwrap_or(candidate.fit);
    }
    candidate.fit.adjust(observations, LAST);
    Ok(candidate)
}
