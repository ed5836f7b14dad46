//! What the steps found, put into the record.

use super::Corners;
use super::left_out::{left_out, renumbered};
use crate::adjust::Observations;
use crate::adjust::StopReason;
use crate::dataset::identity::input_sha256;
use crate::dataset::{Dataset, stage};
use crate::evaluate::half_data::HalfDataCheck;
use crate::evaluate::verdict::{Figures, Thresholds, judge};
use crate::evaluate::{CrossChecks, HeldOut, fit_stage_axes};
use crate::field::Rig;
use crate::init::screening::Finding;
use crate::joint::Estimate;
use crate::report::record::{
    Calibration, ChoicesRecord, CornerRecord, EstimateRecord, HeldOutRecord, PoseRecord, SCHEMA,
    StageAxis,
};
use nalgebra::Vector2;

/// Results of all steps.
pub struct Parts<'a> {
    /// The dataset.
    pub dataset: &'a Dataset,
    /// All corners, excluded poses included.
    pub corners: &'a Corners,
    /// What was offered to the estimate.
    pub observations: &'a Observations,
    /// What it made of it.
    pub estimate: &'a Estimate,
    /// The rig that it gave.
    pub rig: Rig,
    /// What was found wrong with views.
    pub findings: &'a [Finding],
    /// Peak to valley of the board's shape and its standard deviation, mm.
    pub board_peak_to_valley_mm: (f64, f64),
    /// The check on unseen boards.
    pub held_out: &'a HeldOut,
    /// The checks against itself.
    pub checks: CrossChecks,
    /// What counts as good.
    pub thresholds: &'a Thresholds,
}

/// The record of a calibration.
pub fn record(parts: &Parts) -> Calibration {
    let names: Vec<String> = parts
        .dataset
        .cameras
        .iter()
        .map(|c| c.name.clone())
        .collect();
    let estimate = parts.estimate;
    let rig = parts.rig.clone();
    let corners = corner_records(estimate);
    let poses = pose_records(parts, rig.cameras.len());
    let summary = estimate_record(estimate, &corners);
    let held_out = held_out_record(parts.held_out);
    let verdict = judge(
        &Figures {
            sigma_px: summary.sigma_px,
            rms_px: summary.rms_px,
            held_out_rms_px: held_out.as_ref().and_then(|h| h.rms_px),
            neighbor_rms_percent: held_out.as_ref().and_then(|h| h.neighbor_rms_percent),
            half_data_ratio: match &parts.checks.half_data {
                HalfDataCheck::Compared(halves) => Some(halves.ratio),
                HalfDataCheck::Skipped(_) => None,
            },
            corners: (summary.corners_used, summary.corners_rejected),
            suspect_views: (parts.findings.len(), parts.observations.views.len()),
            pose_count: estimate.pose_count(),
            covered_share: rig
                .cameras
                .iter()
                .map(|c| (c.name.clone(), c.coverage.covered_share()))
                .collect(),
            settled: matches!(
                estimate.stop,
                StopReason::Converged | StopReason::NoFurtherDecrease
            ),
        },
        parts.thresholds,
    );
    Calibration {
        schema: SCHEMA.to_string(),
        tool_version: env!("CARGO_PKG_VERSION").to_string(),
        method: "joint".to_string(),
        input_sha256: input_sha256(parts.dataset, &parts.corners.views),
        board: parts.dataset.board,
        board_shape: estimate.model.board_shape.clone(),
        stage_axes: stage_axes(parts, &poses),
        poses,
        rig,
        corners,
        left_out: left_out(parts, &names),
        renumbered: renumbered(parts.findings, &names),
        estimate: summary,
        choices: Some(choices(parts)),
        held_out,
        checks: Some(parts.checks.clone()),
        verdict,
    }
}

fn corner_records(estimate: &Estimate) -> Vec<CornerRecord> {
    let mut records = Vec::new();
    for ((view, residuals), weights) in estimate
        .observations
        .views
        .iter()
        .zip(&estimate.residuals)
        .zip(&estimate.robust_weights)
    {
        for ((corner, residual), weight) in view.corners.iter().zip(residuals).zip(weights) {
            records.push(CornerRecord {
                camera_idx: view.camera_idx,
                pose: estimate.observations.poses[view.pose_idx],
                row: corner.row,
                col: corner.col,
                observed: corner.pixel,
                // A corner behind its camera has weight 0 and no residual to speak of.
                residual_px: residual.unwrap_or_else(Vector2::zeros),
                weight: *weight,
            });
        }
    }
    records
}

fn estimate_record(estimate: &Estimate, corners: &[CornerRecord]) -> EstimateRecord {
    let used: Vec<f64> = corners
        .iter()
        .filter(|c| c.weight > 0.0)
        .map(|c| c.residual_px.norm())
        .collect();
    EstimateRecord {
        cost_per_iteration: estimate.costs.clone(),
        stop_reason: estimate.stop.to_string(),
        sigma_px: estimate.noise.variance_px2.sqrt(),
        rms_px: rms(&used).unwrap_or(0.0),
        corners_used: used.len(),
        corners_rejected: corners.len() - used.len(),
    }
}

fn choices(parts: &Parts) -> ChoicesRecord {
    let estimate = parts.estimate;
    let (board_peak_to_valley_mm, board_peak_to_valley_sd_mm) = parts.board_peak_to_valley_mm;
    ChoicesRecord {
        tried: estimate.choices.clone(),
        smoothness: estimate.smoothness.clone(),
        noise_freedom: estimate.noise.freedom,
        neighbor_correlation: estimate.neighbor_correlation,
        effective_share: estimate.effective_share,
        board_peak_to_valley_mm,
        board_peak_to_valley_sd_mm,
    }
}

fn held_out_record(held_out: &HeldOut) -> Option<HeldOutRecord> {
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
    })
}

fn pose_records(parts: &Parts, camera_count: usize) -> Vec<PoseRecord> {
    let estimate = parts.estimate;
    let all_poses = crate::dataset::corners::poses(&parts.corners.views);
    estimate
        .rig_from_board()
        .into_iter()
        .enumerate()
        .map(|(pose_idx, rig_from_board)| {
            let pose = estimate.observations.poses[pose_idx];
            let rms_px = (0..camera_count)
                .map(|camera_idx| {
                    let view = estimate
                        .observations
                        .views
                        .iter()
                        .position(|v| v.camera_idx == camera_idx && v.pose_idx == pose_idx)?;
                    let used: Vec<f64> = estimate.residuals[view]
                        .iter()
                        .zip(&estimate.robust_weights[view])
                        .filter(|(_, weight)| **weight > 0.0)
                        .filter_map(|(residual, _)| residual.map(|r| r.norm()))
                        .collect();
                    rms(&used)
                })
                .collect();
            PoseRecord {
                pose,
                rig_from_board,
                rms_px,
                stage_angle_deg: stage::entry(parts.dataset, &all_poses, pose).angle_deg,
            }
        })
        .collect()
}

fn stage_axes(parts: &Parts, poses: &[PoseRecord]) -> Vec<StageAxis> {
    let all_poses = crate::dataset::corners::poses(&parts.corners.views);
    fit_stage_axes(poses, |pose| {
        stage::entry(parts.dataset, &all_poses, pose).placement
    })
}

/// Root mean square; `None` of nothing.
fn rms(values: &[f64]) -> Option<f64> {
    (!values.is_empty())
        .then(|| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt())
}
