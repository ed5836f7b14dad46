//! What the steps found, put into the record.

use super::left_out::{left_out, renumbered};
use super::parts::Parts;
use crate::methods::solution::Solution;
use crate::report::facts::working_distance;
use crate::report::nearest_pinhole::NearestPinhole;
use crate::report::record::{
    Calibration, CameraRecord, CornerRecord, EstimateRecord, HeldOutRecord, PoseRecord, SCHEMA,
    StageAxis,
};
use calib_exchange::{Distortion, nearest_pinholes};
use calib_judge::neighbor_noise::neighbor_noise_mm;
use calib_judge::verdict::{Figures, judge};
use calib_judge::{HeldOut, fit_stage_axes};
use calib_rays::numerics::rms;
use calib_recording::dataset::CameraSpec;
use calib_recording::dataset::identity::input_sha256;
use calib_recording::dataset::stage;
use nalgebra::Vector2;

/// The record of a calibration.
pub fn record(parts: &Parts) -> Calibration {
    let names: Vec<String> = parts
        .dataset
        .cameras
        .iter()
        .map(|c| c.name.clone())
        .collect();
    let solution = parts.solution;
    let rig = solution.rig.clone();
    let corners = corner_records(solution);
    let poses = pose_records(parts, rig.cameras.len());
    let summary = estimate_record(solution, &corners);
    let held_out = held_out_record(parts);
    let verdict = judge(&figures(parts, &summary), parts.thresholds).with_causes(parts.causes);
    let mut calibration = Calibration {
        schema: SCHEMA.to_string(),
        tool_version: env!("CARGO_PKG_VERSION").to_string(),
        command: None,
        method: solution.method.to_string(),
        input_sha256: input_sha256(parts.dataset, &parts.corners.views),
        board: parts.dataset.board.clone(),
        known_poses: parts.observations.known_poses.clone(),
        certificate: parts.dataset.certificate,
        recording: parts.dataset.recording.clone(),
        cameras: parts.dataset.cameras.iter().map(camera_record).collect(),
        board_shape: solution.board_shape.clone(),
        stage_axes: stage_axes(parts, &poses),
        poses,
        rig,
        corners,
        left_out: left_out(parts, &names),
        renumbered: renumbered(&solution.findings, &names),
        estimate: summary,
        choices: solution.choices.clone(),
        alternating: solution.alternating.clone(),
        held_out,
        checks: parts.checks.cloned(),
        causes: parts.causes.to_vec(),
        task: parts.task.cloned(),
        imported: None,
        verdict,
        nearest_pinholes: Vec::new(),
    };
    calibration.nearest_pinholes = pinholes(&calibration);
    calibration
}

/// The cameras as pinholes; none where one of them has no pinhole near it.
fn pinholes(calibration: &Calibration) -> Vec<NearestPinhole> {
    let Some(distance) = working_distance(calibration) else {
        return Vec::new();
    };
    let forms = [Distortion::Five, Distortion::Eight];
    nearest_pinholes(&calibration.rig, distance.median, &forms).map_or_else(
        |_| Vec::new(),
        |found| {
            let cameras = found.cameras.iter();
            cameras
                .map(|camera| NearestPinhole::new(camera, found.distance_mm))
                .collect()
        },
    )
}

fn camera_record(camera: &CameraSpec) -> CameraRecord {
    CameraRecord {
        name: camera.name.clone(),
        serial: camera.serial.clone(),
        optics: camera.optics,
    }
}

/// What the verdict judges.
fn figures(parts: &Parts, summary: &EstimateRecord) -> Figures {
    let solution = parts.solution;
    let rig = &solution.rig;
    let residuals = solution.residuals.iter().flatten().flatten();
    let all: Vec<f64> = residuals.map(nalgebra::Matrix::norm).collect();
    let sigma_px = summary.rms_px / 2f64.sqrt();
    let neighbors_mm = rms(&parts.held_out.boards.neighbor_errors)
        .map(|error| error * parts.dataset.board.square_mm)
        .zip(neighbor_noise_mm(rig, &solution.observations, sigma_px));
    let halves = parts
        .checks
        .iter()
        .flat_map(|checks| checks.compared_halves());
    Figures {
        sigma_px: summary.sigma_px,
        all_sigma_px: rms(&all).unwrap_or(0.0) / 2f64.sqrt(),
        agreement: (parts.held_out.folds > 0).then_some(parts.agreement),
        mm_per_px: parts.mm_per_px,
        left_open_mm: parts.left_open_mm,
        neighbors_mm,
        halves: halves.map(|(split, half)| (split, *half)).collect(),
        corners: (summary.corners_used, summary.corners_rejected),
        suspect_views: (solution.findings.len(), parts.observations.views.len()),
        pose_count: (!solution.observations.may_be_one_pose()).then(|| solution.pose_count()),
        is_central: rig.cameras.iter().all(|camera| camera.field.is_central()),
        settled: solution.settled,
    }
}

fn corner_records(solution: &Solution) -> Vec<CornerRecord> {
    let mut records = Vec::new();
    for ((view, residuals), weights) in solution
        .observations
        .views
        .iter()
        .zip(&solution.residuals)
        .zip(&solution.robust_weights)
    {
        for ((corner, residual), weight) in view.corners.iter().zip(residuals).zip(weights) {
            records.push(CornerRecord {
                camera_idx: view.camera_idx,
                pose: solution.observations.poses[view.pose_idx],
                row: corner.row,
                col: corner.col,
                observed: corner.pixel,
                // A corner that no ray predicts has weight 0 and no residual to speak of.
                residual_px: residual.unwrap_or_else(Vector2::zeros),
                weight: *weight,
            });
        }
    }
    records
}

fn estimate_record(solution: &Solution, corners: &[CornerRecord]) -> EstimateRecord {
    let used: Vec<f64> = corners
        .iter()
        .filter(|c| c.weight > 0.0)
        .map(|c| c.residual_px.norm())
        .collect();
    EstimateRecord {
        cost_per_iteration: solution.costs.clone(),
        stop_reason: solution.stop_reason.clone(),
        sigma_px: solution.sigma_px,
        rms_px: rms(&used).unwrap_or(0.0),
        corners_used: used.len(),
        corners_rejected: solution.rejected_count(),
    }
}

fn held_out_record(parts: &Parts) -> Option<HeldOutRecord> {
    let held_out: &HeldOut = parts.held_out;
    if held_out.folds == 0 {
        return None;
    }
    let mut lengths = held_out.residuals_px.clone();
    lengths.sort_by(f64::total_cmp);
    Some(HeldOutRecord {
        folds: held_out.folds,
        failed_folds: held_out.failed.len(),
        fold_failures: held_out.failed.clone(),
        rms_px: rms(&lengths),
        median_px: lengths.get(lengths.len() / 2).copied(),
        neighbor_rms_percent: rms(&held_out.boards.neighbor_errors).map(|e| 100.0 * e),
        rigid_rms_mm: rms(&held_out.boards.rigid_errors_mm),
        point_count: held_out.boards.point_count,
        outside_count: held_out.outside_count,
        agreement: Some(parts.agreement),
    })
}

fn pose_records(parts: &Parts, camera_count: usize) -> Vec<PoseRecord> {
    let solution = parts.solution;
    let all_poses = calib_rays::observed::poses(&parts.corners.views);
    solution
        .rig_from_board
        .iter()
        .enumerate()
        .map(|(pose_idx, rig_from_board)| {
            let pose = solution.observations.poses[pose_idx];
            let rms_px = (0..camera_count)
                .map(|camera_idx| {
                    let view = solution
                        .observations
                        .views
                        .iter()
                        .position(|v| v.camera_idx == camera_idx && v.pose_idx == pose_idx)?;
                    let used: Vec<f64> = solution.residuals[view]
                        .iter()
                        .zip(&solution.robust_weights[view])
                        .filter(|(_, weight)| **weight > 0.0)
                        .filter_map(|(residual, _)| residual.map(|r| r.norm()))
                        .collect();
                    rms(&used)
                })
                .collect();
            PoseRecord {
                pose,
                rig_from_board: *rig_from_board,
                rms_px,
                stage_angle_deg: stage::entry(parts.dataset, &all_poses, pose).angle_deg,
            }
        })
        .collect()
}

fn stage_axes(parts: &Parts, poses: &[PoseRecord]) -> Vec<StageAxis> {
    let all_poses = calib_rays::observed::poses(&parts.corners.views);
    let boards: Vec<_> = poses.iter().map(|p| (p.pose, p.rig_from_board)).collect();
    fit_stage_axes(&boards, |pose| {
        stage::entry(parts.dataset, &all_poses, pose).placement
    })
}
