//! Targets whose print says which point is which: `ChArUco` boards, grids of `AprilTags`, grids of circles
//! and of rings, chessboards with marked squares.
//!
//! Each kind finds its own points ([`found::PrintedTarget`]); what is found in one image needs no other image.
//! The corners of boards and tags are crossings of two edges and fitted as such ([`saddles`]), centers of
//! circles come from the fit of rings ([`super::ring_target`]).

pub mod april_grid;
pub mod cells;
pub mod charuco;
pub mod charuco_parts;
pub mod circles;
mod ends;
pub mod found;
pub(super) mod instead;
pub mod quads;
pub mod rings;
pub mod saddles;
mod smooth;
mod turns;

use super::detection::Detection;
use super::error::DetectError;
use super::job::{Job, all_loaded};
use super::scatter;
use super::settings::DetectSettings;
use super::verdict::{ImageVerdict, MissingCorner, Outcome, Refusal};
use super::wrong_count;
use crate::dataset::image::GrayImage;
use crate::dataset::{BoardKind, Dataset};
use calib_rays::observed::View;
use calib_rays::progress::Progress;
use found::{Found, PrintedTarget};
use rayon::prelude::*;

/// The target that a dataset's kind is, if its print tells its points apart.
pub fn of_kind(kind: &BoardKind) -> Option<&dyn PrintedTarget> {
    match kind {
        BoardKind::Charuco(board) => Some(board),
        BoardKind::AprilGrid(grid) => Some(grid),
        BoardKind::Circles(circles) => Some(circles),
        BoardKind::Rings(target) => Some(target),
        _ => None,
    }
}

/// Finds a printed target in every image.
pub(super) fn detect(
    target: &dyn PrintedTarget,
    dataset: &Dataset,
    jobs: &[Job<'_>],
    settings: &DetectSettings,
    progress: &dyn Progress,
) -> Result<Detection, DetectError> {
    progress.begin("detecting targets", jobs.len());
    let loaded = jobs
        .par_iter()
        .map(|job| {
            let result = GrayImage::load_sized(job.path, job.sensor)
                .map(|image| target.find(&image, settings));
            progress.advance();
            result
        })
        .collect();
    progress.end();
    let mut found = all_loaded(dataset, jobs, loaded)?;
    turns::settle(target, dataset, jobs, &mut found)?;
    add_model_error(dataset, jobs, &mut found, settings);
    wrong_count::check_targets(
        found.iter().filter_map(|found| found.as_ref().err()),
        found.iter().flatten().count(),
    )?;
    let mut views = Vec::new();
    let mut images = Vec::new();
    for (job, found) in jobs.iter().zip(found) {
        let mut missing = Vec::new();
        let (outcome, figures) = match found {
            Ok(found) => {
                let corner_count = found.corners.len();
                let labels = found.corners.iter().map(|corner| (corner.row, corner.col));
                missing = MissingCorner::beside(labels, &dataset.board);
                views.push(View {
                    camera_idx: job.camera_idx,
                    pose: job.pose,
                    corners: found.corners,
                });
                let outcome = Outcome::Used {
                    corner_count,
                    partial: corner_count < dataset.board.corner_count(),
                    quarter_turns: found.quarter_turns,
                };
                (outcome, Some(found.figures))
            }
            Err(refusal) => (Outcome::Refused(refusal), None),
        };
        images.push(ImageVerdict {
            camera_idx: job.camera_idx,
            pose: job.pose,
            path: job.path.clone(),
            outcome,
            figures,
            missing,
        });
    }
    Ok(Detection::of(views, images))
}

/// Adds to the points' standard deviations what the fits leave out: the points' scatter about a smooth map, of all
/// images of a camera together, or the floor where no image tells.
fn add_model_error(
    dataset: &Dataset,
    jobs: &[Job<'_>],
    found: &mut [Result<Found, Refusal>],
    settings: &DetectSettings,
) {
    for camera_idx in 0..dataset.cameras.len() {
        let of_camera = jobs.iter().zip(found.iter_mut());
        let of_camera = of_camera.filter(|(job, _)| job.camera_idx == camera_idx);
        let mut seen: Vec<(&mut Found, Option<f64>)> = of_camera
            .filter_map(|(_, found)| found.as_mut().ok())
            .map(|found| {
                let model_error_px = found.model_error_px(&dataset.board);
                (found, model_error_px)
            })
            .collect();
        scatter::pool(seen.iter_mut().map(|(_, model_error_px)| model_error_px));
        for (found, model_error_px) in seen {
            let beyond_px = model_error_px.unwrap_or(settings.sigma_floor_px);
            for corner in &mut found.corners {
                corner.sigma_px = corner.sigma_px.map(|sigma| sigma.hypot(beyond_px));
            }
            found.figures.sigma_px = found.figures.sigma_px.hypot(beyond_px);
        }
    }
}
