//! Where the alternation starts: poses of the boards, and about where the cameras are.
//!
//! The publication takes each camera's poses from its homographies through the camera matrix of
//! Zhang's method with Brown's distortion (3 to 5), and averages those that several cameras found of
//! one board (31, 32). That start is built here, and two more: the same baseline with all cameras
//! adjusted together, and the project's own initialization, which knows lenses that a pinhole does
//! not. Which of them is best differs with the optics; the alternation's own cost (14) decides.

use super::stereo::{Mean, mean_pose, relative_pose};
use crate::adjust::Observations;
use crate::init::rig::RigStart;
use crate::pinhole::{CameraFit, Loss, PinholeRig, RigSettings, Settings, calibrate_rig};
use calib_rays::geometry::RigidTransform;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where poses come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StartKind {
    /// Pinhole with distortion per camera; poses of several cameras averaged: the publication's.
    AveragedPinholes,
    /// Pinholes with distortion, all cameras adjusted together.
    PinholeRig,
    /// The project's own initialization: cubic fields.
    CubicFields,
}

/// A start, in the frame of the datum board.
#[derive(Debug, Clone)]
pub struct Start {
    /// Which.
    pub kind: StartKind,
    /// Per pose index; `None` where no camera could place the board.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Per camera.
    pub rig_from_camera: Vec<RigidTransform>,
}

/// All starts that there are for these observations. `own` is the project's own, of the same
/// observations. `mean` is how poses of several cameras are averaged.
pub fn starts(observations: &Observations, own: &RigStart, mean: Mean) -> Vec<Start> {
    let settings = RigSettings {
        // Outliers are no part of the publication, but of every recording.
        adjustment: Settings {
            loss: Loss::StudentT,
            ..Settings::default()
        },
        ..RigSettings::default()
    };
    let pinholes = calibrate_rig(observations, &settings).ok();
    let averaged = pinholes
        .as_ref()
        .and_then(|rig| averaged(observations, &rig.fits, mean));
    let together = pinholes.as_ref().map(in_first_camera);
    let cubic = Start {
        kind: StartKind::CubicFields,
        rig_from_board: own.rig_from_board.clone(),
        rig_from_camera: own
            .camera_from_rig
            .iter()
            .map(RigidTransform::inverse)
            .collect(),
    };
    [averaged, together, Some(cubic)]
        .into_iter()
        .flatten()
        .filter_map(Start::in_datum)
        .collect()
}

fn in_first_camera(rig: &PinholeRig) -> Start {
    Start {
        kind: StartKind::PinholeRig,
        rig_from_board: rig.first_from_board.clone(),
        rig_from_camera: rig
            .camera_from_first
            .iter()
            .map(RigidTransform::inverse)
            .collect(),
    }
}

/// Each camera's own poses in the frame of the first, then one pose per board (31, 32).
fn averaged(observations: &Observations, fits: &[CameraFit], mean: Mean) -> Option<Start> {
    let board = &observations.board;
    let corners: Vec<Vector3<f64>> = [
        (0, 0),
        (0, board.cols - 1),
        (board.rows - 1, 0),
        (board.rows - 1, board.cols - 1),
    ]
    .map(|(row, col)| board.corner_in_board(row, col))
    .into();
    let first = fits.first()?;
    let rig_from_camera: Vec<RigidTransform> = fits
        .iter()
        .map(|fit| relative_pose(&first.camera_from_board, &fit.camera_from_board, &corners))
        .collect::<Option<_>>()?;
    let rig_from_board = (0..observations.poses.len())
        .map(|pose_idx| {
            let seen: Vec<RigidTransform> = fits
                .iter()
                .zip(&rig_from_camera)
                .filter_map(|(fit, rig_from_camera)| {
                    Some(*rig_from_camera * (*fit.camera_from_board.get(pose_idx)?)?)
                })
                .collect();
            mean_pose(&seen, &board.center_in_board(), mean)
        })
        .collect();
    Some(Start {
        kind: StartKind::AveragedPinholes,
        rig_from_board,
        rig_from_camera,
    })
}

impl Start {
    /// The index of the datum pose: the first that is placed.
    pub fn datum(&self) -> Option<usize> {
        self.rig_from_board.iter().position(Option::is_some)
    }

    /// The same in the frame of the datum board.
    fn in_datum(self) -> Option<Self> {
        let datum_from_rig = self.rig_from_board.get(self.datum()?)?.as_ref()?.inverse();
        Some(Self {
            kind: self.kind,
            rig_from_board: self
                .rig_from_board
                .iter()
                .map(|pose| pose.map(|pose| datum_from_rig * pose))
                .collect(),
            rig_from_camera: self
                .rig_from_camera
                .iter()
                .map(|camera| datum_from_rig * *camera)
                .collect(),
        })
    }
}
