//! Everything that an adjustment moves, and how a step moves it.

use super::observations::{Observations, ViewBasis};
use calib_rays::board::BoardShape;
use calib_rays::field::knot_order::KnotOrder;
use calib_rays::field::structured::StructuredBasis;
use calib_rays::field::{RayField, SmoothMap};
use calib_rays::geometry::RigidTransform;
use calib_rays::observed::KnownPose;
use nalgebra::{DVector, Vector2, Vector3};
use std::ops::Range;

/// Cameras, poses and board shape.
///
/// During adjustment the rig frame is that of camera 0, so `cameras[0].camera_from_rig` is the
/// identity and stays so; unless poses are known beforehand: then it is the frame that they are known in.
#[derive(Debug, Clone)]
pub struct Model {
    /// In the dataset's order.
    pub cameras: Vec<CameraModel>,
    /// Per pose index of the observations.
    pub rig_from_board: Vec<RigidTransform>,
    /// What is known of them beforehand, by pose index; shorter where nothing is known of the last ones.
    pub known_poses: Vec<Option<KnownPose>>,
    /// The shape shared by all poses; without terms the board is flat.
    pub board_shape: BoardShape,
}

/// One camera of a [`Model`].
#[derive(Debug, Clone)]
pub struct CameraModel {
    /// What each pixel sees, camera frame. What of it exists is what moves: the direction's
    /// polynomial always, its spline and the offset if they are there.
    pub field: RayField,
    /// Directions in which the field's polynomial may move.
    pub basis: StructuredBasis,
    /// Directions in which the offset may move; there if the field has one.
    pub offset_basis: Option<StructuredBasis>,
    /// Where the camera is.
    pub camera_from_rig: RigidTransform,
}

impl CameraModel {
    /// Order of the spline's knots, if the direction has a spline.
    pub fn knot_order(&self) -> Option<KnotOrder> {
        self.field
            .direction
            .spline
            .as_ref()
            .map(|spline| KnotOrder::new(spline.grid))
    }

    /// Gives the camera an offset field, zero everywhere, that may move from now on.
    pub fn free_offset(&mut self, degree: usize) {
        let field = &mut self.field;
        self.offset_basis = Some(StructuredBasis::offset(field.sensor, degree, &field.base));
        field.offset = Some(SmoothMap::zero(degree));
    }

    /// Makes the camera central.
    pub fn drop_offset(&mut self) {
        self.field.offset = None;
        self.offset_basis = None;
    }

    /// The offset with what it may do; `None` for a central camera.
    pub fn offset(&self) -> Option<(&SmoothMap, &StructuredBasis)> {
        self.field.offset.as_ref().zip(self.offset_basis.as_ref())
    }

    /// Amounts of the offset's directions, mm RMS over the sensor; empty for a central camera.
    pub fn offset_amounts(&self) -> DVector<f64> {
        self.offset().map_or_else(
            || DVector::zeros(0),
            |(offset, basis)| basis.amounts(&offset.polynomial),
        )
    }

    /// The spline's coefficients in knot order, two components interleaved.
    pub fn spline_amounts(&self) -> DVector<f64> {
        match (&self.field.direction.spline, self.knot_order()) {
            (Some(spline), Some(order)) => {
                let mut amounts = DVector::zeros(2 * order.knot_count());
                for (row_major, c) in spline.coefficients.iter().enumerate() {
                    let at = 2 * order.from_row_major(row_major);
                    amounts[at] = c.x;
                    amounts[at + 1] = c.y;
                }
                amounts
            }
            _ => DVector::zeros(0),
        }
    }
}

/// Where each global parameter stands in a step vector. Poses follow behind, 6 each; each
/// camera's spline has a vector of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Per camera.
    pub cameras: Vec<CameraLayout>,
    /// Coefficients of the board's shape, mm.
    pub board: Range<usize>,
    /// Number of global parameters.
    pub global_len: usize,
}

/// Where the global parameters of one camera stand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraLayout {
    /// Amounts of the direction's polynomial.
    pub direction: Range<usize>,
    /// Amounts of the offset's polynomial, mm; empty for a central camera.
    pub offset: Range<usize>,
    /// Rotation (rad) and translation (mm) of `camera_from_rig`; `None` for a camera that is the rig's frame.
    pub extrinsics: Option<Range<usize>>,
}

/// A change of every parameter.
#[derive(Debug, Clone)]
pub struct Step {
    /// In the order of [`Layout`].
    pub global: DVector<f64>,
    /// Per pose: rotation vector (rad), translation (mm).
    pub poses: Vec<nalgebra::Vector6<f64>>,
    /// Per camera: the spline's coefficients in knot order; empty without a spline.
    pub splines: Vec<DVector<f64>>,
}

impl Model {
    /// Whether any pose is known beforehand, and the rig's frame with it.
    pub fn has_known_poses(&self) -> bool {
        self.known_poses.iter().any(Option::is_some)
    }

    /// Index of the pose whose board frame users get as the rig's: the first, the datum; `None` where poses are
    /// known, as their frame is the rig's.
    pub fn frame_pose(&self) -> Option<usize> {
        (!self.has_known_poses()).then_some(0)
    }

    /// Whether any camera's direction has a spline.
    pub fn has_spline(&self) -> bool {
        self.cameras
            .iter()
            .any(|c| c.field.direction.spline.is_some())
    }

    /// Where each parameter stands.
    pub fn layout(&self) -> Layout {
        let mut next = 0;
        let mut take = |len: usize| {
            next += len;
            next - len..next
        };
        let cameras = self
            .cameras
            .iter()
            .enumerate()
            .map(|(idx, camera)| CameraLayout {
                direction: take(camera.basis.len()),
                offset: take(camera.offset().map_or(0, |(_, basis)| basis.len())),
                extrinsics: (idx > 0 || self.has_known_poses()).then(|| take(6)),
            })
            .collect();
        let board = take(self.board_shape.terms.len());
        Layout {
            cameras,
            board,
            global_len: next,
        }
    }

    /// The model after a step: rotations are perturbed on the left, all else is added.
    pub fn stepped(&self, layout: &Layout, step: &Step) -> Self {
        let mut next = self.clone();
        for (idx, camera) in next.cameras.iter_mut().enumerate() {
            let ranges = &layout.cameras[idx];
            let amounts = step
                .global
                .rows_range(ranges.direction.clone())
                .into_owned();
            camera
                .basis
                .add_to(&amounts, &mut camera.field.direction.polynomial);
            if let (Some(offset), Some(basis)) = (&mut camera.field.offset, &camera.offset_basis) {
                let change = step.global.rows_range(ranges.offset.clone()).into_owned();
                basis.add_to(&change, &mut offset.polynomial);
            }
            if let Some(order) = camera.knot_order() {
                add_spline(&order, &step.splines[idx], &mut camera.field.direction);
            }
            if let Some(range) = &ranges.extrinsics {
                let change = step.global.rows_range(range.clone());
                camera.camera_from_rig = camera.camera_from_rig.perturbed(
                    &Vector3::new(change[0], change[1], change[2]),
                    &Vector3::new(change[3], change[4], change[5]),
                );
            }
        }
        for (pose, change) in next.rig_from_board.iter_mut().zip(&step.poses) {
            *pose = pose.stepped(change);
        }
        let board = step.global.rows_range(layout.board.clone());
        for (term, change) in next.board_shape.terms.iter_mut().zip(board.iter()) {
            term.2 += change;
        }
        next
    }

    /// [`Self::view_bases`], given those of a model that is partly the same.
    pub fn changed_view_bases(
        &self,
        observations: &Observations,
        known: &[ViewBasis],
    ) -> Vec<ViewBasis> {
        observations
            .views
            .iter()
            .zip(known)
            .map(|(view, basis)| basis.of_changed(view, &self.cameras[view.camera_idx].field))
            .collect()
    }

    /// The values of the fixed functions at every corner, per view.
    pub fn view_bases(&self, observations: &Observations) -> Vec<ViewBasis> {
        observations
            .views
            .iter()
            .map(|view| ViewBasis::new(view, &self.cameras[view.camera_idx].field))
            .collect()
    }
}

/// Adds a change of [`CameraModel::spline_amounts`].
fn add_spline(order: &KnotOrder, change: &DVector<f64>, direction: &mut SmoothMap) {
    if let Some(spline) = &mut direction.spline {
        for (row_major, c) in spline.coefficients.iter_mut().enumerate() {
            let at = 2 * order.from_row_major(row_major);
            *c += Vector2::new(change[at], change[at + 1]);
        }
    }
}
