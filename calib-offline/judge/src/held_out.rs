//! Cross-validation by pose: what the calibration does with boards that it never saw.
//!
//! The estimates of the folds are what costs time; they are made once ([`estimate_folds`]) and may
//! then be judged as often as wanted: in pixels, and in millimeters by anything that turns matches
//! into points ([`measure_boards`]), be it the f64 rig or a blob in the device's own code.

use super::measured_board::MeasuredBoard;
use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::ViewBlock;
use calib_estimate::init::board_pose::residuals_with_free_pose;
use calib_estimate::joint::Estimate;
use calib_rays::board::BoardShape;
use calib_rays::field::Rig;
use calib_rays::geometry::PixelPoint;
use calib_rays::measure::{Number, PointSource, RigSource, Sighting, Status};
use calib_rays::observed::{Corner, MIN_POSES};
use calib_rays::progress::Progress;
use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt::Display;

/// What a method makes of some poses, as far as others are judged by it.
#[derive(Debug, Clone)]
pub struct Estimated {
    /// The cameras.
    pub rig: Rig,
    /// Out-of-plane shape of the board.
    pub board_shape: BoardShape,
    /// The joint estimate behind it, if it is one: its model may then be compared with simpler ones.
    pub joint: Option<Box<Estimate>>,
}

/// An estimate from all poses (or points) but those of one fold.
#[derive(Debug, Clone)]
pub struct Fold {
    /// The rig that the others gave.
    pub rig: Rig,
    /// The board's shape that they gave.
    pub board_shape: BoardShape,
    /// The joint estimate behind it, if it is one.
    pub joint: Option<Box<Estimate>>,
    /// What was left out.
    pub unseen: Observations,
}

/// The estimates of all folds.
#[derive(Debug, Clone, Default)]
pub struct Folds {
    /// In order; those whose training poses gave no estimate are not in it.
    pub estimated: Vec<Fold>,
    /// Those that gave none, in order.
    pub failed: Vec<FailedFold>,
}

/// A fold whose training poses gave no estimate.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FailedFold {
    /// Its number, from 0.
    pub fold: usize,
    /// Why, in words.
    pub reason: String,
}

/// Errors on held-out boards, all folds together.
#[derive(Debug, Clone, Default)]
pub struct HeldOut {
    /// Number of folds that were estimated.
    pub folds: usize,
    /// Length of the residual vector of every held-out corner with its board's pose refitted, px.
    pub residuals_px: Vec<f64>,
    /// Held-out corners outside the calibrated area of their fold.
    pub outside_count: usize,
    /// The triangulated boards.
    pub boards: BoardErrors,
    /// Folds whose training poses gave no estimate.
    pub failed: Vec<FailedFold>,
}

/// Errors of triangulated boards.
#[derive(Debug, Clone, Default)]
pub struct BoardErrors {
    /// Relative error of the distance of neighboring corners.
    pub neighbor_errors: Vec<f64>,
    /// Distance of triangulated corners from the best-placed flat board, mm.
    pub rigid_errors_mm: Vec<f64>,
    /// Boards that two cameras saw.
    pub board_count: usize,
    /// Corners triangulated.
    pub point_count: usize,
    /// Corners seen by two cameras that one of them has no ray for.
    pub outside_count: usize,
    /// Corners whose rays do not meet before the cameras.
    pub unmet_count: usize,
}

impl BoardErrors {
    /// Adds those of other boards.
    pub fn add(&mut self, other: Self) {
        self.neighbor_errors.extend(other.neighbor_errors);
        self.rigid_errors_mm.extend(other.rigid_errors_mm);
        self.board_count += other.board_count;
        self.point_count += other.point_count;
        self.outside_count += other.outside_count;
        self.unmet_count += other.unmet_count;
    }
}

/// Fold of the pose with this index: poses are dealt in turn, so that every fold spans the stage.
pub fn fold_of(pose_idx: usize, folds: usize) -> usize {
    pose_idx % folds.max(1)
}

/// Points are no more folds than this: beyond, a fold may have too few to place the target.
const MOST_FOLDS_OF_POINTS: usize = 10;

/// What is dealt to the folds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dealt {
    /// Poses.
    Poses,
    /// Points, by label: where too few poses leave none to spare and the target determines the cameras in one.
    Points,
}

impl Dealt {
    /// What the folds of a recording are dealt from; `None` with too few poses to leave some out.
    pub fn of(used: &Observations) -> Option<Self> {
        Self::of_count(used.different_pose_count(), used.may_be_one_pose())
    }

    /// The same of so many poses, of which one may determine everything or not.
    pub fn of_count(poses: usize, may_be_one_pose: bool) -> Option<Self> {
        if poses >= 2 * MIN_POSES {
            return Some(Self::Poses);
        }
        may_be_one_pose.then_some(Self::Points)
    }

    /// In words.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Poses => "pose",
            Self::Points => "point",
        }
    }

    /// The part of a recording whose folds are wanted.
    fn part(
        self,
        observations: &Observations,
        folds: usize,
        wanted: impl Fn(usize) -> bool,
    ) -> Observations {
        match self {
            Self::Poses => observations.with_poses(|pose| {
                let idx = observations.poses.binary_search(&pose);
                wanted(idx.map_or(folds, |idx| fold_of(idx, folds)))
            }),
            // Odd, so that a fold is no column of a square grid of points.
            Self::Points => {
                observations.with_labels(|row, col| wanted(fold_of(7 * row + 3 * col, folds)))
            }
        }
    }
}

/// So many folds, or none with nothing to leave out.
pub fn folds_wanted(used: &Observations, folds: usize) -> usize {
    match Dealt::of(used) {
        Some(Dealt::Poses) => folds.min(used.poses.len()),
        Some(Dealt::Points) => folds.min(MOST_FOLDS_OF_POINTS),
        None => 0,
    }
}

/// Estimates each fold from the other folds' poses (or points) by any method.
///
/// Cost: `folds` estimates, run in parallel with ordered results.
pub fn estimate_folds<E: Display>(
    observations: &Observations,
    folds: usize,
    estimate: &(dyn Fn(&Observations) -> Result<Estimated, E> + Sync),
    progress: &dyn Progress,
) -> Folds {
    let results: Vec<Result<Fold, FailedFold>> = (0..folds)
        .into_par_iter()
        .map(|fold| {
            let dealt = Dealt::of(observations).unwrap_or(Dealt::Poses);
            let result = estimate(&dealt.part(observations, folds, |of| of != fold));
            progress.advance();
            match result {
                Ok(Estimated {
                    rig,
                    board_shape,
                    joint,
                }) => Ok(Fold {
                    rig,
                    board_shape,
                    joint,
                    unseen: dealt.part(observations, folds, |of| of == fold),
                }),
                Err(error) => Err(FailedFold {
                    fold,
                    reason: error.to_string(),
                }),
            }
        })
        .collect();
    let mut all = Folds::default();
    for result in results {
        match result {
            Ok(fold) => all.estimated.push(fold),
            Err(failed) => all.failed.push(failed),
        }
    }
    all
}

/// Judges the folds, in f64.
pub fn held_out(folds: &Folds) -> HeldOut {
    let mut all = HeldOut {
        folds: folds.estimated.len(),
        failed: folds.failed.clone(),
        ..HeldOut::default()
    };
    for fold in &folds.estimated {
        fold.add_residuals(&mut all);
        // Without a frame there is always a source.
        if let Some(source) = RigSource::new(&fold.rig, None) {
            all.boards.add(measure_boards(&source, &fold.unseen));
        }
    }
    all
}

impl Fold {
    /// Residuals of the corners in the calibrated area; the others are counted.
    fn add_residuals(&self, result: &mut HeldOut) {
        for view in &self.unseen.views {
            let corners: Vec<Corner> = covered(&self.rig, view, &mut result.outside_count);
            let residuals = residuals_with_free_pose(
                &self.rig.cameras[view.camera_idx].field,
                &self.unseen.board,
                &self.board_shape,
                &corners,
            );
            result
                .residuals_px
                .extend(residuals.into_iter().flatten().map(|r| r.norm()));
        }
    }
}

/// Triangulates the boards that two cameras saw, and compares them with the board as it is.
pub fn measure_boards<S: PointSource>(source: &S, unseen: &Observations) -> BoardErrors {
    let mut result = BoardErrors::default();
    for pose_idx in 0..unseen.poses.len() {
        let views: Vec<&ViewBlock> = unseen
            .views
            .iter()
            .filter(|view| view.pose_idx == pose_idx)
            .collect();
        let [left, right, ..] = views[..] else {
            continue;
        };
        result.board_count += 1;
        let mut board = MeasuredBoard::default();
        for corner in &left.corners {
            let other = right
                .corners
                .iter()
                .find(|other| (other.row, other.col) == (corner.row, corner.col));
            let Some(other) = other else { continue };
            let sightings = [
                sighting(left.camera_idx, corner.pixel),
                sighting(right.camera_idx, other.pixel),
            ];
            match source.point(&sightings) {
                Ok(found) => {
                    let point = Vector3::from(found.point_mm.map(Into::into));
                    board.corners.push((corner.row, corner.col, point));
                }
                Err(Status::Outside) => result.outside_count += 1,
                Err(Status::Parallel | Status::Behind) => result.unmet_count += 1,
            }
        }
        result.point_count += board.corners.len();
        let neighbors = board.neighbor_errors(&unseen.board);
        result.neighbor_errors.extend(neighbors);
        let rigid = board.rigid_errors_mm(&unseen.board);
        result.rigid_errors_mm.extend(rigid);
    }
    result
}

fn sighting<N: Number>(camera_idx: usize, pixel: PixelPoint) -> Sighting<N> {
    (camera_idx, [pixel.u, pixel.v].map(nalgebra::convert))
}

/// The corners of a view inside the calibrated area; the others are counted.
fn covered(rig: &Rig, view: &ViewBlock, outside_count: &mut usize) -> Vec<Corner> {
    let coverage = &rig.cameras[view.camera_idx].coverage;
    view.corners
        .iter()
        .filter_map(|corner| {
            if !coverage.contains(corner.pixel) {
                *outside_count += 1;
                return None;
            }
            Some(corner.labelled())
        })
        .collect()
}
