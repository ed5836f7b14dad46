//! The few numbers that stand at the top of every summary: on the page, on the terminal, in JSON.
//! Each is read or measured off the record; nothing is estimated here.

use super::nearest_pinhole::NearestPinhole;
use super::record::{Calibration, Cause, Grade};
use super::words;
use calib_judge::central_model::CentralModel;
use calib_judge::half_data::HalfDataCheck;
use serde::Serialize;
use std::collections::BTreeSet;

/// What a reader wants to know first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Facts {
    /// The judgement.
    pub verdict: Grade,
    /// Its reasons.
    pub reasons: Vec<String>,
    /// What was found about the recording, most likely first.
    pub causes: Vec<Cause>,
    /// RMS error of neighboring-corner distances on boards never seen, % of the square.
    pub held_out_neighbor_percent: Option<f64>,
    /// The same, mm.
    pub held_out_neighbor_mm: Option<f64>,
    /// RMS distance of triangulated corners from the rigid board, mm.
    pub held_out_rigid_mm: Option<f64>,
    /// RMS residual vector of held-out corners, px.
    pub held_out_rms_px: Option<f64>,
    /// RMS distance between the points of two calibrations from half of the poses, mm.
    pub half_data_mm: Option<f64>,
    /// The same over what their covariances predict.
    pub half_data_ratio: Option<f64>,
    /// RMS distance by which a central model would move points, mm; 0 if all cameras are central.
    pub central_model_mm: Option<f64>,
    /// RMS residual vector of the corners used, px.
    pub rms_px: f64,
    /// Noise per axis, px.
    pub sigma_px: f64,
    /// Cameras in the rig's order.
    pub cameras: Vec<CameraFacts>,
    /// Distance from the first camera to each other one, mm: of the pinholes nearest to their rays, if there are some.
    pub baseline_mm: Vec<f64>,
    /// Angle of the turn from the first of these pinholes to each other one, degrees; empty without them.
    pub axes_angle_deg: Vec<f64>,
    /// From the cameras to the boards.
    pub working_distance_mm: Option<Spread>,
    /// Poses used.
    pub poses_used: usize,
    /// Images (pose and camera) used.
    pub views_used: usize,
    /// Images or poses left out, each with a reason in the record.
    pub left_out: usize,
    /// Corners used.
    pub corners_used: usize,
    /// Corners rejected as outliers.
    pub corners_rejected: usize,
}

/// What a reader wants to know of one camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CameraFacts {
    /// Its name.
    pub name: String,
    /// Width and height of its sensor, px.
    pub sensor_px: [u32; 2],
    /// Share of the sensor that is calibrated, 0 to 1.
    pub covered_share: f64,
    /// Images used.
    pub views: usize,
    /// Focal lengths along u and v of the pinhole nearest to its rays, px.
    pub focal_px: Option<[f64; 2]>,
    /// Principal point of the same, px.
    pub principal_point_px: Option<[f64; 2]>,
    /// RMS distance of its pixels from those of the rays, px.
    pub pinhole_rms_px: Option<f64>,
    /// Whether all rays meet in one point by construction.
    pub central: bool,
    /// RMS distance of its rays from the point nearest to all, mm; 0 of a central camera.
    pub centrality_rms_mm: Option<f64>,
    /// Offset numbers that the data determine, and those that the model has; `None` of a central
    /// camera.
    pub offset_numbers: Option<(f64, usize)>,
}

/// Smallest, middle and largest of some lengths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Smallest.
    pub least: f64,
    /// Half are smaller.
    pub median: f64,
    /// Largest.
    pub most: f64,
}

impl Facts {
    /// Reads the facts off a record.
    pub fn of(calibration: &Calibration) -> Self {
        let held_out = calibration.held_out.as_ref();
        let neighbor_percent = held_out.and_then(|h| h.neighbor_rms_percent);
        let cameras = &calibration.rig.cameras;
        let views = views(calibration);
        let checks = calibration.checks.as_ref();
        let halves = checks.and_then(|checks| match &checks.half_data {
            HalfDataCheck::Compared(halves) => Some(halves),
            HalfDataCheck::Skipped(_) => None,
        });
        let choices = calibration.choices.as_ref();
        let all = calibration.nearest_pinholes.as_slice();
        let pinholes = if all.len() == cameras.len() { all } else { &[] };
        let pairs = |of: fn(&NearestPinhole, &NearestPinhole) -> f64| -> Vec<f64> {
            let others = pinholes.iter().skip(1);
            others.map(|other| of(&pinholes[0], other)).collect()
        };
        let place = |k: usize| cameras[k].rig_from_camera.translation_mm;
        Self {
            verdict: calibration.verdict.grade,
            reasons: calibration.verdict.reasons.clone(),
            causes: calibration.causes.clone(),
            held_out_neighbor_percent: neighbor_percent,
            held_out_neighbor_mm: neighbor_percent
                .map(|percent| percent / 100.0 * calibration.board.square_mm),
            held_out_rigid_mm: held_out.and_then(|h| h.rigid_rms_mm),
            held_out_rms_px: held_out.and_then(|h| h.rms_px),
            half_data_mm: halves.map(|halves| halves.difference_rms_mm),
            half_data_ratio: halves.map(|halves| halves.ratio),
            central_model_mm: checks.and_then(|checks| match checks.central_model {
                CentralModel::IsCentral { .. } | CentralModel::Declared { .. } => Some(0.0),
                CentralModel::Costs { points, .. } => points.map(|points| points.rms_mm),
                CentralModel::NoEstimate => None,
            }),
            rms_px: calibration.estimate.rms_px,
            sigma_px: calibration.estimate.sigma_px,
            cameras: cameras
                .iter()
                .enumerate()
                .map(|(camera_idx, camera)| CameraFacts {
                    name: camera.name.clone(),
                    sensor_px: [camera.field.sensor.width, camera.field.sensor.height],
                    covered_share: camera.coverage.covered_share(),
                    views: views.iter().filter(|(c, _)| *c == camera_idx).count(),
                    focal_px: pinholes.get(camera_idx).map(|p| p.focal_px),
                    principal_point_px: pinholes.get(camera_idx).map(|p| p.principal_point_px),
                    pinhole_rms_px: pinholes.get(camera_idx).map(|p| p.rms_px),
                    central: camera.field.is_central(),
                    centrality_rms_mm: checks
                        .and_then(|checks| checks.centrality.get(camera_idx))
                        .map(|found| found.rms_mm),
                    offset_numbers: choices
                        .and_then(|choices| words::offset_numbers(choices, camera_idx))
                        .map(|numbers| (numbers.effective, numbers.all)),
                })
                .collect(),
            baseline_mm: if pinholes.is_empty() {
                (1..cameras.len())
                    .map(|k| (place(k) - place(0)).norm())
                    .collect()
            } else {
                pairs(NearestPinhole::baseline_mm)
            },
            axes_angle_deg: pairs(NearestPinhole::turn_rad)
                .into_iter()
                .map(f64::to_degrees)
                .collect(),
            working_distance_mm: working_distance(calibration)
                .or_else(|| said_distance(calibration)),
            poses_used: pose_count(calibration),
            views_used: views.len(),
            left_out: calibration.left_out.len(),
            corners_used: calibration.estimate.corners_used,
            corners_rejected: calibration.estimate.corners_rejected,
        }
    }
}

/// The first camera and another one, `k` places after the next, in words.
pub fn pair(facts: &Facts, k: usize) -> String {
    let name = |idx: usize| facts.cameras.get(idx).map_or("", |c| c.name.as_str());
    let turn = facts.axes_angle_deg.get(k).map_or(String::new(), |angle| {
        format!(", turned by {angle:.3}\u{b0} (nearest pinholes)")
    });
    format!("from {} to {}{turn}", name(0), name(k + 1))
}

/// Camera and pose of every image used.
fn views(calibration: &Calibration) -> BTreeSet<(usize, usize)> {
    let corners = calibration.corners.iter();
    corners.map(|c| (c.camera_idx, c.pose)).collect()
}

/// Different poses: one whose views were split has a record for each.
fn pose_count(calibration: &Calibration) -> usize {
    let poses: BTreeSet<usize> = calibration.poses.iter().map(|p| p.pose).collect();
    poses.len()
}

/// Of a calibration without boards: what was said when it was imported.
fn said_distance(calibration: &Calibration) -> Option<Spread> {
    let mm = calibration.imported.as_ref()?.working_distance_mm?;
    Some(Spread {
        least: mm,
        median: mm,
        most: mm,
    })
}

/// From each camera to the middle of each board it saw.
pub fn working_distance(calibration: &Calibration) -> Option<Spread> {
    let views = views(calibration);
    let center_in_board = calibration.board.center_in_board();
    let mut distances: Vec<f64> = calibration
        .poses
        .iter()
        .flat_map(|pose| {
            let center_in_rig = pose.rig_from_board.point(&center_in_board);
            calibration
                .rig
                .cameras
                .iter()
                .enumerate()
                .filter(|(camera_idx, _)| views.contains(&(*camera_idx, pose.pose)))
                .map(move |(_, camera)| {
                    (center_in_rig - camera.rig_from_camera.translation_mm).norm()
                })
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    Some(Spread {
        least: *distances.first()?,
        median: *distances.get(distances.len() / 2)?,
        most: *distances.last()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::example;

    #[test]
    fn facts_of_the_example_are_those_it_was_made_with() {
        let facts = Facts::of(&example::calibration());
        assert!((facts.baseline_mm[0] - 200.0).abs() < 1e-9);
        assert_eq!(facts.poses_used, 33);
        // One view is missing.
        assert_eq!(facts.views_used, 65);
        assert_eq!(facts.cameras[1].views, 32);
        // 0.152 % of 10 mm.
        assert!((facts.held_out_neighbor_mm.unwrap() - 0.0152).abs() < 1e-12);
        // 410 mm straight ahead and 100 mm aside, give or take the stage's radius.
        let distance = facts.working_distance_mm.unwrap();
        assert!((distance.median - 422.0).abs() < 15.0, "{distance:?}");
        assert!(distance.least <= distance.median && distance.median <= distance.most);
    }
}
