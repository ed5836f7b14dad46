//! One camera by itself: intrinsics, distortion and the pose of every board, from several starts.

use super::PinholeError;
use super::adjustment::{Free, Outcome, Settings, State, minimize};
use super::brown::{BrownCamera, INTRINSICS};
use super::homography::PixelHomography;
use super::zhang::{ZhangForm, zhang};
use crate::adjust::Observations;
use crate::init::focal_scan::start_camera;
use crate::init::{InitError, MIN_POSES};
use calib_rays::geometry::{RigidTransform, SensorSize};
use calib_rays::numerics::levenberg::StopReason;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// Where an adjustment started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StartKind {
    /// Zhang's closed form with all of the conic.
    ZhangConic,
    /// Zhang's closed form with the principal point in the middle of the sensor: `OpenCV`'s start.
    ZhangFixedCenter,
    /// The project's own: ideal lenses of many focal lengths tried, poses through a cubic field.
    FocalScan,
}

/// A start, and where it led.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartTried {
    /// Which.
    pub kind: StartKind,
    /// Focal lengths that it gave, px; `None` if it gave none.
    pub focal_px: Option<[f64; 2]>,
    /// Cost of the minimum that it led to, px^2; `None` if it led to none.
    pub cost_px2: Option<f64>,
}

/// A calibrated camera, and what to judge it by.
#[derive(Debug, Clone)]
pub struct CameraFit {
    /// The camera.
    pub camera: BrownCamera,
    /// Per pose index of the observations; `None` where the camera's view cannot place the board
    /// (none, fewer than [`crate::init::MIN_CORNERS`] corners, or all on one line): such a view takes
    /// no part.
    pub camera_from_board: Vec<Option<RigidTransform>>,
    /// The start that led to the lowest minimum; of equals, the first in the order of [`StartKind`].
    pub start: StartKind,
    /// All starts.
    pub starts: Vec<StartTried>,
    /// Sum of squared residuals, each with its corner's relative weight, px^2.
    pub cost_px2: f64,
    /// Root mean square length of the residual vectors of the corners used, px: what `OpenCV`
    /// returns.
    pub rms_px: f64,
    /// Corners used.
    pub corner_count: usize,
    /// Linearizations from the start kept.
    pub iterations: usize,
    /// Why the adjustment ended.
    pub stop: StopReason,
    /// Standard deviations of `fx, fy, cx, cy, k1, k2, p1, p2, k3` from the residuals' own variance;
    /// `None` if the data leave some of them open.
    pub standard_deviations: Option<[f64; INTRINSICS]>,
}

/// Misfits closer than this share belong to the same minimum, reached from two sides.
const SAME_MISFIT: f64 = 1e-6;

/// Calibrates one camera of the observations.
///
/// # Errors
/// [`PinholeError::Init`] with too few usable views, or if they look as if seen by parallel rays;
/// [`PinholeError::NoStart`], [`PinholeError::NoSuchCamera`].
pub fn calibrate_camera(
    observations: &Observations,
    camera_idx: usize,
    settings: &Settings,
) -> Result<CameraFit, PinholeError> {
    let Some(&sensor) = observations.sensors.get(camera_idx) else {
        return Err(PinholeError::NoSuchCamera {
            camera_idx,
            have: observations.sensors.len(),
        });
    };
    let own = observations.of_camera(camera_idx);
    let homographies = homographies(&own, sensor);
    let usable = homographies.iter().flatten().count();
    if usable < MIN_POSES {
        return Err(PinholeError::Init(InitError::TooFewPoses {
            camera_idx,
            have: usable,
        }));
    }
    let mut starts = Vec::new();
    let mut best: Option<(StartKind, Outcome)> = None;
    for kind in [
        StartKind::ZhangConic,
        StartKind::ZhangFixedCenter,
        StartKind::FocalScan,
    ] {
        let start = match kind {
            StartKind::ZhangConic => zhang_start(&homographies, sensor, ZhangForm::Conic),
            StartKind::ZhangFixedCenter => {
                zhang_start(&homographies, sensor, ZhangForm::FixedCenter)
            }
            StartKind::FocalScan => focal_scan_start(&own, sensor, camera_idx)?,
        };
        let focal_px = start.as_ref().map(|start| start.cameras[0].focal_px);
        // A start with a board behind the camera leads nowhere.
        let outcome =
            start.and_then(|start| minimize(start, &own, Free::Intrinsics, settings).ok());
        starts.push(StartTried {
            kind,
            focal_px,
            cost_px2: outcome.as_ref().map(|outcome| outcome.cost_px2),
        });
        if let Some(outcome) = outcome {
            let is_better = best
                .as_ref()
                .is_none_or(|(_, best)| outcome.misfit < best.misfit * (1.0 - SAME_MISFIT));
            if is_better {
                best = Some((kind, outcome));
            }
        }
    }
    let Some((start, outcome)) = best else {
        return Err(PinholeError::NoStart {
            camera_idx,
            views: usable,
        });
    };
    Ok(fit_of(observations, camera_idx, start, starts, outcome))
}

/// One per view that can place its board.
fn homographies(own: &Observations, sensor: SensorSize) -> Vec<Option<PixelHomography>> {
    let mut found = vec![None; own.poses.len()];
    for view in &own.views {
        found[view.pose_idx] = PixelHomography::of_view(view, sensor);
    }
    found
}

fn alone(camera: BrownCamera, camera_from_board: Vec<Option<RigidTransform>>) -> State {
    State {
        cameras: vec![camera],
        camera_from_first: vec![RigidTransform::identity()],
        first_from_board: camera_from_board,
    }
}

fn poses_through(
    homographies: &[Option<PixelHomography>],
    pixel_from_camera: &Matrix3<f64>,
) -> Vec<Option<RigidTransform>> {
    homographies
        .iter()
        .map(|homography| homography.as_ref()?.pose(pixel_from_camera))
        .collect()
}

fn zhang_start(
    homographies: &[Option<PixelHomography>],
    sensor: SensorSize,
    form: ZhangForm,
) -> Option<State> {
    let usable: Vec<PixelHomography> = homographies.iter().flatten().copied().collect();
    let found = zhang(&usable, sensor, form)?;
    Some(alone(
        BrownCamera::ideal(sensor, found.focal_px, found.center),
        poses_through(homographies, &found.matrix()),
    ))
}

/// The base lens of the project's own start as a pinhole, with the poses found through its cubic
/// field. `None` if no lens explains the corners there.
fn focal_scan_start(
    own: &Observations,
    sensor: SensorSize,
    camera_idx: usize,
) -> Result<Option<State>, PinholeError> {
    match start_camera(own, camera_idx) {
        Ok(start) => {
            let base = start.field.base;
            let camera = BrownCamera::ideal(sensor, [base.focal_px; 2], sensor.center());
            Ok(Some(alone(camera, start.camera_from_board)))
        }
        Err(InitError::NoLens { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

fn fit_of(
    observations: &Observations,
    camera_idx: usize,
    start: StartKind,
    starts: Vec<StartTried>,
    outcome: Outcome,
) -> CameraFit {
    let mut camera_from_board = vec![None; observations.poses.len()];
    let mut own = outcome.state.first_from_board.into_iter();
    // Poses of the camera's own observations are those it has views of, in the same order.
    for (pose_idx, pose) in camera_from_board.iter_mut().enumerate() {
        let is_seen = observations
            .views
            .iter()
            .any(|view| view.camera_idx == camera_idx && view.pose_idx == pose_idx);
        if is_seen {
            *pose = own.next().flatten();
        }
    }
    CameraFit {
        camera: outcome.state.cameras[0],
        camera_from_board,
        start,
        starts,
        cost_px2: outcome.cost_px2,
        rms_px: outcome.rms_px,
        corner_count: outcome.corner_count,
        iterations: outcome.iterations,
        stop: outcome.stop,
        standard_deviations: outcome
            .deviations
            .and_then(|cameras| Some(cameras.first()?.intrinsics)),
    }
}
