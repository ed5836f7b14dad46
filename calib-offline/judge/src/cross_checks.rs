//! Checks of a calibration against itself, beside the one on held-out boards.

use super::central_model::{CentralModel, central_model};
use super::centrality::{Centrality, centrality};
use super::half_data::{
    FirstHalf, HalfData, HalfDataCheck, Halves, Skipped, Split, estimate_halves,
};
use super::working_volume::{matches_at, span};
use calib_estimate::joint::Estimate;
use calib_rays::field::Rig;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the checks found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CrossChecks {
    /// How central each camera is, in the rig's order.
    pub centrality: Vec<Centrality>,
    /// What a central model would cost.
    pub central_model: CentralModel,
    /// Whether two halves of the poses, dealt in turn, differ as predicted.
    pub half_data: HalfDataCheck,
    /// The same of halves that are divided otherwise; empty in files of earlier versions.
    #[serde(default)]
    pub other_halves: Vec<(Split, HalfDataCheck)>,
}

impl CrossChecks {
    /// All halves that were compared.
    pub fn compared_halves(&self) -> impl Iterator<Item = (Split, &HalfData)> {
        let others = self
            .other_halves
            .iter()
            .map(|(split, check)| (*split, check));
        let all = std::iter::once((Split::InTurn, &self.half_data)).chain(others);
        all.filter_map(|(split, check)| match check {
            HalfDataCheck::Compared(halves) => Some((split, halves)),
            HalfDataCheck::Skipped(_) => None,
        })
    }
}

/// Runs the checks. `rig` is that of the estimate; `splits` are the ways to halve the poses, none if
/// halves are not wanted.
///
/// Cost: at most one estimate's a split, in parallel.
pub fn cross_check(estimate: &Estimate, rig: &Rig, splits: &[(Split, FirstHalf)]) -> CrossChecks {
    let distances = span(&estimate.board_distances_mm(rig));
    let (central_model, halves) = rayon::join(
        || central_model(estimate, rig, &matches_at(rig, &distances)),
        || -> Vec<(Split, Result<Halves, Skipped>)> {
            splits
                .par_iter()
                .map(|(split, first)| (*split, estimate_halves(estimate, first)))
                .collect()
        },
    );
    let mut cameras: Vec<Centrality> = rig.cameras.iter().map(centrality).collect();
    let mut checks = halves.into_iter().map(|(split, halves)| {
        let compared = halves.and_then(|mut halves| {
            if split == Split::InTurn {
                for (k, found) in cameras.iter_mut().enumerate() {
                    let fields = [0, 1].map(|half: usize| &halves.rigs[half].cameras[k].field);
                    *found = found.with_halves(&rig.cameras[k], fields);
                }
            }
            // Of the least, middle and largest distance.
            let distance_mm = *distances.get(1).ok_or(Skipped::NoCommonPoints)?;
            halves.compared(rig, &[distance_mm])
        });
        let check = compared.map_or_else(HalfDataCheck::Skipped, HalfDataCheck::Compared);
        (split, check)
    });
    let half_data = checks
        .next()
        .map_or(HalfDataCheck::Skipped(Skipped::NotWanted), |(_, check)| {
            check
        });
    let other_halves = checks.collect();
    CrossChecks {
        centrality: cameras,
        central_model,
        half_data,
        other_halves,
    }
}
