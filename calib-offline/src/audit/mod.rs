//! Calibrations by anybody, judged on a recording: in pixels by their own models, in millimeters by the rigid board, and
//! beside what our own estimate makes of the same images.

mod candidate;
mod common;
mod ours;
pub mod record;
mod regions;
mod reproject;
pub mod words;

pub use candidate::{Candidate, Sees};
pub use record::{Audit, SCHEMA};

use crate::pipeline::Corners;
use calib_estimate::adjust::Observations;
use calib_judge::held_out::measure_boards;
use calib_rays::measure::RigSource;
use calib_rays::progress::Progress;
use calib_recording::dataset::Dataset;
use calib_recording::dataset::identity::input_sha256;
use calib_recording::dataset::split::without_excluded;
use record::{Audited, AuditedCamera, PointFigures};
use reproject::Reprojected;

/// Judges calibrations on a recording's corners; `candidates` have the recording's cameras, in its order. So many `folds` are
/// used for our own estimate's held-out check.
///
/// Figures in pixels take every corner, outliers too, as other tools' own figures do.
///
/// Cost: that of `folds` + 1 estimates, and some milliseconds a view.
pub fn audit(
    dataset: &Dataset,
    corners: &Corners,
    candidates: &[Candidate],
    folds: usize,
    progress: &dyn Progress,
) -> Audit {
    let views = without_excluded(corners.views.clone(), &dataset.excluded_poses).used;
    let sensors = dataset.cameras.iter().map(|camera| camera.sensor).collect();
    let seen = Observations::new(dataset.board.clone(), sensors, &views);
    progress.begin("their figures", candidates.len());
    let mut calibrations: Vec<Audited> = candidates
        .iter()
        .map(|candidate| {
            let found = figures(candidate, &seen);
            progress.advance();
            found
        })
        .collect();
    progress.end();
    let ours = ours::estimate(dataset, corners, folds, progress);
    let mut own = ours
        .as_ref()
        .ok()
        .map(|ours| figures(&ours.candidate, &seen));
    let (mut fold_count, mut common_corners) = (0, 0);
    if let (Ok(ours), Some(own)) = (&ours, &mut own) {
        let common = common::judge(&ours.folds, candidates);
        (fold_count, common_corners) = (ours.folds.estimated.len(), common.corners);
        own.common = common.ours;
        for (calibration, (common, ratios)) in calibrations.iter_mut().zip(common.theirs) {
            calibration.common = common;
            calibration.against_ours = ratios;
        }
    }
    let mut audit = Audit {
        schema: SCHEMA,
        tool_version: env!("CARGO_PKG_VERSION"),
        input_sha256: input_sha256(dataset, &corners.views),
        square_mm: seen.board.square_mm,
        poses: seen.different_pose_count(),
        views: seen.views.len(),
        corners: seen.corner_count(),
        folds: fold_count,
        common_corners,
        calibrations,
        ours: own,
        no_estimate: ours.err(),
        conclusion: Vec::new(),
    };
    audit.conclusion = words::conclude(&audit);
    audit
}

/// The figures of one calibration.
fn figures(candidate: &Candidate, seen: &Observations) -> Audited {
    let Reprojected {
        alone,
        together_rms_px,
        together_corners,
        unplaced,
    } = reproject::reproject(candidate, seen);
    let cameras = candidate.rig.cameras.iter().enumerate();
    let cameras: Vec<AuditedCamera> = cameras
        .map(|(camera_idx, camera)| {
            let own: Vec<_> = alone
                .iter()
                .filter(|r| r.camera_idx == camera_idx)
                .collect();
            let residuals: Vec<_> = own
                .iter()
                .filter_map(|r| Some((r.pixel, r.residual_px?)))
                .collect();
            let lengths: Vec<f64> = residuals.iter().map(|(_, r)| r.norm()).collect();
            AuditedCamera {
                name: camera.name.clone(),
                model: candidate.models[camera_idx].clone(),
                corners: residuals.len(),
                unanswered: own.len() - residuals.len(),
                rms_px: record::rms(&lengths),
                median_px: calib_rays::numerics::median(lengths.iter().copied()),
                regions: regions::regions(camera.field.sensor, &residuals),
            }
        })
        .collect();
    let all: Vec<f64> = alone
        .iter()
        .filter_map(|r| Some(r.residual_px?.norm()))
        .collect();
    Audited {
        title: candidate.title.clone(),
        files: candidate.files.clone(),
        saw_these: candidate.saw_these,
        rms_px: record::rms(&all),
        together_rms_px,
        together_corners,
        unplaced_views: unplaced,
        cameras,
        points: points(candidate, seen),
        common: None,
        against_ours: None,
    }
}

/// What it measures of the boards that two cameras saw.
fn points(candidate: &Candidate, seen: &Observations) -> Option<PointFigures> {
    if !candidate.has_places || candidate.rig.cameras.len() < 2 {
        return None;
    }
    // Without a frame there is always a source.
    let boards = measure_boards(&RigSource::new(&candidate.rig, None)?, seen);
    let count = boards.neighbor_errors.len().max(1) as f64;
    let scale = boards.neighbor_errors.iter().sum::<f64>() / count;
    let neighbor = record::rms(&boards.neighbor_errors);
    let unanswered = boards.outside_count + boards.unmet_count;
    (boards.point_count + unanswered > 0).then(|| PointFigures {
        points: boards.point_count,
        unanswered,
        neighbor_rms_mm: neighbor.map(|share| share * seen.board.square_mm),
        scale_percent: neighbor.map(|_| 100.0 * scale),
        rigid_rms_mm: record::rms(&boards.rigid_errors_mm),
    })
}
