//! One view seen through a given field (resection): where its board is, how well that is known, and
//! how far its corners are from it. The basis for judging views and pairs of views.

use super::bearing_pose::bearing_pose;
use crate::adjust::observations::ViewBlock;
use crate::adjust::residual::{Linearization, linearize};
use calib_rays::board::{BoardShape, BoardSpec};
use calib_rays::field::RayField;
use calib_rays::geometry::RigidTransform;
use calib_rays::geometry::so3::skew;
use nalgebra::{Matrix2x6, Matrix6, Vector6};

/// Gauss-Newton steps at most; from a bearing pose three or four are enough.
const STEPS: usize = 12;
/// A step that promises to lower the cost by less than this share of it is the last.
const SETTLED: f64 = 1e-8;
/// Degrees of freedom of the weights: between what real (3 to 6) and simulated corners show.
const FREEDOM: f64 = 4.0;
/// Least variance per axis, px^2: corners of a simulation without noise still have a scale.
const FLOOR_PX2: f64 = 1e-12;

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
        (self.median_px * self.median_px / (2.0 * 2f64.ln())).max(FLOOR_PX2)
    }
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
    let samples: Vec<_> = view.corners.iter().map(|c| field.sample(c.pixel)).collect();
    let points: Vec<_> = view
        .corners
        .iter()
        .map(|corner| {
            let mut point = corner.point_in_board;
            point.z += shape.height_mm(board, &point);
            point
        })
        .collect();
    let bearings: Vec<_> = samples.iter().map(|s| s.ray().direction).collect();
    let (mut pose, _) = bearing_pose(&bearings, &points)?;
    for step in 0.. {
        let seen: Vec<Linearization> = samples
            .iter()
            .zip(&points)
            .map(|(sample, point)| linearize(sample, &pose.point(point)))
            .collect::<Option<_>>()?;
        let squared = |l: &Linearization, k: usize| {
            l.residual_px.norm_squared() * view.corners[k].relative_weight
        };
        let mut sorted: Vec<f64> = seen
            .iter()
            .enumerate()
            .map(|(k, l)| squared(l, k))
            .collect();
        sorted.sort_by(f64::total_cmp);
        let median_px = sorted[sorted.len() / 2].sqrt();
        let variance_px2 = (median_px * median_px / (2.0 * 2f64.ln())).max(FLOOR_PX2);
        let (mut information, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
        let mut cost = 0.0;
        for (k, (l, point)) in seen.iter().zip(&points).enumerate() {
            // 1 at zero; falls with the square of the residual far out.
            let weight = view.corners[k].relative_weight * FREEDOM
                / (FREEDOM + squared(l, k) / variance_px2);
            let turned = pose.rotation * point;
            let mut row = Matrix2x6::zeros();
            row.fixed_view_mut::<2, 3>(0, 0)
                .copy_from(&(-l.by_point * skew(&turned)));
            row.fixed_view_mut::<2, 3>(0, 3).copy_from(&l.by_point);
            information += weight * row.tr_mul(&row);
            gradient += weight * row.tr_mul(&l.residual_px);
            cost += weight * l.residual_px.norm_squared();
        }
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
        pose = pose.perturbed(
            &change.fixed_rows::<3>(0).into_owned(),
            &change.fixed_rows::<3>(3).into_owned(),
        );
    }
    None
}
