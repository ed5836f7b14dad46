//! Inner products of smooth functions of the pixel, over a lattice of the sensor.

use super::base_lens::BaseLens;
use super::polynomial::{self, Polynomial};
use crate::geometry::{PixelPoint, SensorSize};
use nalgebra::{DMatrix, DVector, Vector2};

/// Lattice nodes along the longer side, for inner products over the sensor.
const LATTICE: usize = 33;
/// Nodes per product, at least.
const FEWEST: usize = 6;

/// The polynomial nearest to a function of the pixel where that is known; `None` where that is on too
/// little of the sensor.
pub fn nearest_polynomial(
    sensor: SensorSize,
    degree: usize,
    at: impl Fn(PixelPoint) -> Option<Vector2<f64>>,
) -> Option<Polynomial> {
    let (lattice, values) = Lattice::seen(sensor, degree, at)?;
    let flat = lattice.project_values(&values);
    let coefficients = flat.as_slice().chunks_exact(2);
    let coefficients = coefficients.map(|c| Vector2::new(c[0], c[1]));
    Some(Polynomial {
        degree,
        coefficients: coefficients.collect(),
    })
}

/// Nodes of a regular lattice over the sensor: the pixel and its offset from the image center in
/// half widths.
pub(super) fn lattice_nodes(
    sensor: SensorSize,
) -> impl Iterator<Item = (PixelPoint, Vector2<f64>)> {
    let (w, h) = (f64::from(sensor.width), f64::from(sensor.height));
    let longer = w.max(h);
    let count = |extent: f64| ((LATTICE as f64 * extent / longer).ceil() as usize).max(12);
    let (nu, nv) = (count(w), count(h));
    (0..nv).flat_map(move |j| {
        (0..nu).map(move |i| {
            let u = (i as f64 + 0.5) / nu as f64 * w - 0.5;
            let v = (j as f64 + 0.5) / nv as f64 * h - 0.5;
            let p = Vector2::new(u - (w / 2.0 - 0.5), v - (h / 2.0 - 0.5)) / (w / 2.0);
            (PixelPoint::new(u, v), p)
        })
    })
}

/// Inner products over the sensor, in Legendre coefficients.
pub(super) struct Lattice {
    pub(super) nodes: Vec<Vector2<f64>>,
    /// Products at the nodes, one row per node.
    products: DMatrix<f64>,
    /// Upper Cholesky factor U of the mean Gram matrix: `|U a|` is the RMS of the polynomial.
    pub(super) factor: DMatrix<f64>,
    pub(super) factor_inverse: DMatrix<f64>,
}

impl Lattice {
    /// Over all of a sensor.
    pub(super) fn new(sensor: SensorSize, degree: usize) -> Self {
        let (pixels, nodes): (Vec<_>, Vec<_>) = lattice_nodes(sensor).unzip();
        Self::of_nodes(sensor, degree, &pixels, nodes)
    }

    /// Over that part of a sensor where there is something to know, and what is known there; `None`
    /// if that is too little to tell the products apart.
    pub(super) fn seen<T>(
        sensor: SensorSize,
        degree: usize,
        at: impl Fn(PixelPoint) -> Option<T>,
    ) -> Option<(Self, Vec<T>)> {
        let mut values = Vec::new();
        let mut kept = (Vec::new(), Vec::new());
        for (pixel, node) in lattice_nodes(sensor) {
            if let Some(value) = at(pixel) {
                values.push(value);
                kept.0.push(pixel);
                kept.1.push(node);
            }
        }
        let enough = values.len() >= FEWEST * polynomial::term_count(degree);
        enough.then(|| (Self::of_nodes(sensor, degree, &kept.0, kept.1), values))
    }

    fn of_nodes(
        sensor: SensorSize,
        degree: usize,
        pixels: &[PixelPoint],
        nodes: Vec<Vector2<f64>>,
    ) -> Self {
        let term_count = polynomial::term_count(degree);
        let mut products = DMatrix::zeros(pixels.len(), term_count);
        let mut row = Vec::new();
        for (n, pixel) in pixels.iter().enumerate() {
            polynomial::basis(sensor, degree, *pixel, &mut row);
            for (k, [value, _, _]) in row.iter().enumerate() {
                products[(n, k)] = *value;
            }
        }
        let gram = products.tr_mul(&products) / pixels.len() as f64;
        // Legendre products are linearly independent on any lattice denser than their degree.
        let factor = gram.cholesky().map_or_else(
            || DMatrix::identity(term_count, term_count),
            |c| c.l().transpose(),
        );
        let factor_inverse = factor
            .clone()
            .try_inverse()
            .unwrap_or_else(|| DMatrix::identity(term_count, term_count));
        Self {
            nodes,
            products,
            factor,
            factor_inverse,
        }
    }

    /// Legendre coefficients (`2 k + component`) of the best approximation to a function of the
    /// offset from the image center in half widths.
    pub(super) fn project(&self, f: impl Fn(f64, f64) -> Vector2<f64>) -> DVector<f64> {
        let values: Vec<Vector2<f64>> = self.nodes.iter().map(|p| f(p.x, p.y)).collect();
        self.project_values(&values)
    }

    /// The same of a function's values at the nodes.
    pub(super) fn project_values(&self, values: &[Vector2<f64>]) -> DVector<f64> {
        let mut out = DVector::zeros(2 * self.factor.nrows());
        for component in 0..2 {
            let sampled =
                DVector::from_iterator(values.len(), values.iter().map(|value| value[component]));
            let right = self.products.tr_mul(&sampled) / values.len() as f64;
            let solved = &self.factor_inverse * (self.factor_inverse.tr_mul(&right));
            for k in 0..solved.len() {
                out[2 * k + component] = solved[k];
            }
        }
        out
    }

    /// A shift of a lens's center along an axis with the turn of the camera frame that takes its
    /// constant back, as constants are cut off: what a turn does besides is a tilt.
    pub(super) fn shift(&self, lens: &BaseLens, half_width_px: f64, axis: usize) -> DVector<f64> {
        let at = |x: f64, y: f64| lens.evaluate(&(Vector2::new(x, y) * half_width_px));
        let shifted = |x, y| at(x, y).1.column(axis) * half_width_px;
        // Of the half-angle vector, by a turn that moves the middle along the axis.
        let turned = |x, y| {
            let s = at(x, y).0;
            let mut by_turn = s * (s[axis] / 2.0);
            by_turn[axis] += 1.0 - s.norm_squared() / 4.0;
            by_turn
        };
        let sum = |f: &dyn Fn(f64, f64) -> Vector2<f64>| -> f64 {
            self.nodes.iter().map(|p| f(p.x, p.y)[axis]).sum()
        };
        let back = sum(&shifted) / sum(&turned);
        self.project(|x, y| shifted(x, y) - turned(x, y) * back)
    }

    /// Applies a square matrix to each component of interleaved coefficients.
    pub(super) fn per_component(matrix: &DMatrix<f64>, interleaved: &DVector<f64>) -> DVector<f64> {
        let n = matrix.nrows();
        let split = DMatrix::from_fn(n, 2, |k, c| interleaved[2 * k + c]);
        let image = matrix * split;
        DVector::from_fn(2 * n, |i, _| image[(i / 2, i % 2)])
    }
}
