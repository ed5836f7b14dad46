//! What a slip of conventions costs: the boards' corners, measured through the quick look's rig as a
//! user would measure who does not share the slip.

use super::look::Look;
use super::whole_camera::WholeCamera;
use calib_rays::field::RayField;
use calib_rays::geometry::{PixelPoint, best_placement, triangulate_pair};
use calib_rays::numerics::rms;
use nalgebra::Vector3;

/// A pixel and the camera that it is said to be of: 0 the reference, 1 the other.
pub type Said = (usize, PixelPoint);

/// RMS distance, mm, of the boards' corners from where they are, after the best rigid placement, if a
/// user says `said` of each pixel; `None` if fewer than half of the corners can be measured so.
pub fn error_mm(look: &Look<'_>, whole: &WholeCamera, said: impl Fn(Said) -> Said) -> Option<f64> {
    let field = |idx: usize| look.cameras[idx].as_ref().map(|camera| &camera.field);
    let fields: [&RayField; 2] = [field(whole.reference)?, field(whole.camera_idx)?];
    let second_in_first = whole.agreed.second_from_first.inverse();
    let (mut found, mut truth) = (Vec::new(), Vec::new());
    let mut all = 0usize;
    for (pair, read) in whole.pairs.iter().zip(&whole.read) {
        let [first, second] = [pair.first, pair.second].map(|k| &look.observations.views[k]);
        for corner in &first.corners {
            let same = |c: &&calib_estimate::adjust::observations::ObservedCorner| {
                (c.row, c.col) == (corner.row, corner.col)
            };
            let Some(other) = second.corners.iter().find(same) else {
                continue;
            };
            all += 1;
            let mut rays = [None, None];
            for pixel in [(0, corner.pixel), (1, other.pixel)] {
                let (camera, pixel) = said(pixel);
                let ray = fields[camera].ray(pixel);
                rays[camera] = Some(match camera {
                    0 => ray,
                    _ => ray.transformed(&second_in_first),
                });
            }
            if let [Some(a), Some(b)] = &rays
                && let Ok(point) = triangulate_pair(a, b)
            {
                found.push(point.point_mm);
                truth.push(read.first.camera_from_board.point(&corner.point_in_board));
            }
        }
    }
    if 2 * found.len() < all {
        return None;
    }
    let placed = best_placement(&found, &truth)?;
    let errors: Vec<f64> = found
        .iter()
        .zip(&truth)
        .map(|(found, truth)| (placed.point(found) - truth).norm())
        .collect();
    rms(&errors)
}

/// RMS distance of the boards' corners from their middle, mm, by one camera's views.
pub fn extent_mm(look: &Look<'_>, camera_idx: usize) -> Option<f64> {
    let views = look.observations.views.iter().zip(&look.fits);
    let points: Vec<Vector3<f64>> = views
        .filter(|(view, _)| view.camera_idx == camera_idx)
        .filter_map(|(view, fit)| Some((view, fit.as_ref()?)))
        .flat_map(|(view, fit)| {
            let corners = view.corners.iter();
            corners.map(|c| fit.camera_from_board.point(&c.point_in_board))
        })
        .collect();
    let middle = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let distances: Vec<f64> = points.iter().map(|point| (point - middle).norm()).collect();
    rms(&distances)
}
