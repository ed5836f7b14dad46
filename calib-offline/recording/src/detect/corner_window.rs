//! The pixels of a corner's fit: those near its edges one by one, the flat ones by their sums.

use super::edge_fit::{Fitted, Limits, NormalEquations, Range, fit};
use super::edge_model::{
    AMPLITUDE, EdgeModel, Edges, MEAN, Parameters, SLOPE_U, SLOPE_V, VARIANCE,
};
use crate::dataset::image::GrayImage;
use calib_rays::geometry::PixelPoint;
use nalgebra::{Matrix2, SMatrix, Vector2};

/// Half the side of the window, as a fraction of the squares around the corner: the window ends
/// midway to the next parallel edge.
const HALF_WINDOW_SQUARES: f64 = 0.5;
/// Windows with fewer pixels do not determine nine unknowns well.
const MIN_PIXELS: usize = 25;
/// A step below so many pixels (radians for the directions, square pixels for the blur) ends the iteration; convergence is
/// quadratic, so that the error left is far smaller.
const LIMITS: Limits = Limits {
    iterations: 40,
    step: 1e-5,
    placing: 5,
};
/// Standard deviation of the lens's blur, px: below the first an edge is as sharp as pixels can show,
/// above the second there is none.
const BLUR_RANGE_PX: (f64, f64) = (0.005, 40.0);
/// A step leaves at least this part of the blur's variance: of an edge that is much too sharp along the
/// grid, no pixel tells that it is.
const BLUR_SHRINK: f64 = 0.25;
/// Light that changes by more than this part per px is an edge.
const MAX_SLOPE: f64 = 0.1;
/// Beyond the reach of an edge pixels count as flat while it moves by no more than this, px.
const FLAT_MARGIN_PX: f64 = 1.0;

/// A pixel, counted from the window's middle.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    x: f64,
    y: f64,
    value: f64,
}

/// The pixels of a fit.
pub(super) struct Window {
    pixels: Vec<Pixel>,
    /// The pixel that they are counted from.
    middle: (f64, f64),
    pub radius_px: f64,
}

impl Window {
    pub fn around(
        image: &GrayImage,
        center: PixelPoint,
        px_from_square: &Matrix2<f64>,
        max_half_window_px: f64,
    ) -> Option<Self> {
        let square_from_px = px_from_square.try_inverse()?;
        let reach = |row: usize| {
            let extent = px_from_square[(row, 0)].abs() + px_from_square[(row, 1)].abs();
            (HALF_WINDOW_SQUARES * extent)
                .min(max_half_window_px)
                .ceil()
        };
        if !(reach(0).is_finite() && reach(1).is_finite() && image.sensor.contains(center)) {
            return None;
        }
        let middle = (center.u.round(), center.v.round());
        let (u0, v0) = (middle.0 as i64, middle.1 as i64);
        let (reach_u, reach_v) = (reach(0) as i64, reach(1) as i64);
        let mut pixels = Vec::with_capacity(((2 * reach_u + 1) * (2 * reach_v + 1)) as usize);
        for v in v0 - reach_v..=v0 + reach_v {
            for u in u0 - reach_u..=u0 + reach_u {
                let offset = Vector2::new(u as f64 - center.u, v as f64 - center.v);
                let inside = offset.norm_squared() <= max_half_window_px * max_half_window_px
                    && (square_from_px * offset).amax() < HALF_WINDOW_SQUARES;
                if let (true, Some(value)) = (inside, image.at(u, v)) {
                    pixels.push(Pixel {
                        x: (u - u0) as f64,
                        y: (v - v0) as f64,
                        value: f64::from(value),
                    });
                }
            }
        }
        (pixels.len() >= MIN_PIXELS).then_some(Self {
            pixels,
            middle,
            radius_px: reach(0).max(reach(1)),
        })
    }

    /// A dark and a bright level: the 10 % and the 90 % quantile. `None` in a flat window.
    pub fn levels(&self) -> Option<(f64, f64)> {
        let mut values: Vec<f64> = self.pixels.iter().map(|p| p.value).collect();
        let (low, high) = (values.len() / 10, values.len() * 9 / 10);
        let (_, &mut bright, _) = values.select_nth_unstable_by(high, f64::total_cmp);
        let (_, &mut dark, _) = values.select_nth_unstable_by(low, f64::total_cmp);
        (bright > dark).then_some((dark, bright))
    }

    /// Whether bright and dark lie as the model has them, rather than exchanged.
    pub fn agrees(&self, model: &EdgeModel) -> bool {
        let edges = model.edges(self.middle, model.directions());
        let along = |pixel: &Pixel| {
            let (n1, n2) = edges.distances(pixel.x, pixel.y);
            (pixel.value - edges.mean) * n1.signum() * n2.signum()
        };
        self.pixels.iter().map(along).sum::<f64>() >= 0.0
    }

    /// The pixels near the edges of a model, and what the flat ones sum to.
    pub fn parts(&self, model: &EdgeModel) -> Parts {
        let shapes = model.directions();
        let edges = model.edges(self.middle, shapes);
        let reach = edges.profiles.map(|p| p.reach_px + FLAT_MARGIN_PX);
        let mut parts = Parts {
            middle: self.middle,
            radius_px: self.radius_px,
            shapes,
            reach,
            near: Vec::with_capacity(self.pixels.len()),
            flat: [Moments::default(); 2],
        };
        for &pixel in &self.pixels {
            let (n1, n2) = edges.distances(pixel.x, pixel.y);
            if n1.abs() < reach[0] || n2.abs() < reach[1] {
                parts.near.push(pixel);
            } else {
                parts.flat[usize::from((n1 > 0.0) == (n2 > 0.0))].add(pixel);
            }
        }
        parts
    }
}

/// A window, parted by a model.
pub(super) struct Parts {
    middle: (f64, f64),
    radius_px: f64,
    /// Directions that the model's profiles are taken from.
    shapes: [(f64, f64); 2],
    /// Farther from both lines pixels are flat.
    reach: [f64; 2],
    near: Vec<Pixel>,
    /// Flat pixels where the model is `m - a`, and where it is `m + a`.
    flat: [Moments; 2],
}

impl Parts {
    /// Whether the flat pixels are flat for another model too.
    pub fn hold(&self, model: &EdgeModel) -> bool {
        let edges = model.edges(self.middle, model.directions());
        let mut reached = edges.profiles.iter().zip(self.reach);
        reached.all(|(profile, reach)| profile.reach_px <= reach)
    }

    /// `None` where the equations determine no model.
    pub fn solve(&self, start: EdgeModel) -> Option<Fitted<9>> {
        let range = |unknown, least, most| Range {
            unknown,
            least,
            most,
            shrink: 0.0,
        };
        let (sharp, blurred) = BLUR_RANGE_PX;
        let slope = MAX_SLOPE / self.radius_px.max(1.0);
        let ranges = [
            Range {
                shrink: BLUR_SHRINK,
                ..range(VARIANCE, sharp * sharp, blurred * blurred)
            },
            range(SLOPE_U, -slope, slope),
            range(SLOPE_V, -slope, slope),
        ];
        fit(start.0, &LIMITS, &ranges, |unknowns| {
            Some(self.equations(&EdgeModel(*unknowns)))
        })
    }

    fn equations(&self, model: &EdgeModel) -> NormalEquations<9> {
        let edges = model.edges(self.middle, self.shapes);
        let mut sum = NormalEquations::none();
        for pixel in &self.near {
            let (predicted, gradient) = edges.value_and_gradient(pixel.x, pixel.y);
            sum.add(pixel.value - predicted, &gradient);
        }
        for (moments, sign) in self.flat.iter().zip([-1.0, 1.0]) {
            moments.add_to(&mut sum, &edges, sign);
        }
        sum
    }
}

/// Sums over flat pixels: all that the equations need of them.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: usize,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    value: f64,
    value_x: f64,
    value_y: f64,
    value_squared: f64,
}

impl Moments {
    fn add(&mut self, pixel: Pixel) {
        let Pixel { x, y, value } = pixel;
        self.count += 1;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        self.value += value;
        self.value_x += value * x;
        self.value_y += value * y;
        self.value_squared += value * value;
    }

    /// Adds pixels whose value is `(1 + p x + q y) (m + sign a)`.
    fn add_to(&self, sum: &mut NormalEquations<9>, edges: &Edges, sign: f64) {
        let (p, q) = edges.slope;
        let level = edges.mean + sign * edges.amplitude;
        // Sums of the light's factor: times itself, times x and y, times the values.
        let light_x = self.x + p * self.xx + q * self.xy;
        let light_y = self.y + p * self.xy + q * self.yy;
        let light = self.count as f64 + p * self.x + q * self.y;
        let light_squared = light + p * light_x + q * light_y;
        let light_value = self.value + p * self.value_x + q * self.value_y;
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        normal[(MEAN, MEAN)] = light_squared;
        normal[(AMPLITUDE, MEAN)] = sign * light_squared;
        normal[(AMPLITUDE, AMPLITUDE)] = light_squared;
        for (slope, light) in [(SLOPE_U, light_x), (SLOPE_V, light_y)] {
            normal[(slope, MEAN)] = level * light;
            normal[(slope, AMPLITUDE)] = sign * level * light;
        }
        normal[(SLOPE_U, SLOPE_U)] = level * level * self.xx;
        normal[(SLOPE_V, SLOPE_U)] = level * level * self.xy;
        normal[(SLOPE_V, SLOPE_V)] = level * level * self.yy;
        let along = light_value - level * light_squared;
        let mut right = Parameters::zeros();
        right[MEAN] = along;
        right[AMPLITUDE] = sign * along;
        right[SLOPE_U] = level * (self.value_x - level * light_x);
        right[SLOPE_V] = level * (self.value_y - level * light_y);
        let cost = self.value_squared - level * (light_value + along);
        sum.add_sums(&normal, &right, cost, self.count);
    }
}
