//! How wide neurons answer: the sweep over spreads (paper section 3.1, Fig. 7), and the choice.
//!
//! The publication raises the spread until the error falls no further, at 5000 to 7000 px, and takes
//! 6000. That is the flat limit: neurons much wider than the board are all alike, and what double
//! precision leaves of them is a polynomial of fourth degree, whatever the spread. A lens that is
//! rougher than that shows in the error of corners left out at spreads of the board's own size, which
//! the sweep of the publication does not reach; here the sweep goes down to where the neurons no
//! longer cover the gaps between corners, and the least error left out decides.

use super::plane_map::{MIN_CORNERS, NetworkSettings, TrainingSet, errors_mm};
use crate::adjust::observations::{ObservedCorner, ViewBlock};
use calib_rays::numerics::median;
use calib_rays::numerics::rms;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One corner in so many is left out.
const FOLDS: usize = 5;
/// Fewest corners of a view whose network can be tested: without a fold of them [`MIN_CORNERS`] are
/// left.
pub const MIN_TESTED_CORNERS: usize = (MIN_CORNERS * FOLDS).div_ceil(FOLDS - 1);
/// Candidates of [`choose`]: spreads as shares of the median distance of a corner from the middle of
/// its board's image, from neighbors to the flat limit.
const SHARES: [f64; 17] = [
    0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.5, 8.0, 11.0, 16.0, 24.0,
];
/// Views that the choice looks at, at most: an even draw from all.
const VIEWS: usize = 12;

/// Errors of the networks of one spread, all views together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpreadError {
    /// The spread, px.
    pub spread_px: f64,
    /// RMS error at the corners trained on, mm.
    pub training_rms_mm: f64,
    /// RMS error at corners left out of the training, mm. Each corner is left out once; those on the
    /// border of the board are then extrapolated, which no pixel of a map ever is: they do not count.
    pub left_out_rms_mm: f64,
}

/// A sweep and what was chosen from it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpreadChoice {
    /// The spread taken, px.
    pub spread_px: f64,
    /// What was tried, in rising order; empty if the spread was given.
    pub tried: Vec<SpreadError>,
}

/// Errors at the given spreads; that of the settings is not used. A spread at which no network can be trained is left out.
///
/// Cost: a truncated decomposition per view and spread, and four fifths of one for each fold; the
/// distances between corners and neurons are shared by all spreads.
pub fn sweep(
    views: &[&ViewBlock],
    spreads_px: &[f64],
    settings: &NetworkSettings,
) -> Vec<SpreadError> {
    let prepared: Vec<PreparedView> = views
        .par_iter()
        .filter_map(|view| PreparedView::new(&view.corners, settings))
        .collect();
    spreads_px
        .par_iter()
        .filter_map(|spread_px| error_at(&prepared, *spread_px))
        .collect()
}

/// The spread with the least error at corners left out (that of the settings is not used); `None` if no view can be trained on.
pub fn choose(views: &[&ViewBlock], settings: &NetworkSettings) -> Option<SpreadChoice> {
    let step = views.len().div_ceil(VIEWS).max(1);
    let drawn: Vec<&ViewBlock> = views.iter().step_by(step).copied().collect();
    let reach_px = median_reach_px(&drawn)?;
    let spreads = SHARES.map(|share| share * reach_px);
    let tried = sweep(&drawn, &spreads, settings);
    let best = tried
        .iter()
        .min_by(|a, b| a.left_out_rms_mm.total_cmp(&b.left_out_rms_mm))?;
    Some(SpreadChoice {
        spread_px: best.spread_px,
        tried,
    })
}

/// Median distance of a corner from the middle of its view, px.
fn median_reach_px(views: &[&ViewBlock]) -> Option<f64> {
    let reaches = views.iter().flat_map(|view| {
        let count = view.corners.len() as f64;
        let sum = |of: fn(&ObservedCorner) -> f64| view.corners.iter().map(of).sum::<f64>();
        let (u, v) = (sum(|c| c.pixel.u) / count, sum(|c| c.pixel.v) / count);
        view.corners
            .iter()
            .map(move |c| (c.pixel.u - u).hypot(c.pixel.v - v))
    });
    median(reaches).filter(|r| *r > 0.0)
}

/// A view with its corners dealt to folds.
struct PreparedView {
    corners: Vec<ObservedCorner>,
    whole: TrainingSet,
    /// Per fold: what is trained on, and the inner corners left out.
    folds: Vec<(TrainingSet, Vec<ObservedCorner>)>,
}

impl PreparedView {
    fn new(corners: &[ObservedCorner], settings: &NetworkSettings) -> Option<Self> {
        // Folds must train as well.
        if corners.len() < MIN_TESTED_CORNERS {
            return None;
        }
        let is_inner = |corner: &ObservedCorner| {
            let has = |row: Option<usize>, col: Option<usize>| {
                corners
                    .iter()
                    .any(|c| Some(c.row) == row && Some(c.col) == col)
            };
            let (row, col) = (Some(corner.row), Some(corner.col));
            has(corner.row.checked_sub(1), col)
                && has(Some(corner.row + 1), col)
                && has(row, corner.col.checked_sub(1))
                && has(row, Some(corner.col + 1))
        };
        // Two neighbors never share a fold of five.
        let fold_of = |corner: &ObservedCorner| (corner.row * 2 + corner.col) % FOLDS;
        let folds = (0..FOLDS)
            .map(|fold| {
                let (out, kept): (Vec<ObservedCorner>, Vec<ObservedCorner>) =
                    corners.iter().partition(|c| fold_of(c) == fold);
                let scored = out.into_iter().filter(is_inner).collect();
                Some((TrainingSet::new(&kept, settings)?, scored))
            })
            .collect::<Option<Vec<_>>>()?;
        Some(Self {
            corners: corners.to_vec(),
            whole: TrainingSet::new(corners, settings)?,
            folds,
        })
    }
}

fn error_at(views: &[PreparedView], spread_px: f64) -> Option<SpreadError> {
    let (mut training, mut left_out) = (Vec::new(), Vec::new());
    for view in views {
        let network = view.whole.train(spread_px)?;
        training.extend(errors_mm(&network, &view.corners));
        for (set, scored) in &view.folds {
            left_out.extend(errors_mm(&set.train(spread_px)?, scored));
        }
    }
    Some(SpreadError {
        spread_px,
        training_rms_mm: rms(&training)?,
        left_out_rms_mm: rms(&left_out)?,
    })
}
