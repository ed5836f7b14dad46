//! Parts of boards that fit in several places: the views already settled decide.

use super::super::epipolar::{FundamentalMatrix, Match};
use super::super::labelling::Placement;
use super::{CLEAR_MARGIN_RAD, EPIPOLAR_POSES, MIN_SHARED, Settling, nearest_turn};

/// A part of a board is placed by a score (distance in squares) if the best is below this, ...
const SCORE_SQUARES: f64 = 0.3;
/// ... and the others are worse by at least this.
const SCORE_MARGIN_SQUARES: f64 = 0.3;

impl Settling<'_> {
    /// Places parts of boards that fit in several places, by the views already settled.
    pub(super) fn place_parts(&mut self) {
        loop {
            let mut settled_one = false;
            for k in 0..self.views.len() {
                if self.chosen[k].is_none() && !self.views[k].placements.is_empty() {
                    self.chosen[k] = self.placed_part(k);
                    settled_one |= self.chosen[k].is_some();
                }
            }
            if !settled_one {
                return;
            }
        }
    }

    fn placed_part(&self, k: usize) -> Option<Placement> {
        let view = &self.views[k];
        let square_px = view.grid.square_px()?;
        let mut candidates = self.with_clear_turn(k);
        let epipolar = self.epipolar_scores(k, &candidates);
        if !epipolar.is_empty() {
            candidates = leading(&epipolar, square_px);
        }
        if let ([only], false) = (candidates.as_slice(), epipolar.is_empty()) {
            return Some(*only);
        }
        let neighbor = self
            .nearest_settled(view.camera_idx, view.pose)
            .filter(|&n| self.same_stage_placement(self.views[n].pose, view.pose))?;
        let moved = |placement: &Placement| {
            let matches = self.matches(neighbor, k, placement);
            let sum: f64 = matches.iter().map(|(a, b)| a.distance_px(*b)).sum();
            (matches.len() >= MIN_SHARED).then(|| sum / matches.len() as f64)
        };
        let scores: Vec<(f64, Placement)> = candidates
            .iter()
            .map(|p| (moved(p).unwrap_or(f64::INFINITY), *p))
            .collect();
        match leading(&scores, square_px).as_slice() {
            [only] => Some(*only),
            _ => None,
        }
    }

    /// The placements whose turn agrees with the nearest settled view, if that is clear.
    fn with_clear_turn(&self, k: usize) -> Vec<Placement> {
        let view = &self.views[k];
        let neighbor = self.nearest_settled(view.camera_idx, view.pose);
        let reference = neighbor.and_then(|n| self.chosen_angle(n));
        let clear = reference
            .and_then(|reference| nearest_turn(view, reference))
            .filter(|choice| choice.margin_rad >= CLEAR_MARGIN_RAD);
        let agrees = |p: &&Placement| {
            clear.is_none_or(|choice| p.quarter_turns == choice.placement.quarter_turns)
        };
        view.placements.iter().filter(agrees).copied().collect()
    }

    /// Median epipolar distance of each placement against the same pose in another camera; empty
    /// if no other camera can tell.
    fn epipolar_scores(&self, k: usize, candidates: &[Placement]) -> Vec<(f64, Placement)> {
        let view = &self.views[k];
        for other_camera in 0..self
            .views
            .iter()
            .map(|v| v.camera_idx + 1)
            .max()
            .unwrap_or(0)
        {
            let Some(other) = self.view_at(other_camera, view.pose) else {
                continue;
            };
            if other_camera == view.camera_idx {
                continue;
            }
            let (matches, pose_count) = self.settled_matches(other_camera, view.camera_idx);
            let fundamental = FundamentalMatrix::from_matches(&matches);
            let Some(fundamental) = fundamental.filter(|_| pose_count > EPIPOLAR_POSES) else {
                continue;
            };
            let score = |placement: &Placement| {
                let matches = self.matches(other, k, placement);
                let median = fundamental.median_distance_px(&matches);
                median
                    .filter(|_| matches.len() >= MIN_SHARED)
                    .unwrap_or(f64::INFINITY)
            };
            return candidates.iter().map(|p| (score(p), *p)).collect();
        }
        Vec::new()
    }

    /// Matches of all poses that are settled in both cameras, and the number of poses.
    fn settled_matches(&self, first: usize, second: usize) -> (Vec<Match>, usize) {
        let mut matches = Vec::new();
        let mut pose_count = 0;
        for k in 0..self.views.len() {
            if let (true, Some(placement), Some(other)) = (
                self.views[k].camera_idx == second,
                self.chosen[k],
                self.view_at(first, self.views[k].pose),
            ) {
                matches.extend(self.matches(other, k, &placement));
                pose_count += 1;
            }
        }
        (matches, pose_count)
    }
}

/// The placements whose score is near the best, if the best is good.
fn leading(scores: &[(f64, Placement)], square_px: f64) -> Vec<Placement> {
    let best = scores.iter().map(|s| s.0).fold(f64::INFINITY, f64::min);
    if best > SCORE_SQUARES * square_px {
        return Vec::new();
    }
    scores
        .iter()
        .filter(|s| s.0 < best + SCORE_MARGIN_SQUARES * square_px)
        .map(|s| s.1)
        .collect()
}
