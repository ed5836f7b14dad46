//! One camera: which ideal lens is nearest, then a cubic field and a pose for every board.

use super::bearing_pose::bearing_pose;
use super::parallel_rays::affine_median_px;
use super::{InitError, MIN_CORNERS, MIN_POSES, is_usable};
use crate::adjust::levenberg::{self, Settings};
use crate::adjust::objective;
use crate::adjust::observations::ViewBlock;
use crate::adjust::priors::{CameraPriors, Priors};
use crate::adjust::robust::reweight;
use crate::adjust::{CameraModel, Model, Observations};
use calib_rays::board::BoardShape;
use calib_rays::field::structured::StructuredBasis;
use calib_rays::field::{BaseLens, Projection, RayField, transport};
use calib_rays::geometry::{RigidTransform, Scatter, SensorSize};
use calib_rays::numerics::median;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

/// Focal lengths tried, in sensor widths: from a 150 degree perspective lens to a telephoto.
const FOCAL_PER_WIDTH: (f64, f64) = (0.12, 12.0);
/// How many of each kind, evenly in the logarithm.
const FOCAL_COUNT: usize = 44;
/// Boards on which lenses are tried.
const TRIAL_BOARDS: usize = 12;
/// Corners of a view on which they are tried; beyond, more change no choice between lenses.
const TRIAL_CORNERS: usize = 600;
/// Candidates that are refined: the angular score alone is not reliable (METHOD section 3).
const REFINED: usize = 5;
/// Two candidates of one kind are distinct beyond this ratio of focal lengths (logarithm).
const DISTINCT_LOG_RATIO: f64 = 0.25;
/// Degree of the refining field.
const CUBIC: usize = 3;
/// A lens that leaves more than this share of the sensor's width explains nothing.
const MAX_MEDIAN_PER_WIDTH: f64 = 0.02;
/// Corners beyond this angle from the axis rule an ideal lens out, rad.
const MAX_ANGLE_RAD: f64 = 2.1;

/// A camera with a cubic field, and its pose for each usable board.
#[derive(Debug, Clone)]
pub struct CameraStart {
    /// Camera frame.
    pub field: RayField,
    /// Per pose index of the camera's own observations; `None` where the board was not usable.
    pub camera_from_board: Vec<Option<RigidTransform>>,
    /// Median length of the residual vectors, px.
    pub median_px: f64,
}

/// An ideal lens with the poses it gives to the trial boards.
struct Candidate {
    base: BaseLens,
    poses: Vec<RigidTransform>,
    score_px: f64,
}

/// Finds a start for one camera. `observations` are of that camera alone
/// ([`Observations::of_camera`]); `camera_idx` is for errors only.
///
/// # Errors
/// [`InitError::TooFewPoses`], [`InitError::NoLens`], [`InitError::ParallelRays`].
pub fn start_camera(
    observations: &Observations,
    camera_idx: usize,
) -> Result<CameraStart, InitError> {
    let sensor = observations.sensors[0];
    let usable: Vec<usize> = observations
        .views
        .iter()
        .filter(|view| is_usable(view))
        .map(|view| view.pose_idx)
        .collect();
    if usable.len() < needed_poses(observations) {
        return Err(InitError::TooFewPoses {
            camera_idx,
            have: usable.len(),
        });
    }
    let trial_poses = trial_poses(observations, &usable);
    let mut trial = observations.with_poses(|pose| trial_poses.contains(&pose));
    for view in &mut trial.views {
        thin(view);
    }
    let refined = scan(&trial, sensor)
        .par_iter()
        .filter_map(|candidate| refine(&trial, sensor, candidate))
        .collect::<Vec<_>>();
    let best = refined
        .into_iter()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .filter(|(_, median_px)| *median_px <= MAX_MEDIAN_PER_WIDTH * f64::from(sensor.width));
    let Some((field, _)) = best else {
        return Err(InitError::NoLens {
            camera_idx,
            median_px: f64::INFINITY,
            sensor,
        });
    };
    let start = place_all(observations, field, camera_idx)?;
    match affine_median_px(observations) {
        Some(parallel_px) if parallel_px < start.median_px => Err(InitError::ParallelRays {
            camera_idx,
            parallel_px,
            lens_px: start.median_px,
        }),
        _ => Ok(start),
    }
}

/// Fewest poses that determine a camera: one is enough if its points lie in no plane.
fn needed_poses(observations: &Observations) -> usize {
    let solid = |view: &ViewBlock| is_usable(view) && Scatter::of(&points_of(view)).is_solid();
    if observations.views.iter().any(solid) {
        1
    } else {
        MIN_POSES
    }
}

/// Poses evenly spread over those that show at least the median number of corners.
fn trial_poses(observations: &Observations, usable: &[usize]) -> Vec<usize> {
    let count = |pose_idx: usize| {
        observations
            .views
            .iter()
            .find(|view| view.pose_idx == pose_idx)
            .map_or(0, |view| view.corners.len())
    };
    let mut counts: Vec<usize> = usable.iter().map(|idx| count(*idx)).collect();
    counts.sort_unstable();
    let median = counts[counts.len() / 2];
    let rich: Vec<usize> = usable
        .iter()
        .copied()
        .filter(|idx| count(*idx) >= median.min(4 * MIN_CORNERS))
        .collect();
    let wanted = TRIAL_BOARDS.min(rich.len());
    (0..wanted)
        .map(|k| observations.poses[rich[k * rich.len() / wanted]])
        .collect()
}

/// Leaves every so many corners of a view of very many.
fn thin(view: &mut ViewBlock) {
    let stride = view.corners.len().div_ceil(TRIAL_CORNERS).max(1);
    let corners = view.corners.iter().step_by(stride).copied().collect();
    view.corners = corners;
}

/// The distinct ideal lenses that explain the trial boards best.
fn scan(trial: &Observations, sensor: SensorSize) -> Vec<Candidate> {
    let (first, last) = FOCAL_PER_WIDTH;
    let longer_px = f64::from(sensor.width.max(sensor.height));
    let lenses: Vec<BaseLens> = [Projection::Perspective, Projection::Equidistant]
        .into_iter()
        .flat_map(|projection| {
            (0..FOCAL_COUNT).map(move |k| {
                let share = k as f64 / (FOCAL_COUNT - 1) as f64;
                BaseLens::ideal(projection, longer_px * first * (last / first).powf(share))
            })
        })
        .collect();
    let mut candidates: Vec<Candidate> = lenses
        .par_iter()
        .filter_map(|base| try_lens(trial, sensor, *base))
        .collect();
    candidates.sort_by(|a, b| a.score_px.total_cmp(&b.score_px));
    let mut distinct: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        let is_new = distinct.iter().all(|other| {
            other.base.projection != candidate.base.projection
                || (other.base.focal_px / candidate.base.focal_px).ln().abs() > DISTINCT_LOG_RATIO
        });
        if is_new {
            distinct.push(candidate);
        }
        if distinct.len() == REFINED {
            break;
        }
    }
    distinct
}

fn try_lens(trial: &Observations, sensor: SensorSize, base: BaseLens) -> Option<Candidate> {
    let center = sensor.center();
    let mut poses = Vec::with_capacity(trial.poses.len());
    let mut errors_px = Vec::with_capacity(trial.poses.len());
    for view in &trial.views {
        let mut bearings = Vec::with_capacity(view.corners.len());
        for corner in &view.corners {
            let offset = Vector2::new(corner.pixel.u - center.u, corner.pixel.v - center.v);
            if base.projection == Projection::Equidistant
                && offset.norm() / base.focal_px > MAX_ANGLE_RAD
            {
                return None;
            }
            bearings.push(transport::direction(&base.evaluate(&offset).0));
        }
        let (pose, rms_rad) = bearing_pose(&bearings, &points_of(view))?;
        poses.push(pose);
        errors_px.push(rms_rad * base.focal_px);
    }
    Some(Candidate {
        base,
        poses,
        score_px: median(errors_px)?,
    })
}

fn points_of(view: &ViewBlock) -> Vec<Vector3<f64>> {
    view.corners.iter().map(|c| c.point_in_board).collect()
}

/// A cubic field on the trial boards from one candidate, with its median residual, px.
fn refine(
    trial: &Observations,
    sensor: SensorSize,
    candidate: &Candidate,
) -> Option<(RayField, f64)> {
    let field = RayField::ideal(sensor, candidate.base, CUBIC);
    let (model, median_px) = adjust_cubic(trial, field, candidate.poses.clone(), 2, 8)?;
    let field = model.cameras.into_iter().next()?.field;
    Some((field, median_px))
}

/// Robust adjustment of a cubic field and poses: `rounds` of re-weighting, `iterations` each.
fn adjust_cubic(
    observations: &Observations,
    field: RayField,
    poses: Vec<RigidTransform>,
    rounds: usize,
    iterations: usize,
) -> Option<(Model, f64)> {
    let camera = CameraModel {
        offset_basis: None,
        basis: StructuredBasis::new(field.sensor, CUBIC, None),
        field,
        camera_from_rig: RigidTransform::identity(),
    };
    let priors = Priors {
        cameras: vec![CameraPriors::free(&camera)],
        board: 0.0,
    };
    let mut model = Model {
        cameras: vec![camera],
        rig_from_board: poses,
        known_poses: Vec::new(),
        board_shape: BoardShape::default(),
    };
    let bases = model.view_bases(observations);
    let settings = Settings {
        max_iterations: iterations,
        relative_decrease: 1e-6,
    };
    for _ in 0..rounds {
        let residuals = objective::residuals(&model, observations, &bases);
        let (_, weights) = reweight(&residuals, observations, 1.0, None, false);
        model = levenberg::minimize(model, observations, &bases, &weights, &priors, settings).model;
    }
    let residuals = objective::residuals(&model, observations, &bases);
    let lengths_px = residuals.iter().flatten();
    let median_px = median(lengths_px.map(|r| r.map_or(f64::INFINITY, |r| r.norm())))?;
    median_px.is_finite().then_some((model, median_px))
}

/// Poses of all usable boards through the field found on some, then everything adjusted.
fn place_all(
    observations: &Observations,
    field: RayField,
    camera_idx: usize,
) -> Result<CameraStart, InitError> {
    let placed: Vec<Option<RigidTransform>> = observations
        .views
        .iter()
        .map(|view| {
            let bearings: Vec<_> = view
                .corners
                .iter()
                .map(|c| field.ray(c.pixel).direction)
                .collect();
            is_usable(view)
                .then(|| bearing_pose(&bearings, &points_of(view)))
                .flatten()
                .map(|(pose, _)| pose)
        })
        .collect();
    let kept: Vec<usize> = observations
        .views
        .iter()
        .zip(&placed)
        .filter(|(_, pose)| pose.is_some())
        .map(|(view, _)| observations.poses[view.pose_idx])
        .collect();
    if kept.len() < needed_poses(observations) {
        return Err(InitError::TooFewPoses {
            camera_idx,
            have: kept.len(),
        });
    }
    let used = observations.with_poses(|pose| kept.contains(&pose));
    let sensor = field.sensor;
    let poses = placed.iter().flatten().copied().collect();
    let adjusted = adjust_cubic(&used, field, poses, 3, 10);
    let limit_px = MAX_MEDIAN_PER_WIDTH * f64::from(sensor.width);
    match adjusted {
        Some((model, median_px)) if median_px <= limit_px => {
            let mut refined = model.rig_from_board.into_iter();
            let camera_from_board = placed
                .iter()
                .map(|pose| pose.and_then(|_| refined.next()))
                .collect();
            let field = model
                .cameras
                .into_iter()
                .next()
                .map(|camera| camera.field)
                .ok_or(InitError::TooFewPoses {
                    camera_idx,
                    have: 0,
                })?;
            Ok(CameraStart {
                field,
                camera_from_board,
                median_px,
            })
        }
        other => Err(InitError::NoLens {
            camera_idx,
            median_px: other.map_or(f64::INFINITY, |(_, median_px)| median_px),
            sensor,
        }),
    }
}
