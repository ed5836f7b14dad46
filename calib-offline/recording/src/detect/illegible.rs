//! Why an image shows nothing clearly, whatever it should show.

use crate::dataset::image::GrayImage;

/// An edge blurred by a Gaussian takes this many standard deviations from 10 % to 90 %.
pub(super) const EDGE_WIDTH_OF_BLUR: f64 = 2.563;
/// Less contrast than this part of the range is refused: with 8 bits, 10 code values.
const MIN_CONTRAST_PERCENT: f64 = 4.0;
/// Without a board, edges at least this wide are called blurred, px.
const BLURRED_EDGE_PX: f64 = 8.0;

/// Smaller squares leave too few pixels between corners.
const SMALLEST_SQUARE_PX: f64 = 6.0;
/// More noise than this part of the contrast hides corners.
const MOST_NOISE_PERCENT: f64 = 18.0;

/// Slopes looked at, about.
const MOST_SLOPES: i64 = 2_000_000;

/// What an image should show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The calibration board.
    Board,
    /// The measurement target.
    Target,
}

impl std::fmt::Display for Shown {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Board => "board",
            Self::Target => "target",
        })
    }
}

/// Why an image shows nothing clearly.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Illegible {
    /// Bright and dark differ by too little.
    #[error(
        "too little contrast: bright and dark differ by {contrast_percent:.1} % of the range; \
         expose longer or light the {shown} better"
    )]
    LowContrast {
        /// Difference of the 99.5 % and the 0.5 % quantile, percent of the white level.
        contrast_percent: f64,
        /// What was looked for.
        shown: Shown,
    },
    /// The edges of what was looked for, or the steepest of the image if it was not found, are too
    /// wide.
    #[error(
        "blurred: the edges are about {edge_px:.0} px wide; focus the lens, and let the {shown} stand \
         still"
    )]
    Blurred {
        /// Width of the edges from 10 % to 90 %, px.
        edge_px: f64,
        /// What was looked for.
        shown: Shown,
    },
    /// Noise hides the corners.
    #[error(
        "too noisy: the image differs from clean squares by {noise_percent:.0} % of their contrast; light the {shown} \
         better, expose longer, or average several images"
    )]
    Noisy {
        /// RMS of what is no edge, percent of the contrast.
        noise_percent: f64,
        /// What was looked for.
        shown: Shown,
    },
    /// Squares of a few pixels.
    #[error(
        "squares of {square_px:.1} px are too small, some {SMALLEST_SQUARE_PX:.0} px are needed; come nearer, use larger \
         squares, or record at a higher resolution"
    )]
    SmallSquares {
        /// Shorter side of a square, px.
        square_px: f64,
    },
}

impl Illegible {
    /// What keeps a board that was found in part from being found as a whole; `None` if it is nothing of the image.
    /// `noise_percent` is of the contrast.
    pub fn of_board(square_px: f64, contrast_percent: f64, noise_percent: f64) -> Option<Self> {
        let shown = Shown::Board;
        if square_px < SMALLEST_SQUARE_PX {
            return Some(Self::SmallSquares { square_px });
        }
        if contrast_percent < MIN_CONTRAST_PERCENT {
            return Some(Self::LowContrast {
                contrast_percent,
                shown,
            });
        }
        (noise_percent > MOST_NOISE_PERCENT).then_some(Self::Noisy {
            noise_percent,
            shown,
        })
    }

    /// Edges blurred by a standard deviation of so many pixels.
    pub fn blurred(blur_px: f64, shown: Shown) -> Self {
        Self::Blurred {
            edge_px: EDGE_WIDTH_OF_BLUR * blur_px,
            shown,
        }
    }

    /// What is wrong with an image in which nothing was found; `None` if it is clear enough.
    pub fn of(image: &GrayImage, shown: Shown) -> Option<Self> {
        let [dark, bright] = image.quantiles([0.005, 0.995]);
        let contrast = f64::from(bright - dark);
        let contrast_percent = 100.0 * contrast / f64::from(image.white_level);
        if contrast_percent < MIN_CONTRAST_PERCENT {
            return Some(Self::LowContrast {
                contrast_percent,
                shown,
            });
        }
        let steepest = steepest_slope(image);
        // A step blurred by a Gaussian has the slope contrast / (sigma sqrt(2 pi)).
        let blur_px = contrast / (steepest * std::f64::consts::TAU.sqrt());
        let is_blurred = EDGE_WIDTH_OF_BLUR * blur_px > BLURRED_EDGE_PX;
        is_blurred.then(|| Self::blurred(blur_px, shown))
    }
}

/// The slope that 0.5 % of the pixels exceed, code values per pixel (central differences).
fn steepest_slope(image: &GrayImage) -> f64 {
    let (width, height) = (
        i64::from(image.sensor.width),
        i64::from(image.sensor.height),
    );
    // Of a large image some of the rows tell as much.
    let step = (width * height / MOST_SLOPES).max(1) as usize;
    let mut slopes = Vec::new();
    for v in (1..height - 1).step_by(step) {
        for u in 1..width - 1 {
            let at = |u, v| image.at(u, v).map_or(0.0, f64::from);
            let (du, dv) = (at(u + 1, v) - at(u - 1, v), at(u, v + 1) - at(u, v - 1));
            slopes.push(du.hypot(dv) / 2.0);
        }
    }
    slopes.sort_unstable_by(f64::total_cmp);
    let k = (slopes.len() as f64 * 0.995) as usize;
    slopes
        .get(k.min(slopes.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
        .max(f64::MIN_POSITIVE)
}
