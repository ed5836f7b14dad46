//! Targets whose print says which point is which: `ChArUco` boards, grids of `AprilTags`, grids of circles
//! and of rings, chessboards with marked squares.
//!
//! Each kind finds its own points ([`PrintedTarget`]); what is found in one image needs no other image.
//! The corners of boards and tags are crossings of two edges and fitted as such ([`saddles`]), centers of
//! circles come from the fit of rings ([`super::ring_target`]).

pub mod april_grid;
pub mod cells;
pub mod charuco;
pub mod charuco_seen;
pub mod circles;
pub mod homography;
pub mod quads;
pub mod rings;
pub mod saddles;
mod smooth;
mod turns;

use super::corner_fit::FittedCorner;
use super::detection::Detection;
use super::detection::turned_images;
use super::error::DetectError;
use super::illegible::EDGE_WIDTH_OF_BLUR;
use super::job::{Job, all_loaded};
use super::pair_check::pair_checks;
use super::settings::DetectSettings;
use super::verdict::{ImageFigures, ImageVerdict, MissingCorner, Outcome, Refusal};
use crate::dataset::image::GrayImage;
use crate::dataset::{BoardKind, Dataset};
use calib_rays::numerics::median;
use calib_rays::observed::{Corner, View};
use calib_rays::progress::Progress;
use nalgebra::Vector2;
use rayon::prelude::*;
use saddles::{Crossings, Label};
use std::collections::BTreeMap;

/// A target that tells its points apart.
pub trait PrintedTarget: Sync {
    /// The labelled points of an image.
    ///
    /// # Errors
    /// [`Refusal`]: why there are none.
    fn find(&self, image: &GrayImage, settings: &DetectSettings) -> Result<Found, Refusal>;

    /// In how many ways a whole target can be numbered, because it looks the same after a turn: 1, 2 (half
    /// turns) or 4 (quarter turns too).
    fn numberings(&self) -> u8 {
        1
    }
}

/// What was found in one image.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The points by row and column; standard deviations without the floor for what every model leaves
    /// out.
    pub corners: Vec<Corner>,
    /// What was measured.
    pub figures: ImageFigures,
    /// Quarter turns, clockwise on screen, from upright to how the target is seen: 0 to 3.
    pub quarter_turns: u8,
}

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

impl Found {
    /// Fitted crossings as points; `square` is the side of the usual square in the target's plane.
    pub(super) fn of_corners(
        image: &GrayImage,
        crossings: &Crossings,
        fitted: &BTreeMap<Label, FittedCorner>,
        square: f64,
    ) -> Option<Self> {
        let median_of = |of: fn(&FittedCorner) -> f64| median(fitted.values().map(of));
        let amplitude = median_of(|c| c.amplitude.abs())?;
        let pixels: BTreeMap<Label, Vector2<f64>> = fitted
            .iter()
            .map(|(&label, c)| (label, Vector2::new(c.pixel.u, c.pixel.v)))
            .collect();
        let map = crossings.map(&pixels)?;
        let seen = crossings
            .all
            .iter()
            .filter(|c| fitted.contains_key(&c.label));
        let sides = seen.clone().map(|c| {
            let sides = map.derivative(&c.at) * square;
            sides.column(0).norm().min(sides.column(1).norm())
        });
        let along: Vector2<f64> = seen
            .map(|c| map.derivative(&c.at).column(0).normalize())
            .sum();
        Some(Self {
            figures: ImageFigures {
                corner_count: fitted.len(),
                contrast_percent: 200.0 * amplitude / f64::from(image.white_level),
                edge_px: EDGE_WIDTH_OF_BLUR * median_of(|c| c.blur_px)?,
                square_px: median(sides)?,
                residual_percent: 50.0 * median_of(|c| c.residual_rms)? / amplitude,
                sigma_px: median_of(|c| c.sigma_px)?,
            },
            corners: fitted
                .iter()
                .map(|(&(row, col), c)| Corner {
                    row,
                    col,
                    pixel: c.pixel,
                    sigma_px: Some(c.sigma_px),
                })
                .collect(),
            quarter_turns: quarter_turns(&along),
        })
    }
}

/// How often the direction along the columns is turned from u towards v.
pub(super) fn quarter_turns(along_columns: &Vector2<f64>) -> u8 {
    let angle_rad = along_columns.y.atan2(along_columns.x);
    let quarters = (angle_rad / std::f64::consts::FRAC_PI_2).round() as i32;
    quarters.rem_euclid(4) as u8
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
    Ok(Detection {
        turned: turned_images(&images),
        pair_checks: pair_checks(&views),
        views,
        images,
    })
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
