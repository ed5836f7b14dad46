//! Views judged once more when the fields are known well: at the start a cubic field hides what is
//! small, and can make a good view look bad.

use super::error::EstimateError;
use super::estimate::{Estimate, estimate};
use crate::adjust::Observations;
use crate::init::pair_consensus::FINE_LIMIT_SIGMA;
use crate::init::rig::RigStart;
use crate::init::screening::{Finding, screen};
use calib_rays::field::RayField;

/// Estimates again, at most so often, as long as the judgement of the views changes.
const MOST_REPEATS: usize = 2;

/// The estimate of all views that agree with each other, and what was found about the others.
///
/// `offered` is everything that may go in; the screening of the start is repeated through the
/// fields of the estimate, and if it comes to another judgement, so is the estimate.
///
/// # Errors
/// What [`estimate`] says.
pub fn estimate_screened(
    offered: &Observations,
    start: RigStart,
) -> Result<(Estimate, Vec<Finding>), EstimateError> {
    let mut start = start;
    let mut found = estimate(&start.observations, &start)?;
    // A view of a known pose contradicts no other view, only what is known.
    let repeats = if offered.known_poses.is_empty() {
        MOST_REPEATS
    } else {
        0
    };
    for _ in 0..repeats {
        let fields: Vec<&RayField> = found.model.cameras.iter().map(|c| &c.field).collect();
        // Where the cameras contradict each other through the better fields, the start stands.
        let Ok(again) = screen(offered, &fields, &found.model.board_shape, FINE_LIMIT_SIGMA) else {
            break;
        };
        let unchanged = same_judgement(&again.findings, &start.findings);
        start.findings = again.findings;
        if unchanged {
            break;
        }
        start.observations = again.observations;
        start.camera_from_rig = again.camera_from_rig;
        start.rig_from_board = again.rig_from_board;
        found = estimate(&start.observations, &start)?;
    }
    Ok((found, start.findings))
}

/// Whether the same was done to the same views, whatever the figures.
fn same_judgement(a: &[Finding], b: &[Finding]) -> bool {
    let what = |finding: &Finding| {
        (
            finding.pose,
            finding.camera_idx,
            std::mem::discriminant(&finding.kind),
        )
    };
    a.iter().map(what).eq(b.iter().map(what))
}
