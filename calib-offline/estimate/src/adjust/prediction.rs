//! The corners of a view as a model sees them: their residuals, and what derivatives need.

use super::model::Model;
use super::observations::{Observations, ViewBasis, ViewBlock};
use super::residual::{Linearization, linearize};
use nalgebra::Vector3;

/// A corner as the model sees it.
pub struct Seen {
    /// `None` behind the camera.
    pub linearization: Option<Linearization>,
    /// The corner turned into the rig's axes about the board's origin, mm.
    pub turned_in_board: Vector3<f64>,
    /// The corner turned into the camera's axes about the rig's origin, mm.
    pub turned_in_rig: Vector3<f64>,
}

/// The corners of a view as the model sees them.
pub fn predict<'a>(
    model: &'a Model,
    observations: &'a Observations,
    view: &'a ViewBlock,
    basis: &'a ViewBasis,
) -> impl Iterator<Item = Seen> + 'a {
    let camera = &model.cameras[view.camera_idx];
    let pose = &model.rig_from_board[view.pose_idx];
    view.corners.iter().enumerate().map(move |(idx, corner)| {
        let mut point = corner.point_in_board;
        point.z += model.board_shape.height_mm(&observations.board, &point);
        let turned_in_board = pose.rotation * point;
        let turned_in_rig =
            camera.camera_from_rig.rotation * (turned_in_board + pose.translation_mm);
        let point_in_camera = turned_in_rig + camera.camera_from_rig.translation_mm;
        let linearization = linearize(&basis.sample(&camera.field, idx), &point_in_camera);
        Seen {
            linearization: linearization.map(|at_pixel| Linearization {
                residual_px: at_pixel.residual_px + corner.beyond_px,
                ..at_pixel
            }),
            turned_in_board,
            turned_in_rig,
        }
    })
}
