//! What every printed target has: its points in an image, labelled.

use super::saddles::{Crossings, Label};
use crate::dataset::image::GrayImage;
use crate::detect::corner_fit::FittedCorner;
use crate::detect::illegible::EDGE_WIDTH_OF_BLUR;
use crate::detect::scatter::{Scattered, beyond_predicted_px};
use crate::detect::settings::DetectSettings;
use crate::detect::verdict::{ImageFigures, Refusal};
use calib_rays::board::BoardSpec;
use calib_rays::numerics::median;
use calib_rays::observed::Corner;
use nalgebra::Vector2;
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
    /// The points by row and column; standard deviations as each fit predicts them.
    pub corners: Vec<Corner>,
    /// What was measured.
    pub figures: ImageFigures,
    /// Quarter turns, clockwise on screen, from upright to how the target is seen: 0 to 3.
    pub quarter_turns: u8,
}

impl Found {
    /// Standard deviation per axis that the points have beyond what their fits predict, px; `None` if too few are
    /// there to tell.
    pub fn model_error_px(&self, board: &BoardSpec) -> Option<f64> {
        let points: Vec<Scattered> = self
            .corners
            .iter()
            .map(|c| Scattered {
                place: board.corner_in_board(c.row, c.col).xy(),
                pixel: Vector2::new(c.pixel.u, c.pixel.v),
                sigma_px: c.sigma_px.unwrap_or(0.0),
            })
            .collect();
        beyond_predicted_px(&points, self.figures.square_px)
    }

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
