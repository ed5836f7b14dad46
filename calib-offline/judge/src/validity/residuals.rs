//! Whether the new boards agree with the rig when what changed is taken out.

use crate::agreement::BY_CHANCE_SD;
use calib_estimate::adjust::observations::ObservedCorner;
use calib_estimate::explain::change::Changes;
use calib_estimate::init::board_pose::residuals_with_free_pose;
use calib_rays::observed::Corner;

/// Residuals of the new boards when what was found is taken out, and of the old ones.
pub(super) struct Residuals {
    /// RMS of the new, px.
    pub new_px: f64,
    /// Of the old, px.
    pub old_px: f64,
    /// One pose for all views of a board over one for each, squared, and what chance leaves it.
    pub disagreement: Option<(f64, f64)>,
}

impl Residuals {
    pub fn of(changes: &Changes) -> Self {
        let together = &changes.together;
        let observations = &together.observations;
        let (mut new_px2, mut new, mut old_px2, mut old) = (0.0, 0.0, 0.0, 0.0);
        let (mut one_px2, mut own_px2, mut corners, mut views) = (0.0, 0.0, 0.0, 0.0);
        for (view, residuals) in observations.views.iter().zip(&together.residuals) {
            let px2: f64 = residuals
                .iter()
                .flatten()
                .map(nalgebra::Matrix::norm_squared)
                .sum();
            let count = view.corners.len() as f64;
            if view.pose_idx < changes.first_new {
                old_px2 += px2;
                old += count;
                continue;
            }
            new_px2 += px2;
            new += count;
            let labelled: Vec<Corner> = view.corners.iter().map(ObservedCorner::labelled).collect();
            let free = residuals_with_free_pose(
                &together.model.cameras[view.camera_idx].field,
                &observations.board,
                &together.model.board_shape,
                &labelled,
            );
            if let Some(free) = free {
                one_px2 += px2;
                own_px2 += free.iter().map(nalgebra::Matrix::norm_squared).sum::<f64>();
                corners += count;
                views += 1.0;
            }
        }
        let boards = changes.new_poses.len() as f64;
        let more = 6.0 * (views - boards);
        let left = 2.0 * corners - 6.0 * views;
        let by_chance = |z: f64| {
            1.0 + (more + z * (2.0 * more).max(0.0).sqrt())
                / (together.effective_share * left.max(1.0))
        };
        let disagreement = (more > 0.0 && own_px2 > 0.0 && left > 0.0)
            .then(|| (one_px2 / own_px2, by_chance(BY_CHANCE_SD)));
        let rms = |px2: f64, count: f64| (px2 / f64::max(count, 1.0)).sqrt();
        Self {
            new_px: rms(new_px2, new),
            old_px: rms(old_px2, old),
            disagreement,
        }
    }
}
