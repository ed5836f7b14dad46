//! Uniform bicubic B-splines over the sensor, two components: the f64 oracle for the device's
//! control grid, and the deviation that polynomials cannot follow.

use crate::geometry::{PixelPoint, SensorSize};
use nalgebra::{Matrix2, RowVector2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the knots lie: the sensor, from outer edge to outer edge, cut into equal cells.
///
/// A grid of `cells_u` x `cells_v` cells has `(cells_u + 3) x (cells_v + 3)` knots; the four knots
/// that matter along u in cell `i` are `i ..= i + 3`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SplineGrid {
    /// The sensor that the grid covers.
    pub sensor: SensorSize,
    /// Cells along u, at least 1.
    pub cells_u: usize,
    /// Cells along v, at least 1.
    pub cells_v: usize,
}

/// Weights of the 4 knots along one axis, and their derivatives per px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisWeights {
    /// First of the four knots.
    pub first: usize,
    /// Weight of each.
    pub value: [f64; 4],
    /// Derivative of each weight, 1/px.
    pub derivative: [f64; 4],
}

impl SplineGrid {
    /// The grid whose cells are nearest to `spacing_px` on a side.
    pub fn with_spacing(sensor: SensorSize, spacing_px: f64) -> Self {
        let cells = |extent: u32| ((f64::from(extent) / spacing_px).round() as usize).max(1);
        Self {
            sensor,
            cells_u: cells(sensor.width),
            cells_v: cells(sensor.height),
        }
    }

    /// Knots along u.
    pub fn knots_u(&self) -> usize {
        self.cells_u + 3
    }

    /// Knots along v.
    pub fn knots_v(&self) -> usize {
        self.cells_v + 3
    }

    /// All knots. Row-major: knot (i along u, j along v) is number `j * knots_u + i`.
    pub fn knot_count(&self) -> usize {
        self.knots_u() * self.knots_v()
    }

    /// Weights along u at a pixel; a pixel off the sensor continues the outermost cell's cubic.
    pub fn weights_u(&self, u: f64) -> AxisWeights {
        axis_weights(u, self.sensor.width, self.cells_u)
    }

    /// Weights along v at a pixel.
    pub fn weights_v(&self, v: f64) -> AxisWeights {
        axis_weights(v, self.sensor.height, self.cells_v)
    }
}

fn axis_weights(x: f64, extent_px: u32, cells: usize) -> AxisWeights {
    let per_px = cells as f64 / f64::from(extent_px);
    let position = (x + 0.5) * per_px;
    let first = (position.floor().max(0.0) as usize).min(cells - 1);
    let t = position - first as f64;
    let r = 1.0 - t;
    AxisWeights {
        first,
        value: [
            r * r * r / 6.0,
            (4.0 - 3.0 * t * t * (2.0 - t)) / 6.0,
            (4.0 - 3.0 * r * r * (2.0 - r)) / 6.0,
            t * t * t / 6.0,
        ],
        derivative: [
            -r * r / 2.0 * per_px,
            -t * (4.0 - 3.0 * t) / 2.0 * per_px,
            r * (4.0 - 3.0 * r) / 2.0 * per_px,
            t * t / 2.0 * per_px,
        ],
    }
}

/// A spline map from the sensor to two numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Spline {
    /// Where the knots lie.
    pub grid: SplineGrid,
    /// One pair per knot, row-major.
    #[schemars(with = "Vec<[f64; 2]>")]
    pub coefficients: Vec<Vector2<f64>>,
}

impl Spline {
    /// The spline that is zero everywhere.
    pub fn zero(grid: SplineGrid) -> Self {
        Self {
            grid,
            coefficients: vec![Vector2::zeros(); grid.knot_count()],
        }
    }

    /// The same map on another grid: exact for what both grids can hold of cubics, a good start
    /// for the rest (quasi-interpolation, `c_k = (8 f_k - f_{k-1} - f_{k+1}) / 6` along each axis,
    /// f at the knots).
    pub fn resampled(&self, grid: SplineGrid) -> Self {
        let (nu, nv) = (grid.knots_u(), grid.knots_v());
        let site = |k: isize, cells: usize, extent: u32| {
            (k as f64 - 1.0) * f64::from(extent) / cells as f64 - 0.5
        };
        let mut samples = vec![Vector2::zeros(); (nu + 2) * (nv + 2)];
        for j in 0..nv + 2 {
            for i in 0..nu + 2 {
                let u = site(i as isize - 1, grid.cells_u, grid.sensor.width);
                let v = site(j as isize - 1, grid.cells_v, grid.sensor.height);
                // Off the sensor the nearest point on it stands in: a cubic's continuation grows.
                let last_u = f64::from(grid.sensor.width) - 0.5;
                let last_v = f64::from(grid.sensor.height) - 0.5;
                let pixel = PixelPoint::new(u.clamp(-0.5, last_u), v.clamp(-0.5, last_v));
                samples[j * (nu + 2) + i] = self.evaluate(pixel).0;
            }
        }
        let at = |i: usize, j: usize| samples[j * (nu + 2) + i];
        let along_u = |i: usize, j: usize| (at(i + 1, j) * 8.0 - at(i, j) - at(i + 2, j)) / 6.0;
        let coefficients = (0..nu * nv)
            .map(|k| {
                let (i, j) = (k % nu, k / nu);
                (along_u(i, j + 1) * 8.0 - along_u(i, j) - along_u(i, j + 2)) / 6.0
            })
            .collect();
        Self { grid, coefficients }
    }

    /// Value, and derivative by (u, v) per px (columns).
    pub fn evaluate(&self, pixel: PixelPoint) -> (Vector2<f64>, Matrix2<f64>) {
        self.weighted(&self.grid.weights_u(pixel.u), &self.grid.weights_v(pixel.v))
    }

    /// [`Self::evaluate`] with the weights of the pixel given.
    pub fn weighted(&self, wu: &AxisWeights, wv: &AxisWeights) -> (Vector2<f64>, Matrix2<f64>) {
        let mut value = Vector2::zeros();
        let mut derivative = Matrix2::zeros();
        for j in 0..4 {
            let row = (wv.first + j) * self.grid.knots_u() + wu.first;
            for (i, c) in self.coefficients[row..row + 4].iter().enumerate() {
                value += c * (wu.value[i] * wv.value[j]);
                derivative += c * RowVector2::new(
                    wu.derivative[i] * wv.value[j],
                    wu.value[i] * wv.derivative[j],
                );
            }
        }
        (value, derivative)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_reproduce_a_line() {
        let grid = SplineGrid {
            sensor: SensorSize::new(640, 480),
            cells_u: 7,
            cells_v: 5,
        };
        // A B-spline whose knots hold a linear function is that linear function.
        let mut spline = Spline::zero(grid);
        for j in 0..grid.knots_v() {
            for i in 0..grid.knots_u() {
                let u = (i as f64 - 1.0) * 640.0 / 7.0 - 0.5;
                let v = (j as f64 - 1.0) * 480.0 / 5.0 - 0.5;
                spline.coefficients[j * grid.knots_u() + i] = Vector2::new(2.0 * u + v, 1.0);
            }
        }
        for (u, v) in [
            (-0.5, -0.5),
            (0.0, 0.0),
            (333.3, 127.9),
            (639.5, 479.5),
            (700.0, -20.0),
        ] {
            let (value, derivative) = spline.evaluate(PixelPoint::new(u, v));
            assert!((value - Vector2::new(2.0 * u + v, 1.0)).norm() < 1e-10);
            assert!((derivative - Matrix2::new(2.0, 1.0, 0.0, 0.0)).norm() < 1e-12);
        }
    }

    #[test]
    fn derivative_matches_differences() {
        let grid = SplineGrid::with_spacing(SensorSize::new(300, 200), 60.0);
        let mut spline = Spline::zero(grid);
        for (k, c) in spline.coefficients.iter_mut().enumerate() {
            *c = Vector2::new((k as f64 * 1.7).sin(), (k as f64 * 0.9).cos());
        }
        let at = |u, v| spline.evaluate(PixelPoint::new(u, v)).0;
        let h = 1e-4;
        let (_, derivative) = spline.evaluate(PixelPoint::new(123.4, 55.5));
        let du = (at(123.4 + h, 55.5) - at(123.4 - h, 55.5)) / (2.0 * h);
        let dv = (at(123.4, 55.5 + h) - at(123.4, 55.5 - h)) / (2.0 * h);
        assert!((derivative.column(0) - du).norm() < 1e-9);
        assert!((derivative.column(1) - dv).norm() < 1e-9);
    }
}
