//! The target of rings, as a board.

use super::ends::circles_end;
use super::found::{Found, PrintedTarget};
use super::instead::{self, Stated};
use crate::dataset::TargetSpec;
use crate::dataset::image::GrayImage;
use crate::detect::ring_target::{TargetFigures, TargetSettings, locate, printed};
use crate::detect::settings::DetectSettings;
use crate::detect::verdict::{ImageFigures, Refusal};
use calib_rays::observed::Corner;

impl PrintedTarget for TargetSpec {
    fn find(&self, image: &GrayImage, _: &DetectSettings) -> Result<Found, Refusal> {
        let located = locate(image, self, &TargetSettings::default()).map_err(|refusal| {
            instead::other(image, &Stated::rings(self)).unwrap_or_else(|| refusal.into())
        })?;
        let labelled = located
            .markers
            .iter()
            .map(|marker| ((marker.row, marker.col), marker.ring))
            .collect();
        let stated = Stated::rings(self);
        if circles_end((self.rows, self.cols), image, &printed(self), &labelled)
            && let Some(refusal) = instead::other(image, &stated)
        {
            return Err(refusal);
        }
        let figures =
            TargetFigures::of(image, &located, self).ok_or(Refusal::NoBoard { kind: "rings" })?;
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
