//! Whether boards look as if seen by parallel rays: then each image is an affine map of its board.

use super::is_usable;
use crate::adjust::Observations;
use crate::adjust::observations::ViewBlock;
use calib_rays::numerics::median;
use nalgebra::{Matrix3, Matrix3x2, Vector3};

/// Median length of the residual vectors, px, if every board is mapped to the image by the best
/// affine map; `None` if no view can say.
///
/// An ordinary lens maps tilted boards with perspective and so leaves more than a field fitted to
/// it; where affine maps leave less than the best field, there is no perspective to fit.
pub fn affine_median_px(observations: &Observations) -> Option<f64> {
    let usable = observations.views.iter().filter(|view| is_usable(view));
    median(usable.filter_map(affine_residuals_px).flatten())
}

fn affine_residuals_px(view: &ViewBlock) -> Option<Vec<f64>> {
    let on_board = |k: usize| {
        let point = view.corners[k].point_in_board;
        Vector3::new(point.x, point.y, 1.0)
    };
    let (mut normal, mut right) = (Matrix3::zeros(), Matrix3x2::zeros());
    for (k, corner) in view.corners.iter().enumerate() {
        let x = on_board(k);
        normal += x * x.transpose();
        right.column_mut(0).axpy(corner.pixel.u, &x, 1.0);
        right.column_mut(1).axpy(corner.pixel.v, &x, 1.0);
    }
    let map = normal.cholesky()?.solve(&right);
    Some(
        view.corners
            .iter()
            .enumerate()
            .map(|(k, corner)| {
                let seen = map.tr_mul(&on_board(k));
                (corner.pixel.u - seen.x).hypot(corner.pixel.v - seen.y)
            })
            .collect(),
    )
}
