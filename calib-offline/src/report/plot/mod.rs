//! The report's figures: one file per figure, each an SVG drawing with its caption.
//!
//! Colors are classes of the page's style sheet, so that a drawing is readable on light and on
//! dark ground. All drawings are [`WIDTH`] units wide, about what a phone shows at full size.

pub mod blob_curve;
pub mod cost;
pub mod coverage;
pub mod histogram;
pub mod pose_rms;
pub mod residual_vectors;
pub mod scene;
pub mod uncertainty_map;

/// Width of every drawing, units.
pub const WIDTH: f64 = 400.0;

/// A drawing with what a reader needs to read it.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// What is shown.
    pub title: String,
    /// The drawing.
    pub svg: String,
    /// Units, scale and counts of this drawing.
    pub caption: String,
}
