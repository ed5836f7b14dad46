//! The target of rings, as a board.

use super::found::{Found, PrintedTarget};
use crate::dataset::TargetSpec;
use crate::dataset::image::GrayImage;
use crate::detect::ring_target::{TargetFigures, TargetSettings, locate};
use crate::detect::settings::DetectSettings;
use crate::detect::verdict::{ImageFigures, Refusal};
use calib_rays::observed::Corner;

impl PrintedTarget for TargetSpec {
    fn find(&self, image: &GrayImage, _: &DetectSettings) -> Result<Found, Refusal> {
        let located = locate(image, self, &TargetSettings::default())?;
        let figures = TargetFigures::of(image, &located, self).ok_or(Refusal::NoBoard)?;
        Ok(Found {
            figures: ImageFigures {
                corner_count: located.markers.len(),
                contrast_percent: figures.contrast_percent,
                edge_px: figures.edge_px,
                square_px: figures.radius_px * self.pitch_mm / self.outer_radius_mm,
                residual_percent: figures.residual_percent,
                sigma_px: figures.sigma_px,
            },
            corners: located
                .markers
                .iter()
                .map(|marker| Corner {
                    row: marker.row,
                    col: marker.col,
                    pixel: marker.ring.pixel,
                    sigma_px: Some(marker.ring.sigma_px),
                })
                .collect(),
            quarter_turns: located.quarter_turns,
        })
    }
}
