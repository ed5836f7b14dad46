//! What the noise of corners makes of the distance of neighboring ones: what an error of that distance is
//! held against, whatever the rig's angles and distances are.

use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::ViewBlock;
use calib_rays::field::Rig;
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::rms;
use nalgebra::{Matrix3x4, Vector3};
use std::collections::HashMap;

/// Step of the differences, px: the triangulation is smooth over thousands of it.
const STEP_PX: f64 = 0.01;

/// RMS error of the distance between neighboring corners of the boards that two cameras see, mm, if each
/// pixel coordinate has the standard deviation `sigma_px` and nothing else is wrong. `None` if there are
/// no such corners.
///
/// Cost: eight triangulations a corner.
pub fn neighbor_noise_mm(rig: &Rig, observations: &Observations, sigma_px: f64) -> Option<f64> {
    let mut errors_mm = Vec::new();
    for pose_idx in 0..observations.poses.len() {
        let views = observations.views.iter();
        let views: Vec<&ViewBlock> = views.filter(|view| view.pose_idx == pose_idx).collect();
        let [left, right, ..] = views[..] else {
            continue;
        };
        let others: HashMap<(usize, usize), PixelPoint> = right
            .corners
            .iter()
            .map(|corner| ((corner.row, corner.col), corner.pixel))
            .collect();
        let measured: HashMap<(usize, usize), (Vector3<f64>, Matrix3x4<f64>)> = left
            .corners
            .iter()
            .filter_map(|corner| {
                let label = (corner.row, corner.col);
                let pair = [corner.pixel, *others.get(&label)?];
                let cameras = [left.camera_idx, right.camera_idx];
                Some((label, with_derivative(rig, cameras, pair)?))
            })
            .collect();
        for corner in &left.corners {
            let Some((point, by_pixels)) = measured.get(&(corner.row, corner.col)) else {
                continue;
            };
            for label in observations.board.next_to(corner.row, corner.col) {
                if let Some((other, by_others)) = measured.get(&label) {
                    let along = (point - other).normalize();
                    let squared = by_pixels.tr_mul(&along).norm_squared()
                        + by_others.tr_mul(&along).norm_squared();
                    errors_mm.push(sigma_px * squared.sqrt());
                }
            }
        }
    }
    rms(&errors_mm)
}

/// A point and its derivative by the four pixel coordinates.
fn with_derivative(
    rig: &Rig,
    cameras: [usize; 2],
    pixels: [PixelPoint; 2],
) -> Option<(Vector3<f64>, Matrix3x4<f64>)> {
    let at = |change: [f64; 4]| {
        let moved = [0, 1].map(|k: usize| {
            let pixel =
                PixelPoint::new(pixels[k].u + change[2 * k], pixels[k].v + change[2 * k + 1]);
            (cameras[k], pixel)
        });
        Some(rig.triangulate(&moved).ok()?.point_mm)
    };
    let mut by_pixels = Matrix3x4::zeros();
    for k in 0..4 {
        let moved = |by: f64| {
            let mut change = [0.0; 4];
            change[k] = by;
            at(change)
        };
        let difference = moved(STEP_PX)? - moved(-STEP_PX)?;
        by_pixels.set_column(k, &(difference / (2.0 * STEP_PX)));
    }
    Some((at([0.0; 4])?, by_pixels))
}
