//! A straight edge as pixels see it: blurred by the lens, then integrated over each pixel's square.
//!
//! Across an edge whose normal is (cos a, sin a) a pixel's square weighs the light like two boxes of
//! the widths |cos a| and |sin a|, one folded with the other. Their variances sum to 1/12 px^2 at
//! every angle, their fourth cumulants to `-(cos^4 a + sin^4 a) / 120`. One box of the width
//! `W = (cos^4 a + sin^4 a)^(1/4)` folded with a Gaussian of the variance `(1 - W^2) / 12` has the same
//! two: exact where the edge follows the grid, right up to the sixth order elsewhere. The lens's blur,
//! another Gaussian, may go to nothing without the edge becoming a jump.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_2_SQRT_PI};
use std::sync::LazyLock;

/// Variance of a pixel's square along any direction, px^2.
pub const PIXEL_VARIANCE: f64 = 1.0 / 12.0;
/// Beyond this many standard deviations of the Gaussian, a step is flat to 6e-7.
const FLAT_BEYOND: f64 = 5.0;
/// Nodes of the table of the step per standard deviation: between them, cubics are wrong by less
/// than 1e-9.
const NODES_PER_SIGMA: f64 = 64.0;

/// The profile across an edge at one angle and blur.
#[derive(Debug, Clone, Copy)]
pub struct PixelEdge {
    half_width: f64,
    per_width: f64,
    sigma: f64,
    per_sigma: f64,
    /// Half the profile's width: beyond, it is flat.
    pub reach_px: f64,
}

/// A profile at one distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Across {
    /// Mean over the pixel of what is -1 before the edge and 1 behind it.
    pub value: f64,
    /// Its derivative by the distance, 1/px.
    pub by_distance: f64,
    /// Its derivative by the variance of the lens's blur, 1/px^2.
    pub by_variance: f64,
}

impl PixelEdge {
    /// For an edge of a given direction (sine, cosine), and a lens that blurs by `variance` px^2.
    ///
    /// `shape` is the direction that the box is taken from: held while a fit turns the edge by a
    /// little, so that derivatives are those of what is minimized.
    pub fn new(shape: (f64, f64), variance: f64) -> Self {
        let (sin, cos) = shape;
        let width = (cos.powi(4) + sin.powi(4)).sqrt().sqrt();
        let sigma = (variance + (1.0 - width * width).max(0.0) * PIXEL_VARIANCE).sqrt();
        Self {
            half_width: width / 2.0,
            per_width: 1.0 / width,
            sigma,
            per_sigma: 1.0 / sigma,
            reach_px: width / 2.0 + FLAT_BEYOND * sigma,
        }
    }

    /// At a distance of the pixel's middle from the edge, px.
    #[inline]
    pub fn at(&self, distance: f64) -> Across {
        if distance.abs() >= self.reach_px {
            return Across {
                value: distance.signum(),
                by_distance: 0.0,
                by_variance: 0.0,
            };
        }
        let (near, far) = (distance - self.half_width, distance + self.half_width);
        let (x0, x1) = (near * self.per_sigma, far * self.per_sigma);
        let ((s0, g0), (s1, g1)) = (STEP.at(x0), STEP.at(x1));
        Across {
            value: (far * s1 - near * s0 + self.sigma * (g1 - g0)) * self.per_width,
            by_distance: (s1 - s0) * self.per_width,
            by_variance: (g1 - g0) * (0.5 * self.per_sigma * self.per_width),
        }
    }
}

/// `erf(x / sqrt 2)` and its derivative, at nodes from 0 on.
struct Table(Vec<[f64; 2]>);

static STEP: LazyLock<Table> = LazyLock::new(|| {
    let nodes = (FLAT_BEYOND * NODES_PER_SIGMA) as usize + 2;
    Table(
        (0..nodes)
            .map(|k| exact(k as f64 / NODES_PER_SIGMA))
            .collect(),
    )
});

fn exact(x: f64) -> [f64; 2] {
    [
        libm::erf(x * FRAC_1_SQRT_2),
        FRAC_2_SQRT_PI * FRAC_1_SQRT_2 * (-0.5 * x * x).exp(),
    ]
}

impl Table {
    /// The step and its derivative, by cubics through values and slopes of both.
    #[inline]
    fn at(&self, x: f64) -> (f64, f64) {
        const H: f64 = 1.0 / NODES_PER_SIGMA;
        let place = x.abs() * NODES_PER_SIGMA;
        let index = place as usize;
        let Some(&[[s0, g0], [s1, g1]]) = self.0.get(index..index + 2).and_then(<[_]>::as_array)
        else {
            return (x.signum(), 0.0);
        };
        let t = place - index as f64;
        let x0 = index as f64 * H;
        let cubic = |a: f64, slope_a: f64, b: f64, slope_b: f64| {
            let rise = b - a;
            let (p, q) = (slope_a * H - rise, rise - slope_b * H);
            a + t * (rise + (1.0 - t) * ((1.0 - t) * p + t * q))
        };
        let step = cubic(s0, g0, s1, g1);
        let slope = cubic(g0, -x0 * g0, g1, -(x0 + H) * g1);
        (if x < 0.0 { -step } else { step }, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_step_to_a_billionth() {
        for k in -5100..5100 {
            let x = f64::from(k) / 1000.0;
            let (step, slope) = STEP.at(x);
            let [erf, gauss] = exact(x);
            let flat = x.abs() > FLAT_BEYOND;
            let limits = if flat { (6e-7, 4e-6) } else { (1e-9, 1e-8) };
            assert!((step - erf).abs() < limits.0, "{x}");
            assert!((slope - gauss).abs() < limits.1, "{x}");
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        for (angle, variance) in [(0.0_f64, 0.04), (0.4, 0.0), (0.785, 0.5), (1.5, 0.01)] {
            let edge = |variance| PixelEdge::new(angle.sin_cos(), variance);
            for k in -12..12 {
                let d = f64::from(k) * 0.1 + 0.013;
                let at = edge(variance).at(d);
                let value = |d: f64, v: f64| edge(v).at(d).value;
                let by_d = (value(d + 1e-5, variance) - value(d - 1e-5, variance)) / 2e-5;
                assert!((at.by_distance - by_d).abs() < 1e-5, "{angle} {d}");
                let by_v = (value(d, variance + 2e-5) - value(d, variance)) / 2e-5;
                assert!((at.by_variance - by_v).abs() < 2e-2, "{angle} {d}");
            }
        }
    }

    #[test]
    fn the_profile_is_the_area_beyond_the_edge() {
        // Without a lens's blur: the share of the unit square, by a fine raster of lines.
        for angle in [0.0_f64, 0.1, 0.3, 0.6, 0.785] {
            let (sin, cos) = angle.sin_cos();
            // At an angle, the fourth-order profile is off by this much of half the contrast.
            let limit = if angle == 0.0 { 2e-3 } else { 0.03 };
            let edge = PixelEdge::new((sin, cos), 1e-8);
            for k in -8..=8 {
                let d = f64::from(k) / 8.0;
                let line = |y: f64| ((d + sin * y) / cos).clamp(-0.5, 0.5) * 2.0;
                let rows = (0..2000).map(|r| line((f64::from(r) + 0.5) / 2000.0 - 0.5));
                let area = rows.sum::<f64>() / 2000.0;
                let error = edge.at(d).value - area;
                assert!(error.abs() < limit, "{angle} {d}: {error}");
            }
        }
    }
}
