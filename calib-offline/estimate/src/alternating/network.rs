//! The radial basis function network that maps pixels to a plane (paper Eq. 2).
//!
//! `s(x) = w_0 + sum_k w_k phi_k(x)`, `phi_k(x) = exp(-beta |x - mu_k|^2)`. The spread is given as
//! MATLAB's `newrb` does: a neuron answers 1/2 at that distance, `beta = ln 2 / spread^2`.

use super::truncated::solve_truncated;
use calib_rays::geometry::PixelPoint;
use nalgebra::{DMatrix, Vector2};

/// Singular values below this share of the largest are left out: what double precision still
/// tells apart.
pub const CUT: f64 = 1e-13;

/// A trained network.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    /// Where the neurons sit, px.
    centers_px: Vec<Vector2<f64>>,
    /// 1/px^2.
    beta: f64,
    /// The bias, then one pair per neuron, mm.
    weights: Vec<Vector2<f64>>,
    /// Singular values used.
    rank: usize,
}

/// Inputs and neurons of networks that differ in their spread only: the distances between them.
#[derive(Debug, Clone)]
pub struct Distances {
    centers_px: Vec<Vector2<f64>>,
    /// One row per input, one column per neuron, px^2.
    squared: DMatrix<f64>,
}

impl Distances {
    /// Between inputs and neurons.
    pub fn new(inputs_px: &[Vector2<f64>], centers_px: Vec<Vector2<f64>>) -> Self {
        let squared = DMatrix::from_fn(inputs_px.len(), centers_px.len(), |i, k| {
            (inputs_px[i] - centers_px[k]).norm_squared()
        });
        Self {
            centers_px,
            squared,
        }
    }

    /// The hidden layer's answers, the bias first.
    fn hidden(&self, beta: f64) -> DMatrix<f64> {
        DMatrix::from_fn(
            self.squared.nrows(),
            self.squared.ncols() + 1,
            |i, k| match k.checked_sub(1) {
                None => 1.0,
                Some(neuron) => (-beta * self.squared[(i, neuron)]).exp(),
            },
        )
    }

    /// The network of a spread that comes nearest to the outputs (mm, one per input) in the
    /// least-squares sense; `None` if there are none, or they are not finite.
    pub fn train(&self, outputs_mm: &[Vector2<f64>], spread_px: f64) -> Option<Network> {
        if outputs_mm.len() != self.squared.nrows() || !(spread_px > 0.0) {
            return None;
        }
        let beta = 2f64.ln() / (spread_px * spread_px);
        let outputs = DMatrix::from_fn(outputs_mm.len(), 2, |i, k| outputs_mm[i][k]);
        let found = solve_truncated(self.hidden(beta), outputs, CUT)?;
        Some(Network {
            centers_px: self.centers_px.clone(),
            beta,
            weights: found
                .solution
                .row_iter()
                .map(|row| Vector2::new(row[0], row[1]))
                .collect(),
            rank: found.rank,
        })
    }
}

impl Network {
    /// The answer at a pixel, mm.
    pub fn evaluate(&self, pixel: PixelPoint) -> Vector2<f64> {
        let x = Vector2::new(pixel.u, pixel.v);
        let bias = self.weights.first().copied().unwrap_or_default();
        self.centers_px
            .iter()
            .zip(self.weights.iter().skip(1))
            .fold(bias, |sum, (center, weight)| {
                sum + weight * (-self.beta * (x - center).norm_squared()).exp()
            })
    }

    /// How many numbers per output the training really chose.
    pub fn rank(&self) -> usize {
        self.rank
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Vec<Vector2<f64>> {
        (0..9)
            .flat_map(|j| (0..9).map(move |i| Vector2::new(f64::from(i), f64::from(j)) * 60.0))
            .collect()
    }

    #[test]
    fn one_neuron_answers_half_at_its_spread() {
        // Two inputs determine bias and weight: 1 at the neuron, 0.5 a spread away.
        let inputs = [Vector2::zeros(), Vector2::new(300.0, 0.0)];
        let outputs = [Vector2::new(1.0, 2.0), Vector2::new(0.5, 1.0)];
        let network = Distances::new(&inputs, vec![Vector2::zeros()])
            .train(&outputs, 300.0)
            .unwrap();
        // Round-off times the condition number, some 7.
        assert!(network.weights[0].norm() < 1e-13, "no bias");
        let twice = network.evaluate(PixelPoint::new(0.0, 600.0));
        // Half to the fourth power at twice the spread.
        assert!((twice - Vector2::new(1.0, 2.0) / 16.0).norm() < 1e-13);
    }

    #[test]
    fn a_wide_network_is_a_quartic() {
        // Centers as many as inputs, spread ten times the extent: only a few directions are left
        // in double precision, about as many as a quartic has terms (15), and they hold it.
        let inputs = grid();
        let quartic = |p: &Vector2<f64>| {
            let (x, y) = (p.x / 480.0, p.y / 480.0);
            Vector2::new(
                100.0 * x + 3.0 * x * x * y * y,
                90.0 * y - 2.0 * x.powi(4) + x * y,
            )
        };
        let outputs: Vec<_> = inputs.iter().map(quartic).collect();
        let network = Distances::new(&inputs, inputs.clone())
            .train(&outputs, 5000.0)
            .unwrap();
        assert!((12..=28).contains(&network.rank()), "{}", network.rank());
        let error_mm = |at: &Vector2<f64>| {
            (network.evaluate(PixelPoint::new(at.x, at.y)) - quartic(at)).norm()
        };
        let worst = |places: &[Vector2<f64>]| places.iter().map(error_mm).fold(0.0, f64::max);
        let middles: Vec<_> = (0..8)
            .flat_map(|j| (0..8).map(move |i| Vector2::new(f64::from(i) + 0.5, f64::from(j) + 0.5)))
            .map(|at| at * 60.0)
            .collect();
        let (trained_mm, between_mm) = (worst(&inputs), worst(&middles));
        // No cubic comes nearer to 3 x^2 y^2 than 3 / 64: 2^(2 - n - m) for x^n y^m on [-1, 1]^2.
        assert!(trained_mm < 3.0 / 64.0, "{trained_mm}");
        // A polynomial errs no more between the inputs than at them.
        assert!(between_mm <= trained_mm, "{between_mm} {trained_mm}");
    }

    #[test]
    fn what_means_nothing_trains_nothing() {
        let distances = Distances::new(&grid(), grid());
        assert!(distances.train(&[Vector2::zeros()], 100.0).is_none());
        assert!(distances.train(&grid(), 0.0).is_none());
        assert!(distances.train(&grid(), f64::NAN).is_none());
    }
}
