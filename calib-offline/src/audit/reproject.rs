//! Each board placed with a calibration held fixed, and what is left in pixels: for each camera by itself, and one pose of a
//! board for all cameras that saw it.

use super::candidate::Candidate;
use super::record::rms;
use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::ViewBlock;
use calib_estimate::init::board_pose::fit_view;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use calib_rays::numerics::levenberg::{self, Problem, Tried};
use nalgebra::{Matrix6, Vector2, Vector3, Vector6};
use rayon::prelude::*;

const SEARCH: levenberg::Settings = levenberg::Settings {
    max_linearizations: 60,
    max_steps: 120,
    first_damping: 1e-6,
    least_damping: 1e-15,
    most_damping: 1e6,
    growth: 10.0,
    growth_from: 1e-8,
    singular_damping: 1.0,
    least_after_singular: 1e-9,
    accepts_equal: false,
};
/// A step that promises to lower the sum of squares by a smaller share is the last: RMS to ten digits.
const SETTLED: f64 = 1e-12;
/// Steps of the differences that stand for derivatives: rad and, times the distance, mm.
const DIFFERENCE: f64 = 1e-6;

/// A corner, and by how much it is missed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Missed {
    pub camera_idx: usize,
    pub pixel: PixelPoint,
    /// Observed minus predicted; `None` where the calibration has no pixel for it, or no pose for its board.
    pub residual_px: Option<Vector2<f64>>,
}

/// What is left with a calibration held fixed.
pub(super) struct Reprojected {
    /// With a pose for each view.
    pub alone: Vec<Missed>,
    /// RMS with one pose for all cameras that saw a board, of the boards that several saw.
    pub together_rms_px: Option<f64>,
    /// Corners behind it.
    pub together_corners: usize,
    /// Views whose board could not be placed.
    pub unplaced: usize,
}

/// Fits all boards.
pub(super) fn reproject(candidate: &Candidate, seen: &Observations) -> Reprojected {
    let starts: Vec<Option<RigidTransform>> = seen
        .views
        .par_iter()
        .map(|view| {
            let camera = &candidate.rig.cameras[view.camera_idx];
            let fit = fit_view(&camera.field, &seen.board, &candidate.board_shape, view)?;
            Some(camera.rig_from_camera * fit.camera_from_board)
        })
        .collect();
    let alone: Vec<Vec<Missed>> = seen
        .views
        .par_iter()
        .zip(&starts)
        .map(|(view, start)| missed(candidate, seen, &[view], start.as_ref()))
        .collect();
    let mut together = Vec::new();
    if candidate.has_places {
        let boards: Vec<Vec<Missed>> = (0..seen.poses.len())
            .into_par_iter()
            .filter_map(|pose_idx| {
                let own = seen.views.iter().zip(&starts);
                let own: Vec<_> = own.filter(|(view, _)| view.pose_idx == pose_idx).collect();
                let views: Vec<&ViewBlock> = own.iter().map(|(view, _)| *view).collect();
                let largest = own
                    .iter()
                    .filter(|(_, start)| start.is_some())
                    .max_by_key(|(view, _)| view.corners.len())?;
                (views.len() > 1).then(|| missed(candidate, seen, &views, largest.1.as_ref()))
            })
            .collect();
        together = boards.concat();
    }
    let lengths: Vec<f64> = together
        .iter()
        .filter_map(|m| Some(m.residual_px?.norm()))
        .collect();
    Reprojected {
        alone: alone.concat(),
        together_rms_px: rms(&lengths),
        together_corners: lengths.len(),
        unplaced: starts.iter().filter(|start| start.is_none()).count(),
    }
}

/// The corners of views of one board, by the pose that fits all of them best.
fn missed(
    candidate: &Candidate,
    seen: &Observations,
    views: &[&ViewBlock],
    start: Option<&RigidTransform>,
) -> Vec<Missed> {
    let mut all: Vec<Missed> = Vec::new();
    let mut points: Vec<Vector3<f64>> = Vec::new();
    for view in views {
        for corner in &view.corners {
            let flat = seen.board.corner_in_board(corner.row, corner.col);
            let height_mm = candidate.board_shape.height_mm(&seen.board, &flat);
            points.push(flat + Vector3::z() * height_mm);
            all.push(Missed {
                camera_idx: view.camera_idx,
                pixel: corner.pixel,
                residual_px: None,
            });
        }
    }
    let Some(start) = start else {
        return all;
    };
    let camera_from_rig: Vec<RigidTransform> = candidate
        .rig
        .cameras
        .iter()
        .map(|camera| camera.rig_from_camera.inverse())
        .collect();
    let residual = |pose: &RigidTransform, missed: &Missed, point: &Vector3<f64>| {
        let in_camera = camera_from_rig[missed.camera_idx].point(&pose.point(point));
        let pixel = candidate.project(missed.camera_idx, &in_camera)?;
        Some(Vector2::new(
            missed.pixel.u - pixel.u,
            missed.pixel.v - pixel.v,
        ))
    };
    let taking_part: Vec<usize> = (0..all.len())
        .filter(|k| residual(start, &all[*k], &points[*k]).is_some())
        .collect();
    let residuals = |pose: &RigidTransform| -> Option<Vec<Vector2<f64>>> {
        let found = taking_part
            .iter()
            .map(|k| residual(pose, &all[*k], &points[*k]));
        found.collect()
    };
    let first = views.first().map_or(0, |view| view.camera_idx);
    let distance_mm = camera_from_rig[first]
        .point(&start.point(&seen.board.center_in_board()))
        .norm();
    let fit = PoseFit {
        residuals: &residuals,
        distance_mm,
    };
    let pose = levenberg::minimize(&fit, *start, &SEARCH).state;
    if let Some(found) = residuals(&pose) {
        for (k, residual) in taking_part.iter().zip(found) {
            all[*k].residual_px = Some(residual);
        }
    }
    all
}

struct PoseFit<'a> {
    residuals: &'a dyn Fn(&RigidTransform) -> Option<Vec<Vector2<f64>>>,
    distance_mm: f64,
}

impl PoseFit<'_> {
    fn moved_by(&self, pose: &RigidTransform, change: &Vector6<f64>) -> RigidTransform {
        let turn = change.fixed_rows::<3>(0).into_owned();
        let shift_mm = change.fixed_rows::<3>(3) * self.distance_mm;
        pose.perturbed(&turn, &shift_mm)
    }
}

impl Problem for PoseFit<'_> {
    type State = RigidTransform;
    /// The normal matrix and the gradient.
    type Equations = (Matrix6<f64>, Vector6<f64>);
    type Step = Vector6<f64>;

    fn cost(&self, pose: &RigidTransform) -> f64 {
        let found = (self.residuals)(pose);
        found.map_or(f64::INFINITY, |all| {
            all.iter().map(Vector2::norm_squared).sum()
        })
    }

    fn linearize(&self, pose: &RigidTransform) -> Option<Self::Equations> {
        let here = (self.residuals)(pose)?;
        let mut columns = Vec::new();
        for k in 0..6 {
            let at = |step: f64| (self.residuals)(&self.moved_by(pose, &Vector6::ith(k, step)));
            let (more, less) = (at(DIFFERENCE)?, at(-DIFFERENCE)?);
            let column: Vec<Vector2<f64>> = more
                .iter()
                .zip(&less)
                .map(|(more, less)| (more - less) / (2.0 * DIFFERENCE))
                .collect();
            columns.push(column);
        }
        let mut normal = Matrix6::zeros();
        let mut gradient = Vector6::zeros();
        for (i, a) in columns.iter().enumerate() {
            gradient[i] = a.iter().zip(&here).map(|(a, r)| a.dot(r)).sum();
            for (j, b) in columns.iter().enumerate() {
                normal[(i, j)] = a.iter().zip(b).map(|(a, b)| a.dot(b)).sum();
            }
        }
        Some((normal, gradient))
    }

    fn step(&self, (normal, gradient): &Self::Equations, damping: f64) -> Option<Vector6<f64>> {
        let damped = normal + Matrix6::from_diagonal(&(normal.diagonal() * damping));
        Some(-damped.cholesky()?.solve(gradient))
    }

    fn moved(&self, pose: &RigidTransform, step: &Vector6<f64>) -> Option<RigidTransform> {
        Some(self.moved_by(pose, step).orthonormalized())
    }

    fn is_settled(&self, tried: &Tried<Self>) -> bool {
        let (_, gradient) = tried.equations;
        -gradient.dot(tried.step) <= SETTLED * tried.cost
    }
}
