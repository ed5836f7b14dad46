//! Corners where two edges cross, fitted where a map says that they are, with what lies beside them
//! covered.
//!
//! Three rounds: windows so small that nothing printed disturbs them give the blur; then everything
//! that does not belong to the crossing is covered as far as the blur carries it, and the windows
//! reach as far as the edges do; then once more for corners that only the better map predicts.

pub use super::smooth::Label;
use super::smooth::keep_smooth;
use crate::dataset::image::GrayImage;
use crate::detect::corner_fit::{CornerGuess, FittedCorner, fit_corner};
use crate::detect::ring_target::local_map::LocalMap;
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::median;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// A crossing that the target has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Its label.
    pub label: Label,
    /// Its place in the target's plane.
    pub at: Vector2<f64>,
    /// Whether the area towards negative x and y is dark.
    pub dark_before: bool,
}

/// What a target's crossings have in common; lengths in the unit of its plane.
#[derive(Debug, Clone)]
pub struct Crossings {
    /// All of them.
    pub all: Vec<Crossing>,
    /// Half the window in which two edges cross and nothing else is printed.
    pub clear: f64,
    /// The same if the `covers` are left out.
    pub reach: f64,
    /// Rectangles (x from, x to, y from, y to) of other print.
    pub covers: Vec<[f64; 4]>,
}

/// Blur to begin with, px.
const FIRST_BLUR_PX: f64 = 1.0;
/// So many standard deviations of the blur are covered around other print, ...
const COVERED_BLURS: f64 = 3.0;
/// ... and this much of a pixel.
const COVERED_PX: f64 = 0.7;
/// A corner must lie this near to where the map has it, in half windows, ...
const MAX_MOVE: f64 = 0.3;
/// ... at least and at most, px.
const LEAST_MOVE_PX: f64 = 1.0;
const MAX_MOVE_PX: f64 = 4.0;
/// Contrast of a corner against the median of the image.
const MIN_AMPLITUDE: f64 = 0.3;
/// Residual against amplitude; where the print ends it is about 0.5.
const MAX_RESIDUAL: f64 = 0.35;
/// And against the median of the image: more is something that covers the corner in part.
const MAX_RESIDUAL_OF_MEDIAN: f64 = 1.8;
/// Corners that scatter more than this factor above the median ...
const MAX_SIGMA: f64 = 4.0;
/// ... and more than this are dropped, px.
const LEAST_SIGMA_LIMIT_PX: f64 = 0.05;
/// How far from a known corner one is looked for, in steps of labels.
const SEARCHED: usize = 2;

/// Fits all crossings that can be predicted from rough pixels of some; `None` if too few are known.
pub fn fit(
    image: &GrayImage,
    crossings: &Crossings,
    rough: &BTreeMap<Label, Vector2<f64>>,
    max_half_window_px: f64,
) -> Option<BTreeMap<Label, FittedCorner>> {
    let places: BTreeMap<Label, Vector2<f64>> =
        crossings.all.iter().map(|c| (c.label, c.at)).collect();
    let mut known = rough.clone();
    let mut fitted = BTreeMap::new();
    let mut blur_px = None;
    for round in 0..3 {
        let map = crossings.map(&known)?;
        let covered;
        let (image, half) = match blur_px {
            None => (image, crossings.clear),
            Some(blur_px) => {
                covered = crossings.covered(image, &map, blur_px);
                (&covered, crossings.reach)
            }
        };
        fitted = crossings
            .all
            .iter()
            .filter(|crossing| is_near(crossing.label, &known))
            .filter_map(|crossing| {
                let corner = fit_one(image, &map, crossing, half, max_half_window_px)?;
                Some((crossing.label, corner))
            })
            .collect();
        keep_good(&mut fitted);
        if round == 0 {
            blur_px = Some(median(fitted.values().map(|c| c.blur_px)).unwrap_or(FIRST_BLUR_PX));
            if fitted.len() * 2 < rough.len() {
                continue;
            }
        }
        known = fitted.iter().map(|(&l, c)| (l, vector(c.pixel))).collect();
        keep_smooth(&mut known, |label| places.get(label).copied());
        fitted.retain(|label, _| known.contains_key(label));
    }
    Some(fitted)
}

fn vector(pixel: PixelPoint) -> Vector2<f64> {
    Vector2::new(pixel.u, pixel.v)
}

fn is_near((row, col): Label, known: &BTreeMap<Label, Vector2<f64>>) -> bool {
    let rows = row.saturating_sub(SEARCHED)..=row + SEARCHED;
    rows.flat_map(|r| (col.saturating_sub(SEARCHED)..=col + SEARCHED).map(move |c| (r, c)))
        .any(|label| known.contains_key(&label))
}

fn fit_one(
    image: &GrayImage,
    map: &LocalMap,
    crossing: &Crossing,
    half: f64,
    max_half_window_px: f64,
) -> Option<FittedCorner> {
    let pixel = map.at(&crossing.at);
    let px_from_square = map.derivative(&crossing.at) * (2.0 * half);
    let guess = CornerGuess {
        pixel: PixelPoint::new(pixel.x, pixel.y),
        px_from_square,
        blur_px: CornerGuess::BLUR_PX,
    };
    // All four areas must be in view: at the image's edge half a corner looks like one.
    for (x, y) in [(-0.2, -0.2), (0.2, -0.2), (-0.2, 0.2), (0.2, 0.2)] {
        let at = pixel + px_from_square * Vector2::new(x, y);
        let (width, height) = (image.sensor.width, image.sensor.height);
        let inside = |x: f64, count: u32| x >= 0.0 && x <= f64::from(count) - 1.0;
        if !(inside(at.x, width) && inside(at.y, height)) {
            return None;
        }
    }
    let corner = fit_corner(image, &guess, max_half_window_px)?;
    let side_px = px_from_square
        .column(0)
        .norm()
        .min(px_from_square.column(1).norm());
    let amplitude = if crossing.dark_before {
        corner.amplitude
    } else {
        -corner.amplitude
    };
    let limit_px = (MAX_MOVE * side_px / 2.0).clamp(LEAST_MOVE_PX, MAX_MOVE_PX);
    let genuine = amplitude > 0.0
        && corner.residual_rms <= MAX_RESIDUAL * amplitude
        && corner.moved_px <= limit_px;
    genuine.then_some(corner)
}

/// Leaves out corners unlike most of the image's.
fn keep_good(fitted: &mut BTreeMap<Label, FittedCorner>) {
    let median_of = |of: fn(&FittedCorner) -> f64| median(fitted.values().map(of));
    let (Some(amplitude), Some(residual), Some(sigma)) = (
        median_of(|c| c.amplitude.abs()),
        median_of(|c| c.residual_rms / c.amplitude.abs()),
        median_of(|c| c.sigma_px),
    ) else {
        return;
    };
    let sigma_limit = (MAX_SIGMA * sigma).max(LEAST_SIGMA_LIMIT_PX);
    fitted.retain(|_, c| {
        c.amplitude.abs() >= MIN_AMPLITUDE * amplitude
            && c.residual_rms <= (MAX_RESIDUAL_OF_MEDIAN * residual + 0.02) * c.amplitude.abs()
            && c.sigma_px <= sigma_limit
    });
}

impl Crossings {
    /// The map through pixels of crossings.
    pub fn map(&self, known: &BTreeMap<Label, Vector2<f64>>) -> Option<LocalMap> {
        let pairs: Vec<_> = self
            .all
            .iter()
            .filter_map(|crossing| Some((crossing.at, *known.get(&crossing.label)?)))
            .collect();
        LocalMap::fit(&pairs)
    }

    /// The image without its other print: those pixels have no value.
    fn covered(&self, image: &GrayImage, map: &LocalMap, blur_px: f64) -> GrayImage {
        let mut places = Vec::new();
        let spread_px = COVERED_BLURS * blur_px + COVERED_PX;
        for &[left, right, upper, lower] in &self.covers {
            let middle = Vector2::new((left + right) / 2.0, (upper + lower) / 2.0);
            let center = map.at(&middle);
            let px_from_plane = map.derivative(&middle);
            let Some(plane_from_px) = px_from_plane.try_inverse() else {
                continue;
            };
            // The print and what its blur reaches, as a parallelogram: bent by less than a tenth of a
            // pixel over one marker.
            let widen = |axis: usize| spread_px * plane_from_px.row(axis).norm();
            let (half_x, half_y) = (
                (right - left) / 2.0 + widen(0),
                (lower - upper) / 2.0 + widen(1),
            );
            let reach = |row: usize| {
                px_from_plane[(row, 0)].abs() * half_x + px_from_plane[(row, 1)].abs() * half_y
            };
            let (reach_u, reach_v) = (reach(0), reach(1));
            if !(center.x.is_finite() && center.y.is_finite() && reach_u + reach_v < 1e5) {
                continue;
            }
            let range = |at: f64, reach: f64, count: u32| {
                let low = (at - reach).floor().max(0.0) as i64;
                let high = (at + reach).ceil().min(f64::from(count) - 1.0) as i64;
                low..=high
            };
            let width = image.sensor.width as usize;
            for v in range(center.y, reach_v, image.sensor.height) {
                for u in range(center.x, reach_u, image.sensor.width) {
                    let offset = plane_from_px * (Vector2::new(u as f64, v as f64) - center);
                    if offset.x.abs() <= half_x && offset.y.abs() <= half_y {
                        places.push(v as usize * width + u as usize);
                    }
                }
            }
        }
        let mut covered = image.clone();
        covered.cover(places.into_iter());
        covered
    }
}
