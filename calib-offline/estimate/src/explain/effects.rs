//! What a unit of each elementary fault does to the corners of one view: shifts of pixels.

use crate::adjust::model::Model;
use crate::adjust::observations::{Observations, ViewBasis, ViewBlock};
use crate::adjust::residual::linearize;
use calib_rays::field::{FieldSample, RayField};
use calib_rays::geometry::PixelPoint;
use nalgebra::{Matrix3, Vector2, Vector3};

/// An elementary fault of one view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Effect {
    /// All pixels to the right, px.
    ShiftU = 0,
    /// All pixels down, px.
    ShiftV,
    /// Focal length longer, share.
    Focus,
    /// Camera turned about its own x axis, rad.
    TurnX,
    /// About its y axis.
    TurnY,
    /// About its z axis.
    TurnZ,
    /// Scene moved along the camera's own x axis, mm.
    MoveX,
    /// Along its y axis.
    MoveY,
    /// Along its z axis.
    MoveZ,
    /// Columns sheared: u grows with v, px at the sensor's edge.
    SkewU,
    /// Rows stretched: v grows with v, px at the sensor's edge.
    SkewV,
    /// Board longer along its columns' direction x than along y, ratio of the squares' sides minus 1.
    BoardScale,
    /// Angle between the board's rows and columns, rad from a right one.
    BoardShear,
    /// First term of the board's shape, mm.
    Shape0,
    /// Second term.
    Shape1,
    /// Third term.
    Shape2,
}

/// Number of effects.
pub const COUNT: usize = 16;

impl Effect {
    /// Its place among the effects of a view.
    pub const fn place(self) -> usize {
        self as usize
    }

    /// How large it is when it begins to matter: what a prior is measured in.
    pub const fn unit(self) -> f64 {
        match self {
            Self::ShiftU
            | Self::ShiftV
            | Self::SkewU
            | Self::SkewV
            | Self::MoveX
            | Self::MoveY
            | Self::MoveZ => 1.0,
            Self::Focus
            | Self::TurnX
            | Self::TurnY
            | Self::TurnZ
            | Self::BoardScale
            | Self::BoardShear => 1e-3,
            Self::Shape0 | Self::Shape1 | Self::Shape2 => 0.1,
        }
    }
}

/// Number of effects that a camera has by itself, whatever it looks at: the first ones.
pub const OF_CAMERA: usize = 9;

/// Pixel shifts of a corner by all effects, in the order of [`Effect`].
pub type Shifts = [Vector2<f64>; COUNT];

/// Pixel shifts, by the effects that a camera has by itself, of a point at `point_in_camera` (mm) on the
/// ray of a pixel, where the field has `sample`; `None` behind the camera, or where the field is singular.
pub fn camera_shifts(
    field: &RayField,
    pixel: PixelPoint,
    sample: &FieldSample,
    point_in_camera: &Vector3<f64>,
) -> Option<[Vector2<f64>; OF_CAMERA]> {
    let l = linearize(sample, point_in_camera)?;
    // A point that truly stands d elsewhere than the model has it is seen so many px away.
    let moved = |d: &Vector3<f64>| -l.by_point * d;
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let turned = axes.map(|axis| moved(&axis.cross(point_in_camera)));
    let shifted = axes.map(|axis| moved(&axis));
    // A longer focal length spreads the image about the principal point. Known is the center of symmetry:
    // of a decentered lens it is another, and the size comes out a few percent wrong.
    let center = field.sensor.center();
    let zoomed =
        Vector2::new(pixel.u - center.u, pixel.v - center.v) - Vector2::from(field.base.center_px);
    Some([
        Vector2::x(),
        Vector2::y(),
        zoomed,
        turned[0],
        turned[1],
        turned[2],
        shifted[0],
        shifted[1],
        shifted[2],
    ])
}

/// Shifts of every corner of a view; `None` for a corner behind the camera, or where the field is
/// singular.
pub fn shifts(
    model: &Model,
    observations: &Observations,
    view: &ViewBlock,
    basis: &ViewBasis,
) -> Vec<Option<Shifts>> {
    let camera = &model.cameras[view.camera_idx];
    let pose = &model.rig_from_board[view.pose_idx];
    let board = &observations.board;
    let middle = board.center_in_board();
    let sensor = observations.sensors[view.camera_idx];
    let (center, half_height_px) = (sensor.center(), f64::from(sensor.height) / 2.0);
    let corners = view.corners.iter().enumerate();
    corners
        .map(|(idx, corner)| {
            let mut point = corner.point_in_board;
            point.z += model.board_shape.height_mm(board, &point);
            let point_in_camera = camera.camera_from_rig.point(&pose.point(&point));
            let sample = basis.sample(&camera.field, idx);
            let l = linearize(&sample, &point_in_camera)?;
            let own = camera_shifts(&camera.field, corner.pixel, &sample, &point_in_camera)?;
            let moved = |d: &Vector3<f64>| -l.by_point * d;
            let camera_from_board: Matrix3<f64> = camera.camera_from_rig.rotation * pose.rotation;
            let moved_on_board =
                |x: f64, y: f64, z: f64| moved(&(camera_from_board * Vector3::new(x, y, z)));
            let along = point - middle;
            let down = (corner.pixel.v - center.v) / half_height_px;
            let mut shape = [Vector2::zeros(); 3];
            let products = model.board_shape.products(board, &corner.point_in_board);
            for (shift, product) in shape.iter_mut().zip(products) {
                *shift = moved_on_board(0.0, 0.0, product);
            }
            let of_board = [
                Vector2::new(down, 0.0),
                Vector2::new(0.0, down),
                moved_on_board(along.x / 2.0, -along.y / 2.0, 0.0),
                moved_on_board(along.y / 2.0, along.x / 2.0, 0.0),
                shape[0],
                shape[1],
                shape[2],
            ];
            let mut all = [Vector2::zeros(); COUNT];
            for (to, shift) in all.iter_mut().zip(own.into_iter().chain(of_board)) {
                *to = shift;
            }
            Some(all)
        })
        .collect()
}
