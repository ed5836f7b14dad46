//! What became of an image of the target: located, or refused and why.

use super::located::Located;
use super::ring_fit::FittedRing;
use crate::dataset::TargetSpec;
use crate::dataset::image::GrayImage;
use crate::detect::illegible::{EDGE_WIDTH_OF_BLUR, Illegible, Shown};
use calib_rays::numerics::median;
use std::path::PathBuf;

/// The verdict on one image of the target.
#[derive(Debug)]
pub struct TargetImage {
    /// Index into the dataset's cameras.
    pub camera_idx: usize,
    /// Index of the target pose.
    pub pose: usize,
    /// The file.
    pub path: PathBuf,
    /// The labelled markers, or why there are none.
    pub outcome: Result<Located, TargetRefusal>,
    /// What was measured, if markers were labelled.
    pub figures: Option<TargetFigures>,
}

/// Why an image of the target is not used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TargetRefusal {
    /// The image shows nothing clearly.
    #[error(transparent)]
    Illegible(#[from] Illegible),
    /// Nothing that looks like a ring.
    #[error("no ring markers found: is the target in view, and lit evenly?")]
    NoMarkers,
    /// Too few rings that are neighbors.
    #[error(
        "only {have} ring markers in rows and columns were found, and it takes {need}: show more \
         of the target, larger, and without reflections"
    )]
    TooFewMarkers {
        /// Markers found.
        have: usize,
        /// Fewest that are used.
        need: usize,
    },
    /// Markers of another size than stated.
    #[error(
        "the markers' outer radius is {found:.2} of their distance, and the manifest says \
         {ordinary:.2} and {direction:.2}: check outer_radius_mm and pitch_mm (radii, not diameters)"
    )]
    WrongSize {
        /// Median outer radius in pitches.
        found: f64,
        /// Of ordinary markers by the manifest.
        ordinary: f64,
        /// Of direction markers by the manifest.
        direction: f64,
    },
    /// The markers in view could be several parts of the target.
    #[error(
        "{marker_count} markers are in view, and they fit on the target in {placement_count} ways: \
         show more of the larger markers"
    )]
    AmbiguousDirection {
        /// Markers in view.
        marker_count: usize,
        /// Ways to place them.
        placement_count: usize,
    },
    /// A mirror image.
    #[error(
        "the image shows the mirror image of the target: was it flipped, taken in a mirror, or from \
         behind? Or count rows or cols of direction from the other end"
    )]
    Mirrored,
    /// Another pattern of large and small markers.
    #[error(
        "the larger markers are not where the manifest has them: wherever the target's {rows} x \
         {cols} markers are laid, {contradictions} of the {marker_count} seen contradict; check \
         rows, cols and direction"
    )]
    WrongTarget {
        /// Rows of the target.
        rows: usize,
        /// Columns of the target.
        cols: usize,
        /// Contradicting markers at the best place.
        contradictions: usize,
        /// Markers in view.
        marker_count: usize,
    },
}

impl TargetRefusal {
    /// The image has `have` markers in rows and columns (of `rings` that look like some), which is
    /// too few.
    pub fn too_few(image: &GrayImage, rings: usize, have: usize, need: usize) -> Self {
        match Illegible::of(image, Shown::Target) {
            Some(illegible) => illegible.into(),
            None if rings == 0 => Self::NoMarkers,
            None => Self::TooFewMarkers { have, need },
        }
    }
}

/// What was measured in an image with a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetFigures {
    /// Markers labelled.
    pub marker_count: usize,
    /// Whether that is less than the whole target.
    pub partial: bool,
    /// Difference of markers and plate, percent of the white level. Median, as all below.
    pub contrast_percent: f64,
    /// Width of the markers' edges from 10 % to 90 %, px.
    pub edge_px: f64,
    /// Mean outer radius of the markers' images, px.
    pub radius_px: f64,
    /// RMS residual of the fits, percent of the contrast.
    pub residual_percent: f64,
    /// Standard deviation of a center per axis, px, predicted from the residuals.
    pub sigma_px: f64,
    /// How far the centers lie from the middles of their outlines, by the perspective, px.
    pub perspective_px: f64,
}

impl TargetFigures {
    /// The figures of an image; `None` without markers.
    pub fn of(image: &GrayImage, located: &Located, target: &TargetSpec) -> Option<Self> {
        let rings = || located.markers.iter().map(|marker| &marker.ring);
        let contrast = median(rings().map(|r| r.contrast.abs()))?;
        Some(Self {
            marker_count: located.markers.len(),
            partial: located.markers.len() < target.marker_count(),
            contrast_percent: 100.0 * contrast / f64::from(image.white_level),
            edge_px: EDGE_WIDTH_OF_BLUR * median(rings().map(|r| r.blur_px))?,
            radius_px: median(rings().map(FittedRing::mean_radius_px))?,
            residual_percent: 100.0 * median(rings().map(|r| r.residual_rms))? / contrast,
            sigma_px: median(rings().map(|r| r.sigma_px))?,
            perspective_px: median(
                located
                    .markers
                    .iter()
                    .map(|m| m.ring.pixel.distance_px(m.uncorrected)),
            )?,
        })
    }
}
