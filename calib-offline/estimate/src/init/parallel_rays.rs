//! Whether boards look as if seen by parallel rays: then each image is an affine map of its board.

use super::is_usable;
use crate::adjust::Observations;
use crate::adjust::observations::ViewBlock;
use calib_rays::geometry::Scatter;
use calib_rays::numerics::median;
use nalgebra::{SMatrix, SVector, Vector3};

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
    let points: Vec<_> = view.corners.iter().map(|c| c.point_in_board).collect();
    if Scatter::of(&points).is_solid() {
        residuals_px(view, |k| points[k].push(1.0))
    } else {
        residuals_px(view, |k| Vector3::new(points[k].x, points[k].y, 1.0))
    }
}

/// Lengths of the residual vectors of the map from `N` coordinates.
fn residuals_px<const N: usize>(
    view: &ViewBlock,
    on_target: impl Fn(usize) -> SVector<f64, N>,
) -> Option<Vec<f64>> {
    let mut normal = SMatrix::<f64, N, N>::zeros();
    let mut right = SMatrix::<f64, N, 2>::zeros();
    for (k, corner) in view.corners.iter().enumerate() {
        let x = on_target(k);
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
                let seen = map.tr_mul(&on_target(k));
                (corner.pixel.u - seen.x).hypot(corner.pixel.v - seen.y)
            })
            .collect(),
    )
}
