//! Like with like: residuals of the same corners, by the rig that learned from them and by one that did
//! not, with a pose of its own for each view ("mono") and with one pose for all views of a board
//! ("stereo"). Each ratio has the interval that chance leaves it.

use super::held_out::{Fold, Folds};
use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::{ObservedCorner, ViewBlock};
use calib_estimate::adjust::robust::StudentT;
use calib_estimate::init::board_pose::{residuals_with_free_pose, residuals_with_one_pose};
use calib_estimate::joint::correlation::{effective_share, neighbor_correlation};
use calib_rays::board::BoardShape;
use calib_rays::field::Rig;
use calib_rays::geometry::RigidTransform;
use calib_rays::observed::Corner;
use nalgebra::Vector2;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

/// Standard deviations of the intervals: 999 of 1000 cases lie within.
pub const BY_CHANCE_SD: f64 = 3.29;

/// RMS residual vectors of the same corners, px, and their ratio.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ratio {
    /// What is judged.
    pub rms_px: f64,
    /// What it is judged by.
    pub beside_px: f64,
    /// The first over the second.
    pub ratio: f64,
    /// Where the ratio falls by chance in 999 of 1000 cases.
    pub by_chance: [f64; 2],
}

impl Ratio {
    /// Whether the ratio is larger or smaller than chance leaves it.
    pub fn is_unlikely(&self) -> bool {
        self.ratio < self.by_chance[0] || self.ratio > self.by_chance[1]
    }
}

/// The three comparisons.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Agreement {
    /// Held-out over fitted, a pose for each view.
    pub mono: Option<Ratio>,
    /// Held-out over fitted, a pose for each board that several cameras saw.
    pub stereo: Option<Ratio>,
    /// One pose for all views of a board over one for each, both fitted: whether the cameras agree
    /// about the boards.
    pub cameras: Option<Ratio>,
    /// What is more in the last than chance explains, px RMS.
    pub disagreement_px: f64,
}

/// A calibration, as far as its residuals are compared.
pub struct Whole<'a> {
    /// The cameras.
    pub rig: &'a Rig,
    /// Shape of the board.
    pub board_shape: &'a BoardShape,
    /// All views.
    pub observations: &'a Observations,
    /// Per view and corner: whether it counts.
    pub is_used: &'a [Vec<bool>],
    /// Numbers that the data determine, poses apart.
    pub freedom: f64,
}

/// Sums over corners.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    mono_px2: f64,
    mono_views: f64,
    mono_corners: f64,
    /// Of boards seen by several cameras: with a pose for each view, and with one.
    own_px2: f64,
    one_px2: f64,
    boards: f64,
    pair_views: f64,
    pair_corners: f64,
}

impl Sums {
    fn add(mut self, other: Self) -> Self {
        self.mono_px2 += other.mono_px2;
        self.mono_views += other.mono_views;
        self.mono_corners += other.mono_corners;
        self.own_px2 += other.own_px2;
        self.one_px2 += other.one_px2;
        self.boards += other.boards;
        self.pair_views += other.pair_views;
        self.pair_corners += other.pair_corners;
        self
    }
}

/// Compares folds with the whole, over the corners that both can judge.
///
/// Cost: two resections of every view.
pub fn agreement(whole: &Whole, folds: &Folds) -> Agreement {
    let by_fold: Vec<(Sums, Sums)> = folds
        .estimated
        .par_iter()
        .map(|fold| {
            let unseen = whole.corners_of(fold);
            let held_out = sums(&fold.rig, &fold.board_shape, &unseen);
            (held_out, sums(whole.rig, whole.board_shape, &unseen))
        })
        .collect();
    let (held_out, fitted) = by_fold
        .into_iter()
        .fold((Sums::default(), Sums::default()), |(a, b), (c, d)| {
            (a.add(c), b.add(d))
        });
    let all = sums(whole.rig, whole.board_shape, &whole.used());
    let share = whole.independent_share();
    let count = folds.estimated.len() as f64;
    let numbers = |corners: f64, poses: f64| 2.0 * corners - 6.0 * poses;
    let learned = |held_px2: f64, fitted_px2: f64, corners: f64, poses: f64| {
        let numbers = numbers(corners, poses);
        // Of the whole, the part of the numbers that these corners pay for.
        let freedom = whole.freedom * corners / all.mono_corners.max(1.0);
        let spread = BY_CHANCE_SD * (2.0 * freedom).sqrt();
        let used = (freedom + spread) / share;
        let fitted = (numbers - used).max(1.0);
        let held_out = numbers + used * count / (count - 1.0).max(1.0);
        // Smoothness may hold what the count takes for learned: then both are the noise.
        let by_chance = [
            (1.0 - spread / share / numbers.max(1.0)).max(0.0).sqrt(),
            (held_out / fitted).sqrt(),
        ];
        ratio(held_px2, fitted_px2, corners, by_chance)
    };
    let mono = learned(
        held_out.mono_px2,
        fitted.mono_px2,
        fitted.mono_corners,
        fitted.mono_views,
    );
    let stereo = learned(
        held_out.one_px2,
        fitted.one_px2,
        fitted.pair_corners,
        fitted.boards,
    );
    // Each further view of a board has 6 numbers less if it may not place the board; the cameras'
    // own places were fitted for that.
    let cameras = whole.rig.cameras.len().saturating_sub(1) as f64;
    let more = 6.0 * (all.pair_views - all.boards - cameras);
    let left = numbers(all.pair_corners, all.pair_views) - whole.freedom;
    let expected =
        |z: f64| 1.0 + (more + z * (2.0 * more).max(0.0).sqrt()) / (share * left.max(1.0));
    let by_chance = [-BY_CHANCE_SD, BY_CHANCE_SD].map(|z| expected(z).max(0.0).sqrt());
    let cameras = ratio(all.one_px2, all.own_px2, all.pair_corners, by_chance);
    let excess = all.one_px2 - expected(BY_CHANCE_SD) * all.own_px2;
    Agreement {
        mono: mono.filter(|_| held_out.mono_corners > 0.0),
        stereo,
        cameras: cameras.filter(|_| more > 0.0 && left > 0.0),
        disagreement_px: (excess.max(0.0) / all.pair_corners.max(1.0)).sqrt(),
    }
}

fn ratio(px2: f64, beside_px2: f64, corners: f64, by_chance: [f64; 2]) -> Option<Ratio> {
    let ratio = (px2 / beside_px2).sqrt();
    (corners > 0.0 && ratio.is_finite()).then(|| Ratio {
        rms_px: (px2 / corners).sqrt(),
        beside_px: (beside_px2 / corners).sqrt(),
        ratio,
        by_chance,
    })
}

/// A view of which only some corners count.
struct Seen {
    camera_idx: usize,
    pose_idx: usize,
    corners: Vec<Corner>,
}

/// Views with what belongs to them.
struct Selected<'a> {
    observations: &'a Observations,
    views: Vec<Seen>,
}

impl Whole<'_> {
    fn used(&self) -> Selected<'_> {
        let views = self.observations.views.iter().zip(self.is_used);
        Selected {
            observations: self.observations,
            views: views
                .map(|(view, is_used)| seen(view, |idx| is_used[idx]))
                .collect(),
        }
    }

    /// The fold's corners that count here and lie in the fold's calibrated area.
    fn corners_of<'a>(&self, fold: &'a Fold) -> Selected<'a> {
        let unseen = &fold.unseen;
        let own =
            |view: &ViewBlock, poses: &Observations| (view.camera_idx, poses.poses[view.pose_idx]);
        let label = |corner: &ObservedCorner| (corner.row, corner.col);
        let views = unseen.views.iter().map(|view| {
            let here = self.observations.views.iter().position(|other| {
                own(other, self.observations) == own(view, unseen)
                    && other.corners.len() >= view.corners.len()
            });
            let used: HashSet<(usize, usize)> = here
                .map(|idx| {
                    let corners = self.observations.views[idx].corners.iter();
                    let is_used = corners.zip(&self.is_used[idx]);
                    is_used.filter(|(_, used)| **used).map(|(c, _)| label(c))
                })
                .into_iter()
                .flatten()
                .collect();
            let coverage = &fold.rig.cameras[view.camera_idx].coverage;
            seen(view, |idx| {
                let corner = &view.corners[idx];
                used.contains(&label(corner)) && coverage.contains(corner.pixel)
            })
        });
        Selected {
            observations: unseen,
            views: views.collect(),
        }
    }

    /// Share of the corners that counts as independent, by residuals from a pose of each view's own:
    /// what cameras disagree about is none of it.
    fn independent_share(&self) -> f64 {
        let views = self.observations.views.iter().zip(self.is_used);
        let residuals: Vec<Vec<Option<Vector2<f64>>>> = views
            .map(|(view, is_used)| {
                let seen = seen(view, |idx| is_used[idx]);
                let found = residuals_with_free_pose(
                    &self.rig.cameras[view.camera_idx].field,
                    &self.observations.board,
                    self.board_shape,
                    &seen.corners,
                );
                let mut found = found.into_iter().flatten();
                let used = is_used.iter();
                used.map(|used| if *used { found.next() } else { None })
                    .collect()
            })
            .collect();
        let squared: Vec<f64> = residuals
            .iter()
            .flatten()
            .flatten()
            .map(Vector2::norm_squared)
            .collect();
        let noise = StudentT::fit(&squared, f64::MIN_POSITIVE, None);
        neighbor_correlation(&residuals, self.observations, &noise).map_or(1.0, effective_share)
    }
}

fn seen(view: &ViewBlock, counts: impl Fn(usize) -> bool) -> Seen {
    let corners = view.corners.iter().enumerate();
    Seen {
        camera_idx: view.camera_idx,
        pose_idx: view.pose_idx,
        corners: corners
            .filter(|(idx, _)| counts(*idx))
            .map(|(_, corner)| corner.labelled())
            .collect(),
    }
}

fn sums(rig: &Rig, shape: &BoardShape, selected: &Selected) -> Sums {
    let board = &selected.observations.board;
    let total =
        |residuals: &[Vector2<f64>]| residuals.iter().map(Vector2::norm_squared).sum::<f64>();
    let mut own_px2: Vec<Option<f64>> = Vec::with_capacity(selected.views.len());
    let mut sums = Sums::default();
    for view in &selected.views {
        let field = &rig.cameras[view.camera_idx].field;
        let residuals = residuals_with_free_pose(field, board, shape, &view.corners);
        let px2 = residuals.map(|residuals| total(&residuals));
        if let Some(px2) = px2 {
            sums.mono_px2 += px2;
            sums.mono_views += 1.0;
            sums.mono_corners += view.corners.len() as f64;
        }
        own_px2.push(px2);
    }
    let mut poses: Vec<usize> = selected.views.iter().map(|view| view.pose_idx).collect();
    poses.sort_unstable();
    poses.dedup();
    for pose in poses {
        let group: Vec<usize> = (0..selected.views.len())
            .filter(|idx| selected.views[*idx].pose_idx == pose && own_px2[*idx].is_some())
            .collect();
        if group.len() < 2 {
            continue;
        }
        let views: Vec<(_, RigidTransform, &[Corner])> = group
            .iter()
            .map(|idx| {
                let view = &selected.views[*idx];
                let camera = &rig.cameras[view.camera_idx];
                (
                    &camera.field,
                    camera.rig_from_camera.inverse(),
                    &view.corners[..],
                )
            })
            .collect();
        let Some(residuals) = residuals_with_one_pose(&views, board, shape) else {
            continue;
        };
        sums.one_px2 += residuals.iter().map(|own| total(own)).sum::<f64>();
        for idx in group {
            sums.own_px2 += own_px2[idx].unwrap_or(0.0);
            sums.pair_views += 1.0;
            sums.pair_corners += selected.views[idx].corners.len() as f64;
        }
        sums.boards += 1.0;
    }
    sums
}
