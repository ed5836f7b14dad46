//! How much of what a camera can show is backed by corners.

use super::finding::cause;
use super::look::Look;
use crate::cause::{Cause, Code};
use crate::verdict::Grade;
use calib_rays::field::{CoverageMask, RayField, transport};
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector2;

/// Share below which the boards were shown in a part of the image only: a board kept to the middle half of
/// the width and of the height covers a quarter, one that is led to the edges well over a third.
const PART: f64 = 1.0 / 3.0;

/// Cameras of which less than a third of what they can show is covered.
pub fn coverage(look: &Look<'_>) -> Vec<Cause> {
    let views = &look.observations.views;
    let cameras = look.cameras.iter().enumerate();
    cameras
        .filter_map(|(camera_idx, camera)| {
            let sensor = look.dataset.cameras[camera_idx].sensor;
            let own = views.iter().filter(|view| view.camera_idx == camera_idx);
            let pixels = own.flat_map(|view| &view.corners).map(|c| c.pixel);
            let mask = CoverageMask::from_corners(sensor, pixels);
            let shown = camera.as_ref().map_or(1.0, |camera| shown_share(&camera.field));
            let share = mask.covered_share() / shown;
            (share < PART && mask.covered_share() > 0.0).then(|| {
                let of = if shown < 1.0 {
                    format!(
                        "what camera {} can show (a circle, {:.0} % of its sensor)",
                        look.name(camera_idx),
                        100.0 * shown
                    )
                } else {
                    format!("the sensor of camera {}", look.name(camera_idx))
                };
                cause(
                    Code::Coverage,
                    Grade::Doubtful,
                    format!("{:.1} %", 100.0 * share),
                    0.0,
                    format!(
                        "corners cover {:.1} % of {of}: pixels elsewhere get no answer; record boards there",
                        100.0 * share
                    ),
                )
            })
        })
        .collect()
}

/// Share of the sensor on which the lens throws an image: all of it, but for lenses that reach 90 degrees
/// from their axis before the sensor ends.
fn shown_share(field: &RayField) -> f64 {
    let center = field.sensor.center();
    let all = CoverageMask::uniform(field.sensor, true).covered_middles();
    let is_shown = |pixel: &&PixelPoint| {
        let (s, _) = field
            .base
            .evaluate(&Vector2::new(pixel.u - center.u, pixel.v - center.v));
        transport::direction(&s).z > 0.0
    };
    all.iter().filter(is_shown).count() as f64 / all.len().max(1) as f64
}
