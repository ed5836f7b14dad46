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
pub mod charuco_seen;
pub mod circles;
pub mod found;
pub mod quads;
pub mod rings;
pub mod saddles;
mod smooth;
mod turns;

use super::detection::Detection;
use super::error::DetectError;
use super::job::{Job, all_loaded};
use super::settings::DetectSettings;
use super::verdict::{ImageVerdict, MissingCorner, Outcome};
use crate::dataset::image::GrayImage;
use crate::dataset::{BoardKind, Dataset};
use calib_rays::observed::{Corner, View};
use calib_rays::progress::Progress;
use found::PrintedTarget;
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
    turns::settle(target, dataset, jobs, &mut found);
    let mut views = Vec::new();
    let mut images = Vec::new();
    for (job, found) in jobs.iter().zip(found) {
        let mut missing = Vec::new();
        let (outcome, figures) = match found {
            Ok(found) => {
                let corner_count = found.corners.len();
                let labels = found.corners.iter().map(|corner| (corner.row, corner.col));
                missing = MissingCorner::beside(labels, &dataset.board);
                views.push(view(job, found.corners, settings));
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

fn view(job: &Job<'_>, corners: Vec<Corner>, settings: &DetectSettings) -> View {
    let with_floor = |corner: Corner| Corner {
        sigma_px: corner.sigma_px.map(|s| s.hypot(settings.sigma_floor_px)),
        ..corner
    };
    View {
        camera_idx: job.camera_idx,
        pose: job.pose,
        corners: corners.into_iter().map(with_floor).collect(),
    }
}
