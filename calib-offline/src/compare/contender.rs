//! The methods that are compared: each gives a rig from the same observations. A further method is
//! one more entry of [`CONTENDERS`].

use crate::error::Error;
use crate::evaluate::held_out::Estimated;
use crate::pipeline::alternatingly::{estimate_alternating, estimate_rig};
use crate::pipeline::jointly::estimate_joint;
use calib_estimate::adjust::Observations;
use calib_estimate::adjust::robust::{relative_weights, reweight};
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::{Estimate, estimate_screened};
use calib_estimate::pinhole::{Loss, PinholeError, RigSettings, Settings, calibrate_rig};
use calib_estimate::reprojection::residuals;
use calib_rays::board::BoardShape;
use calib_rays::field::Rig;
use calib_rays::geometry::RigidTransform;
use std::collections::BTreeMap;

/// What all methods are given: the views that agree with each other, as the joint estimate finds
/// them.
#[derive(Debug)]
pub struct Shared {
    /// The views.
    pub observations: Observations,
    /// The joint estimate that came of it on the way.
    pub joint: Result<Estimate, Error>,
    /// Stage placement of the poses (by number) that belong to one.
    pub placements: BTreeMap<usize, usize>,
}

impl Shared {
    /// Screens the views offered. Where there is no joint estimate they are taken as its start left
    /// them, and without even a start as they were offered.
    pub fn of(offered: &Observations, placements: BTreeMap<usize, usize>) -> Self {
        let start = match start_rig(offered) {
            Ok(start) => start,
            Err(error) => {
                return Self {
                    observations: offered.clone(),
                    joint: Err(error.into()),
                    placements,
                };
            }
        };
        let started = start.observations.clone();
        match estimate_screened(offered, start) {
            Ok((estimate, _)) => Self {
                observations: estimate.observations.clone(),
                joint: Ok(estimate),
                placements,
            },
            Err(error) => Self {
                observations: started,
                joint: Err(error.into()),
                placements,
            },
        }
    }

    /// The joint estimate.
    ///
    /// # Errors
    /// [`Failure`] with why there is none.
    pub fn joint(&self) -> Result<&Estimate, Failure> {
        self.joint.as_ref().map_err(|error| Failure(chain(error)))
    }

    /// Stage placement of a pose.
    pub fn placement(&self, pose: usize) -> Option<usize> {
        self.placements.get(&pose).copied()
    }
}

/// What a method made of all that it was given.
#[derive(Debug)]
pub struct Fitted {
    /// The cameras.
    pub rig: Rig,
    /// Per pose of the observations; `None` where the method could not place the board.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Out-of-plane shape of the board.
    pub board_shape: BoardShape,
    /// Per view and corner: whether it was used, and not rejected as an outlier.
    pub is_used: Vec<Vec<bool>>,
    /// Largest difference of the rig's rays from the method's own, px; 0 where these are the rig's.
    pub conversion_error_px: f64,
}

/// A method in a comparison.
#[derive(Debug, Clone, Copy)]
pub struct Contender {
    /// Its name in files.
    pub name: &'static str,
    /// What it is called in words.
    pub title: &'static str,
    /// From everything; the cameras named as given.
    pub fit: fn(&Shared, &[String]) -> Result<Fitted, Failure>,
    /// From some poses. The cameras of its rig are named by number.
    pub fold: fn(&Shared, &Observations) -> Result<Estimated, Failure>,
}

/// Why a method has no answer, in words.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Failure(pub String);

/// The methods, in the order of the table. The first is what the others are measured against.
pub const CONTENDERS: [Contender; 3] = [
    Contender {
        name: "baseline",
        title: "pinhole, Brown-Conrady",
        fit: |shared, names| fit_baseline(&shared.observations, names),
        fold: |_, training| {
            let fitted = fit_baseline(training, &training.numbered_cameras())?;
            Ok(Estimated {
                rig: fitted.rig,
                board_shape: fitted.board_shape,
            })
        },
    },
    Contender {
        name: "alternating",
        title: "rays one by one, alternating",
        fit: fit_alternating,
        fold: |shared, training| {
            estimate_alternating(training, &|pose| shared.placement(pose))
                .map_err(|error| Failure(error.to_string()))
        },
    },
    Contender {
        name: "joint",
        title: "ray field, joint",
        fit: fit_joint,
        fold: |_, training| estimate_joint(training).map_err(|error| Failure(error.to_string())),
    },
];

/// The baseline. Its residuals count as the joint estimate's do, so that outliers decide for nobody.
fn fit_baseline(observations: &Observations, names: &[String]) -> Result<Fitted, Failure> {
    let failure = |error: PinholeError| Failure(error.to_string());
    let settings = RigSettings {
        adjustment: Settings {
            loss: Loss::StudentT,
            ..Settings::default()
        },
        ..RigSettings::default()
    };
    let pinhole = calibrate_rig(observations, &settings).map_err(failure)?;
    let found = pinhole.rig(names, observations).map_err(failure)?;
    Ok(Fitted {
        rig: found.rig,
        rig_from_board: found.rig_from_board,
        board_shape: BoardShape::default(),
        is_used: pinhole.is_used,
        conversion_error_px: found.worst_error_px,
    })
}

/// The published procedure. Corners count as used where the joint estimate's weights would keep them.
fn fit_alternating(shared: &Shared, names: &[String]) -> Result<Fitted, Failure> {
    let start = start_rig(&shared.observations).map_err(|error| Failure(error.to_string()))?;
    let (found, fields) = estimate_rig(&start, names, &|pose| shared.placement(pose))
        .map_err(|error| Failure(error.to_string()))?;
    let placed = found.poses_by_number();
    let rig_from_board: Vec<Option<RigidTransform>> = shared
        .observations
        .poses
        .iter()
        .map(|pose| placed.get(pose).copied())
        .collect();
    let board_shape = BoardShape::default();
    let is_used = used_corners(
        &fields.rig,
        &rig_from_board,
        &board_shape,
        &shared.observations,
    );
    // Of single rays, which carry noise that the field does not.
    let conversion_error_px = fields.rms_error_px.iter().copied().fold(0.0, f64::max);
    Ok(Fitted {
        rig: fields.rig,
        rig_from_board,
        board_shape,
        is_used,
        conversion_error_px,
    })
}

/// Per view and corner: whether its residual is no outlier among those of its like.
fn used_corners(
    rig: &Rig,
    rig_from_board: &[Option<RigidTransform>],
    board_shape: &BoardShape,
    observations: &Observations,
) -> Vec<Vec<bool>> {
    let poses: Vec<RigidTransform> = rig_from_board
        .iter()
        .map(|pose| pose.unwrap_or_else(RigidTransform::identity))
        .collect();
    let mut residuals = residuals(rig, &poses, board_shape, observations);
    for (view, residuals) in observations.views.iter().zip(&mut residuals) {
        if rig_from_board[view.pose_idx].is_none() {
            residuals.fill(None);
        }
    }
    let (noise, _) = reweight(&residuals, observations, 1.0, None);
    relative_weights(&residuals, observations, &noise)
        .into_iter()
        .map(|weights| weights.into_iter().map(|weight| weight > 0.0).collect())
        .collect()
}

fn fit_joint(shared: &Shared, names: &[String]) -> Result<Fitted, Failure> {
    let estimate = shared.joint()?;
    let is_used = estimate.robust_weights.iter();
    Ok(Fitted {
        rig: estimate.rig(names),
        rig_from_board: estimate.rig_from_board().into_iter().map(Some).collect(),
        board_shape: estimate.model.board_shape.clone(),
        is_used: is_used
            .map(|weights| weights.iter().map(|weight| *weight > 0.0).collect())
            .collect(),
        conversion_error_px: 0.0,
    })
}

/// An error and its innermost cause.
fn chain(error: &Error) -> String {
    let mut cause: &dyn std::error::Error = error;
    while let Some(inner) = cause.source() {
        cause = inner;
    }
    cause.to_string()
}
