//! Where a board is, seen by one calibrated camera: for residuals of boards it never saw.

use calib_estimate::adjust::residual::linearize;
use calib_estimate::init::bearing_pose::bearing_pose;
use calib_rays::board::{BoardShape, BoardSpec};
use calib_rays::field::RayField;
use calib_rays::geometry::so3::skew;
use calib_rays::observed::Corner;
use nalgebra::{Matrix2x6, Matrix6, Vector2, Vector6};

/// Gauss-Newton steps: the start is good to a pixel, convergence is quadratic.
const STEPS: usize = 15;

/// Residual vectors (observed minus predicted, px) of a view with the best pose for them, least
/// squares; `None` if the corners place no board.
pub fn residuals_with_free_pose(
    field: &RayField,
    board: &BoardSpec,
    shape: &BoardShape,
    corners: &[Corner],
) -> Option<Vec<Vector2<f64>>> {
    let samples: Vec<_> = corners.iter().map(|c| field.sample(c.pixel)).collect();
    let points: Vec<_> = corners
        .iter()
        .map(|corner| {
            let mut point = board.corner_in_board(corner.row, corner.col);
            point.z += shape.height_mm(board, &point);
            point
        })
        .collect();
    let bearings: Vec<_> = samples.iter().map(|s| s.ray().direction).collect();
    let (mut pose, _) = bearing_pose(&bearings, &points)?;
    let mut residuals = Vec::new();
    for step in 0..=STEPS {
        let mut normal = Matrix6::zeros();
        let mut gradient = Vector6::zeros();
        residuals.clear();
        for (sample, point) in samples.iter().zip(&points) {
            let turned = pose.rotation * point;
            let l = linearize(sample, &(turned + pose.translation_mm))?;
            let mut row = Matrix2x6::zeros();
            row.fixed_view_mut::<2, 3>(0, 0)
                .copy_from(&(-l.by_point * skew(&turned)));
            row.fixed_view_mut::<2, 3>(0, 3).copy_from(&l.by_point);
            normal += row.tr_mul(&row);
            gradient += row.tr_mul(&l.residual_px);
            residuals.push(l.residual_px);
        }
        if step == STEPS {
            break;
        }
        let change = normal.cholesky()?.solve(&-gradient);
        pose = pose.perturbed(
            &change.fixed_rows::<3>(0).into_owned(),
            &change.fixed_rows::<3>(3).into_owned(),
        );
    }
    Some(residuals)
}
