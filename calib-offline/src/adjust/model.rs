//! Everything that an adjustment moves, and how a step moves it.

use super::observations::{Observations, ViewBasis};
use crate::board::BoardShape;
use crate::field::RayField;
use crate::field::structured::StructuredBasis;
use crate::geometry::RigidTransform;
use nalgebra::{DVector, Vector3};
use std::ops::Range;

/// Cameras, poses and board shape.
///
/// During adjustment the rig frame is that of camera 0, so `cameras[0].camera_from_rig` is the
/// identity and stays so.
#[derive(Debug, Clone)]
pub struct Model {
    /// In the dataset's order.
    pub cameras: Vec<CameraModel>,
    /// Per pose index of the observations.
    pub rig_from_board: Vec<RigidTransform>,
    /// The shape shared by all poses; without terms the board is flat.
    pub board_shape: BoardShape,
}

/// One camera of a [`Model`].
#[derive(Debug, Clone)]
pub struct CameraModel {
    /// What each pixel sees, camera frame.
    pub field: RayField,
    /// Directions in which the field's polynomial may move.
    pub basis: StructuredBasis,
    /// Where the camera is.
    pub camera_from_rig: RigidTransform,
}

/// Where each global parameter stands in a step vector. Poses follow behind, 6 each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Amounts of the field's polynomial directions, per camera.
    pub direction: Vec<Range<usize>>,
    /// Rotation (rad) and translation (mm) of `camera_from_rig`; `None` for camera 0.
    pub extrinsics: Vec<Option<Range<usize>>>,
    /// Coefficients of the board's shape, mm.
    pub board: Range<usize>,
    /// Number of global parameters.
    pub global_len: usize,
}

/// A change of every parameter.
#[derive(Debug, Clone)]
pub struct Step {
    /// In the order of [`Layout`].
    pub global: DVector<f64>,
    /// Per pose: rotation vector (rad), translation (mm).
    pub poses: Vec<nalgebra::Vector6<f64>>,
}

impl Model {
    /// Where each parameter stands.
    pub fn layout(&self) -> Layout {
        let mut next = 0;
        let mut take = |len: usize| {
            next += len;
            next - len..next
        };
        let direction = self.cameras.iter().map(|c| take(c.basis.len())).collect();
        let extrinsics = (0..self.cameras.len())
            .map(|idx| (idx > 0).then(|| take(6)))
            .collect();
        let board = take(self.board_shape.terms.len());
        Layout {
            direction,
            extrinsics,
            board,
            global_len: next,
        }
    }

    /// The model after a step: rotations are perturbed on the left, all else is added.
    pub fn stepped(&self, layout: &Layout, step: &Step) -> Self {
        let mut next = self.clone();
        for (idx, camera) in next.cameras.iter_mut().enumerate() {
            let amounts = step
                .global
                .rows_range(layout.direction[idx].clone())
                .into_owned();
            camera
                .basis
                .add_to(&amounts, &mut camera.field.direction.polynomial);
            if let Some(range) = &layout.extrinsics[idx] {
                let change = step.global.rows_range(range.clone());
                camera.camera_from_rig = camera.camera_from_rig.perturbed(
                    &Vector3::new(change[0], change[1], change[2]),
                    &Vector3::new(change[3], change[4], change[5]),
                );
            }
        }
        for (pose, change) in next.rig_from_board.iter_mut().zip(&step.poses) {
            *pose = pose.perturbed(
                &change.fixed_rows::<3>(0).into_owned(),
                &change.fixed_rows::<3>(3).into_owned(),
            );
        }
        let board = step.global.rows_range(layout.board.clone());
        for (term, change) in next.board_shape.terms.iter_mut().zip(board.iter()) {
            term.2 += change;
        }
        next
    }

    /// The values of the fixed functions at every corner, per view.
    pub fn view_bases(&self, observations: &Observations) -> Vec<ViewBasis> {
        observations
            .views
            .iter()
            .map(|view| {
                let field = &self.cameras[view.camera_idx].field;
                ViewBasis::new(
                    view,
                    field.sensor,
                    field.base,
                    field.direction.polynomial.degree,
                )
            })
            .collect()
    }
}
