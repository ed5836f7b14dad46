//! A solution in terms of the views that all methods were given: it may have left some of them out.

use crate::methods::Solution;
use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::ViewBlock;
use calib_rays::board::BoardShape;
use calib_rays::field::Rig;
use calib_rays::geometry::RigidTransform;
use std::collections::HashSet;

/// What a method made of all that it was given.
#[derive(Debug)]
pub(super) struct Answer {
    /// The cameras.
    pub rig: Rig,
    /// See [`Solution::conversion_error_px`].
    pub conversion_error_px: f64,
    /// Out-of-plane shape of the board.
    pub board_shape: BoardShape,
    /// Per pose given; `None` where the method could not place the board.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Per view and corner given: whether it was used, and not rejected as an outlier.
    pub is_used: Vec<Vec<bool>>,
}

impl Answer {
    /// From the solution that a method found from these views.
    pub fn new(solution: Solution, given: &Observations) -> Self {
        let own = &solution.observations;
        let own_views: Vec<Option<usize>> = given
            .views
            .iter()
            .map(|view| {
                let is_same = |other: &ViewBlock| {
                    other.camera_idx == view.camera_idx
                        && own.poses[other.pose_idx] == given.poses[view.pose_idx]
                };
                own.views.iter().position(is_same)
            })
            .collect();
        let mut rig_from_board = vec![None; given.poses.len()];
        let mut is_used = Vec::with_capacity(given.views.len());
        for (view, own_idx) in given.views.iter().zip(own_views) {
            let mut used = HashSet::new();
            if let Some(idx) = own_idx {
                let own_view = &own.views[idx];
                let place = &mut rig_from_board[view.pose_idx];
                place.get_or_insert(solution.rig_from_board[own_view.pose_idx]);
                let corners = own_view.corners.iter().zip(&solution.is_used[idx]);
                let corners = corners.filter(|(_, is_used)| **is_used);
                used.extend(corners.map(|(corner, _)| (corner.row, corner.col)));
            }
            let corners = view.corners.iter();
            is_used.push(corners.map(|c| used.contains(&(c.row, c.col))).collect());
        }
        Self {
            rig: solution.rig,
            conversion_error_px: solution.conversion_error_px,
            board_shape: solution.board_shape,
            rig_from_board,
            is_used,
        }
    }
}
