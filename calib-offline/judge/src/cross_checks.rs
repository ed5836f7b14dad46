//! Checks of a calibration against itself, beside the one on held-out boards.

use super::central_model::{CentralModel, central_model};
use super::centrality::{Centrality, centrality};
use super::half_data::{HalfDataCheck, Skipped, estimate_halves};
use super::working_volume::{matches_at, span};
use calib_estimate::joint::Estimate;
use calib_rays::field::Rig;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// What the checks found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CrossChecks {
    /// How central each camera is, in the rig's order.
    pub centrality: Vec<Centrality>,
    /// What a central model would cost.
    pub central_model: CentralModel,
    /// Whether two halves of the poses differ as predicted.
    pub half_data: HalfDataCheck,
}

/// Runs the checks. `rig` is that of the estimate; `first_half` are the poses of one half, `None`
/// if halves are not wanted.
///
/// Cost: at most one estimate's, its parts in parallel.
pub fn cross_check(
    estimate: &Estimate,
    rig: &Rig,
    first_half: Option<&BTreeSet<usize>>,
) -> CrossChecks {
    let distances = span(&estimate.board_distances_mm(rig));
    let (central_model, halves) = rayon::join(
        || central_model(estimate, rig, &matches_at(rig, &distances)),
        || estimate_halves(estimate, first_half.ok_or(Skipped::NotWanted)?),
    );
    let mut cameras: Vec<Centrality> = rig.cameras.iter().map(centrality).collect();
    let half_data = halves.and_then(|mut halves| {
        for (k, found) in cameras.iter_mut().enumerate() {
            let fields = [0, 1].map(|half: usize| &halves.rigs[half].cameras[k].field);
            *found = found.with_halves(&rig.cameras[k], fields);
        }
        // Of the least, middle and largest distance.
        let distance_mm = *distances.get(1).ok_or(Skipped::NoCommonPoints)?;
        halves.compared(rig, distance_mm)
    });
    CrossChecks {
        centrality: cameras,
        central_model,
        half_data: half_data.map_or_else(HalfDataCheck::Skipped, HalfDataCheck::Compared),
    }
}
