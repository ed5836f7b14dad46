//! Which boards to add to a recording: what each would make of the calibration's error, beside what
//! it is now. For sentences like "take two more boards tilted by 20 degrees about the vertical (0.18
//! mm now, 0.03 mm then)".

use super::working_volume::{Match, matches_at};
use calib_estimate::joint::{Estimate, EstimateError};
use calib_rays::field::Rig;
use calib_rays::geometry::{RigidTransform, so3};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Tilt of the boards proposed, degrees.
pub const TILT_DEG: f64 = 20.0;
/// Distances of the boards proposed, and of the points that are judged, over the middle one.
const DEPTHS: [f64; 3] = [0.7, 1.0, 1.3];

/// Boards that could be added.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shot {
    /// Two, tilted to either side by [`TILT_DEG`] about the first camera's vertical.
    TiltedAboutVertical,
    /// Two, tilted up and down by as much about its horizontal.
    TiltedAboutHorizontal,
    /// One at 0.7 of the middle distance, frontal.
    Nearer,
    /// One at 1.3 of it.
    Farther,
}

impl Shot {
    /// Every kind.
    pub const ALL: [Self; 4] = [
        Self::TiltedAboutVertical,
        Self::TiltedAboutHorizontal,
        Self::Nearer,
        Self::Farther,
    ];
}

/// What boards would bring.
#[derive(Debug, Clone, PartialEq)]
pub struct Gain {
    /// Which.
    pub shot: Shot,
    /// Where they stand, frame of the rig.
    pub rig_from_board: Vec<RigidTransform>,
    /// Predicted RMS error of the calibration with them, mm.
    pub error_mm: f64,
}

/// What a calibration is worth, and with which boards it would be worth most.
#[derive(Debug, Clone, PartialEq)]
pub struct WhatNext {
    /// Predicted RMS error of points through the working volume from the calibration alone, mm.
    pub now_mm: f64,
    /// The best first.
    pub gains: Vec<Gain>,
}

/// Points that the calibration is judged by: all over the image at 0.7, 1 and 1.3 of the middle
/// distance of the boards, whether boards stood there or not.
pub fn judged_matches(estimate: &Estimate, rig: &Rig) -> Vec<Match> {
    let distances = estimate.board_distances_mm(rig);
    let Some(middle_mm) = distances.get(distances.len() / 2) else {
        return Vec::new();
    };
    let mut matches = matches_at(rig, &DEPTHS.map(|depth| depth * middle_mm));
    matches.retain(|sightings| rig.triangulate(sightings).is_ok());
    matches
}

/// What to record next. `rig` is that of [`Estimate::rig`]; `None` without a pair of cameras that
/// measures.
///
/// Cost: five assemblies of the equations with a dense covariance of some 300 points each.
///
/// # Errors
/// [`EstimateError::Singular`] if the data leave a parameter open.
pub fn what_to_record_next(
    estimate: &mut Estimate,
    rig: &Rig,
) -> Result<Option<WhatNext>, EstimateError> {
    let matches = judged_matches(estimate, rig);
    let Some(frontal) = frontal_board(estimate, rig).filter(|_| !matches.is_empty()) else {
        return Ok(None);
    };
    let Some(now_mm) = estimate.error_with_boards_mm(rig, &[], &matches)? else {
        return Ok(None);
    };
    let mut gains = Vec::new();
    for shot in Shot::ALL {
        let rig_from_board = boards(shot, rig, estimate, &frontal);
        if let Some(error_mm) = estimate.error_with_boards_mm(rig, &rig_from_board, &matches)? {
            gains.push(Gain {
                shot,
                rig_from_board,
                error_mm,
            });
        }
    }
    gains.sort_by(|a, b| a.error_mm.total_cmp(&b.error_mm));
    Ok(Some(WhatNext { now_mm, gains }))
}

/// The recorded board that faces the first camera most squarely, moved to the middle of all.
fn frontal_board(estimate: &Estimate, rig: &Rig) -> Option<RigidTransform> {
    let center_in_board = estimate.observations.board.center_in_board();
    let poses = estimate.rig_from_board();
    let axis = rig.cameras.first()?.rig_from_camera.rotation * Vector3::z();
    let facing = |pose: &RigidTransform| pose.rotation.column(2).dot(&axis).abs();
    let squarest = poses
        .iter()
        .max_by(|a, b| facing(a).total_cmp(&facing(b)))?;
    let middles = poses.iter().map(|pose| pose.point(&center_in_board));
    let middle = middles.sum::<Vector3<f64>>() / poses.len() as f64;
    Some(about_middle(squarest.rotation, middle, &center_in_board))
}

fn about_middle(
    rotation: nalgebra::Matrix3<f64>,
    middle: Vector3<f64>,
    center_in_board: &Vector3<f64>,
) -> RigidTransform {
    RigidTransform::new(rotation, middle - rotation * center_in_board)
}

fn boards(
    shot: Shot,
    rig: &Rig,
    estimate: &Estimate,
    frontal: &RigidTransform,
) -> Vec<RigidTransform> {
    let center_in_board = estimate.observations.board.center_in_board();
    let middle = frontal.point(&center_in_board);
    let camera = rig
        .cameras
        .first()
        .map_or_else(RigidTransform::identity, |camera| camera.rig_from_camera);
    let tilted = |axis: Vector3<f64>| {
        let axis = camera.rotation * axis;
        [-1.0, 1.0].map(|side: f64| {
            let turn = so3::exp(&(axis * side * TILT_DEG.to_radians()));
            about_middle(turn * frontal.rotation, middle, &center_in_board)
        })
    };
    let moved = |depth: f64| {
        let place = camera.translation_mm + (middle - camera.translation_mm) * depth;
        about_middle(frontal.rotation, place, &center_in_board)
    };
    match shot {
        Shot::TiltedAboutVertical => tilted(Vector3::y()).to_vec(),
        Shot::TiltedAboutHorizontal => tilted(Vector3::x()).to_vec(),
        Shot::Nearer => vec![moved(DEPTHS[0])],
        Shot::Farther => vec![moved(DEPTHS[2])],
    }
}
