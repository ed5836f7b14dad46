//! What the image is modelled as around a corner: two blurred edges and the light.
//!
//! `(1 + g . d) (m + a E(n1) E(n2))`: `n1`, `n2` are the signed distances to two straight lines through the corner, `E` is a
//! step blurred by the lens and integrated over the pixel (`pixel_edge.rs`), and g is a slope of the light over the distance
//! d from the window's middle. Nine parameters: corner, two line directions, variance of the blur, mean `m`, amplitude `a`,
//! two slopes.

use super::pixel_edge::PixelEdge;
use calib_rays::geometry::PixelPoint;
use nalgebra::{Matrix2, SVector};

/// In the order of [`EdgeModel`].
pub(super) type Parameters = SVector<f64, 9>;

/// What the fit needs to know beforehand.
#[derive(Debug, Clone, Copy)]
pub struct CornerGuess {
    /// Roughly where the corner is (within a sixth of a square).
    pub pixel: PixelPoint,
    /// Image of one square: first column along the board's x, second along y, px.
    pub px_from_square: Matrix2<f64>,
    /// Standard deviation of the lens's blur, roughly, px.
    pub blur_px: f64,
}

impl CornerGuess {
    /// Where nothing is known of the lens.
    pub const BLUR_PX: f64 = 0.7;
}

pub(super) const VARIANCE: usize = 4;
pub(super) const MEAN: usize = 5;
pub(super) const AMPLITUDE: usize = 6;
pub(super) const SLOPE_U: usize = 7;
pub(super) const SLOPE_V: usize = 8;

/// u, v, direction of the line along x and of the line along y (rad), variance of the lens's blur (px^2),
/// mean, amplitude, change of the light along u and v (1/px).
#[derive(Debug, Clone, Copy)]
pub(super) struct EdgeModel(pub Parameters);

impl EdgeModel {
    /// A guess between two levels, the square towards (-x, -y) at the first.
    pub fn guessed(guess: &CornerGuess, (first, second): (f64, f64)) -> Self {
        let direction = |k: usize| {
            let column = guess.px_from_square.column(k);
            column[1].atan2(column[0])
        };
        Self(Parameters::from([
            guess.pixel.u,
            guess.pixel.v,
            direction(0),
            direction(1),
            guess.blur_px.powi(2),
            f64::midpoint(first, second),
            f64::midpoint(second, -first),
            0.0,
            0.0,
        ]))
    }

    pub fn pixel(self) -> PixelPoint {
        PixelPoint::new(self.0[0], self.0[1])
    }

    /// Sine and cosine of both lines' directions.
    pub fn directions(&self) -> [(f64, f64); 2] {
        [self.0[2].sin_cos(), self.0[3].sin_cos()]
    }

    /// Ready to be evaluated at many pixels, with offsets from `middle`; for `shapes` see
    /// [`PixelEdge::new`].
    pub fn edges(&self, middle: (f64, f64), shapes: [(f64, f64); 2]) -> Edges {
        let p = &self.0;
        let [first, second] = self.directions();
        Edges {
            corner: (p[0] - middle.0, p[1] - middle.1),
            first,
            second,
            profiles: shapes.map(|shape| PixelEdge::new(shape, p[VARIANCE])),
            mean: p[MEAN],
            amplitude: p[AMPLITUDE],
            slope: (p[SLOPE_U], p[SLOPE_V]),
        }
    }
}

/// A model, ready to be evaluated at many pixels, which are counted from the window's middle.
pub(super) struct Edges {
    corner: (f64, f64),
    /// Sine and cosine of the direction of the line along x, and of the line along y.
    first: (f64, f64),
    second: (f64, f64),
    pub profiles: [PixelEdge; 2],
    pub mean: f64,
    pub amplitude: f64,
    pub slope: (f64, f64),
}

impl Edges {
    /// Signed distances of a pixel from both lines.
    #[inline]
    pub fn distances(&self, x: f64, y: f64) -> (f64, f64) {
        let (dx, dy) = (x - self.corner.0, y - self.corner.1);
        let ((s1, c1), (s2, c2)) = (self.first, self.second);
        (c1 * dy - s1 * dx, c2 * dy - s2 * dx)
    }

    /// The model's value at a pixel and its derivatives by the nine parameters.
    ///
    /// The square towards (-x, -y) has `n1 < 0` and `n2 > 0`: there the value is `m - a`.
    #[inline]
    pub fn value_and_gradient(&self, x: f64, y: f64) -> (f64, Parameters) {
        let (dx, dy) = (x - self.corner.0, y - self.corner.1);
        let ((s1, c1), (s2, c2)) = (self.first, self.second);
        let (n1, n2) = self.distances(x, y);
        let (e1, e2) = (self.profiles[0].at(n1), self.profiles[1].at(n2));
        let light = 1.0 + self.slope.0 * x + self.slope.1 * y;
        let scale = self.amplitude * light;
        let by_n1 = scale * e1.by_distance * e2.value;
        let by_n2 = scale * e1.value * e2.by_distance;
        let product = e1.value * e2.value;
        let even = self.mean + self.amplitude * product;
        let gradient = Parameters::from([
            by_n1 * s1 + by_n2 * s2,
            -by_n1 * c1 - by_n2 * c2,
            -by_n1 * (c1 * dx + s1 * dy),
            -by_n2 * (c2 * dx + s2 * dy),
            scale * (e1.by_variance * e2.value + e1.value * e2.by_variance),
            light,
            light * product,
            x * even,
            y * even,
        ]);
        (light * even, gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        let at = Parameters::from([0.3, -0.4, 0.1, 1.7, 1.3, 120.0, 60.0, 0.002, -0.003]);
        let shapes = EdgeModel(at).directions();
        for (u, v) in [(-2.0, 2.0), (0.0, 0.0), (5.0, -1.0)] {
            let edges = |p| EdgeModel(p).edges((0.0, 0.0), shapes);
            let value = |p| edges(p).value_and_gradient(u, v).0;
            let (_, gradient) = edges(at).value_and_gradient(u, v);
            for k in 0..9 {
                let mut step = Parameters::zeros();
                step[k] = 1e-5;
                let difference = (value(at + step) - value(at - step)) / 2e-5;
                // The table of the step is right to 1e-9, the differences to 1e-4.
                assert!((gradient[k] - difference).abs() < 1e-3, "parameter {k}");
            }
        }
    }
}
