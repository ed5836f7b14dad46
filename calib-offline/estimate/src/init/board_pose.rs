//! Where a board is, seen by one camera through a given field (resection), and how far its corners are
//! from it: with robust weights, to judge views and pairs of views; by least squares, for residuals of
//! boards that no estimate ever saw.

use super::bearing_pose::bearing_pose;
use crate::adjust::observations::ViewBlock;
use crate::adjust::residual::linearize;
use calib_rays::board::{BoardShape, BoardSpec};
use calib_rays::field::{FieldSample, RayField};
use calib_rays::geometry::{PixelPoint, RigidTransform};
use calib_rays::numerics::median;
use calib_rays::observed::Corner;
use nalgebra::{Matrix2x6, Matrix6, Vector2, Vector3, Vector6};

/// Gauss-Newton steps at most; from a bearing pose three or four are enough.
const STEPS: usize = 12;
/// A step that promises to lower the cost by less than this share of it is the last.
const SETTLED: f64 = 1e-8;
/// Degrees of freedom of the weights: between what real (3 to 6) and simulated corners show.
const FREEDOM: f64 = 4.0;
/// Least variance per axis, px^2: corners of a simulation without noise still have a scale.
const FLOOR_PX2: f64 = 1e-12;
/// Gauss-Newton steps of least squares: the start is good to a pixel, convergence is quadratic.
const PLAIN_STEPS: usize = 15;

/// A board placed by one view alone.
#[derive(Debug, Clone)]
pub struct ViewFit {
    /// Where the board is.
    pub camera_from_board: RigidTransform,
    /// Information on it for corners of unit variance (1 px per axis), by the perturbation of
    /// [`RigidTransform::perturbed`]; outliers count little.
    pub information: Matrix6<f64>,
    /// Median length of the residual vectors, px.
    pub median_px: f64,
    /// Number of corners.
    pub corner_count: usize,
}

impl ViewFit {
    /// Variance of a corner per axis, px^2: the median of the squared length of a bivariate
    /// Gaussian is 2 ln 2 times its variance.
    pub fn variance_px2(&self) -> f64 {
        variance_px2(self.median_px)
    }
}

fn variance_px2(median_px: f64) -> f64 {
    (median_px * median_px / (2.0 * 2f64.ln())).max(FLOOR_PX2)
}

/// Places the board of a view with robust weights.
///
/// `None` if the corners place no board: too few, on a line, or behind the camera.
pub fn fit_view(
    field: &RayField,
    board: &BoardSpec,
    shape: &BoardShape,
    view: &ViewBlock,
) -> Option<ViewFit> {
    if !super::is_usable(view) {
        return None;
    }
    let corners = view.corners.iter().map(|c| (c.pixel, c.point_in_board));
    let seen = SeenBoard::new(field, board, shape, corners);
    let mut pose = seen.start()?;
    for step in 0.. {
        let rows = seen.rows(&pose)?;
        let squared_px2: Vec<f64> = rows
            .iter()
            .zip(&view.corners)
            .map(|(row, corner)| row.residual_px.norm_squared() * corner.relative_weight)
            .collect();
        let median_px = median(squared_px2.iter().copied())?.sqrt();
        let variance_px2 = variance_px2(median_px);
        // 1 at zero; falls with the square of the residual far out.
        let weights = view
            .corners
            .iter()
            .zip(&squared_px2)
            .map(|(corner, squared)| {
                corner.relative_weight * FREEDOM / (FREEDOM + squared / variance_px2)
            });
        let Equations {
            information,
            gradient,
            cost,
        } = Equations::of(&rows, weights);
        let change = information.cholesky()?.solve(&-gradient);
        let promised = -change.dot(&gradient);
        if step == STEPS || promised <= SETTLED * cost.max(FLOOR_PX2) {
            return pose
                .translation_mm
                .iter()
                .all(|x| x.is_finite())
                .then(|| ViewFit {
                    camera_from_board: pose.orthonormalized(),
                    information,
                    median_px,
                    corner_count: view.corners.len(),
                });
        }
        pose = pose.stepped(&change);
    }
    None
}

/// Residual vectors (observed minus predicted, px) of a view with the best pose for them, least
/// squares; `None` if the corners place no board.
pub fn residuals_with_free_pose(
    field: &RayField,
    board: &BoardSpec,
    shape: &BoardShape,
    corners: &[Corner],
) -> Option<Vec<Vector2<f64>>> {
    let places = corners
        .iter()
        .map(|c| (c.pixel, board.corner_in_board(c.row, c.col)));
    let seen = SeenBoard::new(field, board, shape, places);
    let mut pose = seen.start()?;
    for _ in 0..PLAIN_STEPS {
        let equations = Equations::of(&seen.rows(&pose)?, std::iter::repeat(1.0));
        let change = equations
            .information
            .cholesky()?
            .solve(&-equations.gradient);
        pose = pose.stepped(&change);
    }
    let rows = seen.rows(&pose)?;
    Some(rows.into_iter().map(|row| row.residual_px).collect())
}

/// Residual vectors (observed minus predicted, px) of a board seen by several cameras, given with the
/// places of the cameras, with one pose for all, least squares; `None` if the corners place no board.
pub fn residuals_with_one_pose(
    views: &[(&RayField, RigidTransform, &[Corner])],
    board: &BoardSpec,
    shape: &BoardShape,
) -> Option<Vec<Vec<Vector2<f64>>>> {
    let seen: Vec<(SeenBoard, RigidTransform)> = views
        .iter()
        .map(|(field, camera_from_rig, corners)| {
            let places = corners
                .iter()
                .map(|c| (c.pixel, board.corner_in_board(c.row, c.col)));
            (
                SeenBoard::new(field, board, shape, places),
                *camera_from_rig,
            )
        })
        .collect();
    let (first, camera_from_rig) = seen.first()?;
    let mut rig_from_board = camera_from_rig.inverse() * first.start()?;
    let rows = |pose: &RigidTransform| -> Option<Vec<Vec<Row>>> {
        let rows = seen
            .iter()
            .map(|(seen, place)| seen.rows_in_rig(pose, place));
        rows.collect()
    };
    for _ in 0..PLAIN_STEPS {
        let flat: Vec<Row> = rows(&rig_from_board)?.into_iter().flatten().collect();
        let equations = Equations::of(&flat, std::iter::repeat(1.0));
        let change = equations
            .information
            .cholesky()?
            .solve(&-equations.gradient);
        rig_from_board = rig_from_board.stepped(&change);
    }
    let residuals = |rows: Vec<Row>| rows.into_iter().map(|row| row.residual_px).collect();
    Some(rows(&rig_from_board)?.into_iter().map(residuals).collect())
}

/// The corners of a view: what the field gives to each pixel, and where each is on the bent board.
struct SeenBoard {
    samples: Vec<FieldSample>,
    points_in_board: Vec<Vector3<f64>>,
}

impl SeenBoard {
    /// From pixels and nominal places on the board, mm.
    fn new(
        field: &RayField,
        board: &BoardSpec,
        shape: &BoardShape,
        corners: impl Iterator<Item = (PixelPoint, Vector3<f64>)>,
    ) -> Self {
        let bent = |mut point: Vector3<f64>| {
            point.z += shape.height_mm(board, &point);
            point
        };
        let (samples, points_in_board) = corners
            .map(|(pixel, point)| (field.sample(pixel), bent(point)))
            .unzip();
        Self {
            samples,
            points_in_board,
        }
    }

    /// The pose by the bearings alone.
    fn start(&self) -> Option<RigidTransform> {
        let bearings: Vec<_> = self.samples.iter().map(|s| s.ray().direction).collect();
        Some(bearing_pose(&bearings, &self.points_in_board)?.0)
    }

    /// Each corner's residual and its derivative; `None` if a corner lies behind the camera.
    fn rows(&self, camera_from_board: &RigidTransform) -> Option<Vec<Row>> {
        self.rows_in_rig(camera_from_board, &RigidTransform::identity())
    }

    /// The same of a board placed in the rig's frame, by its pose there.
    fn rows_in_rig(
        &self,
        rig_from_board: &RigidTransform,
        camera_from_rig: &RigidTransform,
    ) -> Option<Vec<Row>> {
        let row = |(sample, point): (&FieldSample, &Vector3<f64>)| {
            let turned = rig_from_board.rotation * point;
            let in_rig = turned + rig_from_board.translation_mm;
            let l = linearize(sample, &camera_from_rig.point(&in_rig))?;
            let by_rig = l.by_point * camera_from_rig.rotation;
            Some(Row {
                residual_px: l.residual_px,
                by_pose: RigidTransform::by_step(&by_rig, &turned),
            })
        };
        self.samples
            .iter()
            .zip(&self.points_in_board)
            .map(row)
            .collect()
    }
}

/// A corner's residual and its derivative by the step of a pose.
struct Row {
    residual_px: Vector2<f64>,
    by_pose: Matrix2x6<f64>,
}

/// The normal equations of a pose.
struct Equations {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    cost: f64,
}

impl Equations {
    fn of(rows: &[Row], weights: impl Iterator<Item = f64>) -> Self {
        let mut sum = Self {
            information: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            cost: 0.0,
        };
        for (row, weight) in rows.iter().zip(weights) {
            sum.information += weight * row.by_pose.tr_mul(&row.by_pose);
            sum.gradient += weight * row.by_pose.tr_mul(&row.residual_px);
            sum.cost += weight * row.residual_px.norm_squared();
        }
        sum
    }
}
