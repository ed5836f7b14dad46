//! What did not go into the estimate as it was recorded, and why, for the record.

use super::parts::Parts;
use crate::methods::solution::{Unused, unused};
use crate::report::record::{LeftOut, Renumbered};
use calib_estimate::init::screening::{Finding, FindingKind};
use calib_judge::plausibility::Explained;
use calib_recording::capture::known_without_corners;
use calib_recording::detect::verdict::Outcome;

/// Poses, views and corners that did not go in.
pub fn left_out(parts: &Parts, names: &[String]) -> Vec<LeftOut> {
    let mut list: Vec<LeftOut> = Vec::new();
    for pose in &parts.dataset.excluded_poses {
        let corner_count = parts
            .corners
            .views
            .iter()
            .filter(|view| view.pose == *pose)
            .map(|view| view.corners.len())
            .sum();
        list.push(LeftOut {
            pose: *pose,
            camera: None,
            corner_count,
            reason: "excluded by the user".to_string(),
        });
    }
    for pose in known_without_corners(parts.dataset, &parts.corners.views) {
        list.push(LeftOut {
            pose,
            camera: None,
            corner_count: 0,
            reason: "its place is known, but no camera has corners of it".to_string(),
        });
    }
    let solution = parts.solution;
    for (pose_idx, pose) in parts.observations.poses.iter().enumerate() {
        let is_named = parts
            .solution
            .findings
            .iter()
            .any(|finding| finding.pose == *pose);
        if !is_named && solution.observations.poses.binary_search(pose).is_err() {
            let views = parts.observations.views.iter();
            list.push(LeftOut {
                pose: *pose,
                camera: None,
                corner_count: views
                    .filter(|view| view.pose_idx == pose_idx)
                    .map(|view| view.corners.len())
                    .sum(),
                reason: "no camera sees enough of the board to place it".to_string(),
            });
        }
    }
    let views = solution.observations.views.iter();
    let found = solution.residuals.iter().zip(&solution.robust_weights);
    for (view, (residuals, weights)) in views.zip(found) {
        let Unused {
            rejected,
            without_ray,
        } = unused(residuals, weights);
        for (corner_count, why) in [
            (rejected, "rejected as outliers"),
            (
                without_ray,
                "cannot be judged: outside the calibrated area, or behind the camera",
            ),
        ] {
            if corner_count > 0 {
                list.push(LeftOut {
                    pose: solution.observations.poses[view.pose_idx],
                    camera: Some(names[view.camera_idx].clone()),
                    corner_count,
                    reason: format!("{corner_count} of {} corners {why}", weights.len()),
                });
            }
        }
    }
    list.extend(
        parts
            .solution
            .findings
            .iter()
            .filter_map(|f| screened_out(f, parts.explained, names)),
    );
    for image in parts.corners.detection.iter().flat_map(|d| &d.images) {
        if let Outcome::Refused(refusal) = &image.outcome {
            list.push(LeftOut {
                pose: image.pose,
                camera: Some(names[image.camera_idx].clone()),
                corner_count: 0,
                reason: refusal.to_string(),
            });
        }
    }
    list
}

/// What the screening left out; `None` for a view that is used as it should be.
fn screened_out(finding: &Finding, explained: &[Explained], names: &[String]) -> Option<LeftOut> {
    let (corner_count, reason) = match &finding.kind {
        FindingKind::Misfit {
            median_px,
            typical_px,
        } => (
            finding.corner_count,
            format!(
                "the whole view misses by {median_px:.2} px (median; {typical_px:.2} px in other \
                 views): {}",
                reading_that_fits(finding, explained, names).unwrap_or_else(|| {
                    "the board moved during the exposure, is bent, or is another one".to_owned()
                })
            ),
        ),
        FindingKind::Unsynchronized {
            other_camera_idx,
            misfit_px,
            typical_px,
        } => (
            0,
            format!(
                "not the same board position as in camera {} ({misfit_px:.2} px apart, other pairs \
                 {typical_px:.2} px): {}; left out as a pair, each view used for its own camera",
                names[*other_camera_idx],
                reading_that_fits(finding, explained, names)
                    .unwrap_or_else(|| "not exposed at the same instant".to_owned())
            ),
        ),
        FindingKind::Renumbered { .. } => return None,
    };
    Some(LeftOut {
        pose: finding.pose,
        camera: Some(names[finding.camera_idx].clone()),
        corner_count,
        reason,
    })
}

/// Another reading of one of the pose's views, if one makes them fit.
fn reading_that_fits(
    finding: &Finding,
    explained: &[Explained],
    names: &[String],
) -> Option<String> {
    let view = explained.iter().find(|view| view.pose == finding.pose)?;
    let camera = &names[view.camera_idx];
    Some(format!(
        "they fit with that of camera {camera} {}",
        view.reading
    ))
}

/// Views whose board was numbered from the other end.
pub fn renumbered(findings: &[Finding], names: &[String]) -> Vec<Renumbered> {
    findings
        .iter()
        .filter_map(|finding| match &finding.kind {
            FindingKind::Renumbered {
                other_camera_idx, ..
            } => Some(Renumbered {
                pose: finding.pose,
                camera: names[finding.camera_idx].clone(),
                reason: format!(
                    "numbered from the other end of the board than in camera {}; renumbered, and \
                     used",
                    names[*other_camera_idx]
                ),
            }),
            _ => None,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn a_corner_without_a_ray_is_no_outlier() {
        let residual = Some(Vector2::new(3.0, 4.0));
        let found = unused(
            &[residual, None, residual, None, None],
            &[1.0, 0.0, 0.0, 0.0, 0.0],
        );
        let expected = Unused {
            rejected: 1,
            without_ray: 3,
        };
        assert_eq!(found, expected);
    }
}
