//! What the calibration would be worth with boards that were not recorded: which shot to add.

use super::error::EstimateError;
use super::estimate::Estimate;
use super::point_covariance::shape_covariance;
use crate::adjust::observations::{ObservedCorner, ViewBlock};
use crate::adjust::{Model, Observations};
use calib_rays::field::Rig;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use nalgebra::Vector2;

impl Estimate {
    /// Predicted RMS error of points from the calibration alone, mm, if boards stood at `added`
    /// places too (`rig_from_board`, the frame of `rig`, which is that of [`Estimate::rig`]); with
    /// none, that of the calibration as it is. Pixels of the matches count as exact, and the best
    /// rigid motion of all points is taken out.
    ///
    /// The boards are seen by every camera that has a pixel for a corner, with the noise of the
    /// recorded ones. Noise and smoothness weights are taken as they are: where new boards would
    /// show more of the lens than the weights believe in, the error falls less.
    ///
    /// `None` if a match has no point.
    ///
    /// Cost: one assembly of the equations, and a dense product of `4 n` square matrices.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] if the data leave a parameter open.
    pub fn error_with_boards_mm(
        &mut self,
        rig: &Rig,
        added: &[RigidTransform],
        matches: &[[(usize, PixelPoint); 2]],
    ) -> Result<Option<f64>, EstimateError> {
        let (model, observations) = self.with_boards(rig, added);
        let found = self
            .fit
            .equations_with(&self.observations, &model, &observations)?;
        let covariance = shape_covariance(&model, &found, rig, matches);
        let count = matches.len().max(1) as f64;
        Ok(covariance.map(|covariance| (covariance.trace() / count).sqrt()))
    }

    /// The model with more poses, and what its cameras would see of them.
    fn with_boards(&self, rig: &Rig, added: &[RigidTransform]) -> (Model, Observations) {
        let mut model = self.model.clone();
        let mut observations = self.observations.clone();
        let board = observations.board;
        let first_from_rig = rig
            .cameras
            .first()
            .map_or_else(RigidTransform::identity, |camera| {
                camera.rig_from_camera.inverse()
            });
        for rig_from_board in added {
            let pose_idx = model.rig_from_board.len();
            let next = observations.poses.last().map_or(0, |last| last + 1);
            let first_from_board = first_from_rig * *rig_from_board;
            model.rig_from_board.push(first_from_board);
            observations.poses.push(next);
            for (camera_idx, camera) in model.cameras.iter().enumerate() {
                let corners: Vec<ObservedCorner> = (0..board.corner_count())
                    .filter_map(|k| {
                        let (row, col) = (k / board.cols, k % board.cols);
                        let flat = board.corner_in_board(row, col);
                        let mut bent = flat;
                        bent.z += model.board_shape.height_mm(&board, &flat);
                        let seen = camera.camera_from_rig.point(&first_from_board.point(&bent));
                        let pixel = camera.field.project(&seen)?;
                        camera
                            .field
                            .sensor
                            .contains(pixel)
                            .then_some(ObservedCorner {
                                row,
                                col,
                                point_in_board: flat,
                                pixel,
                                beyond_px: Vector2::zeros(),
                                relative_weight: 1.0,
                            })
                    })
                    .collect();
                if !corners.is_empty() {
                    observations.views.push(ViewBlock {
                        camera_idx,
                        pose_idx,
                        corners,
                    });
                }
            }
        }
        (model, observations)
    }
}
