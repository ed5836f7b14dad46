//! From the pixels of one view to the plane of its board: a network trained on the view's corners.

use super::k_means::k_means;
use super::network::{Distances, Network};
use crate::adjust::observations::ObservedCorner;
use crate::geometry::PixelPoint;
use crate::geometry::hull::{convex_hull, hull_contains};
use nalgebra::{Vector2, Vector3};

/// Fewest corners that a network is trained on.
pub const MIN_CORNERS: usize = 12;
/// Corners per neuron: fewer would let the network follow every corner's noise.
const CORNERS_PER_NEURON: usize = 3;
/// Corners whose error is larger than so many standard deviations do not train.
const REJECT_BEYOND_SIGMA: f64 = 6.0;
/// The median of the length of a bivariate Gaussian vector over its standard deviation per axis.
const MEDIAN_LENGTH: f64 = 1.1774;
/// Errors below this are round-off of the decomposition and no outliers, mm.
const FLOOR_MM: f64 = 1e-6;

/// How networks are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetworkSettings {
    /// Distance at which a neuron answers 1/2, px.
    pub spread_px: f64,
    /// Most neurons; a view with few corners gets fewer.
    pub neurons: usize,
    /// Seed of the neurons' places.
    pub seed: u64,
}

/// The map of one view.
#[derive(Debug, Clone)]
pub struct PlaneMap {
    network: Network,
    hull: Vec<PixelPoint>,
}

/// The corners of a view as a network takes them, with the neurons among them.
pub struct TrainingSet {
    distances: Distances,
    outputs_mm: Vec<Vector2<f64>>,
}

impl TrainingSet {
    /// Places neurons among the corners; `None` if there are too few corners.
    pub fn new(corners: &[ObservedCorner], neurons: usize, seed: u64) -> Option<Self> {
        if corners.len() < MIN_CORNERS {
            return None;
        }
        let inputs: Vec<Vector2<f64>> = corners
            .iter()
            .map(|corner| Vector2::new(corner.pixel.u, corner.pixel.v))
            .collect();
        let count = neurons.min(corners.len() / CORNERS_PER_NEURON);
        let centers = k_means(&inputs, count, seed);
        Some(Self {
            distances: Distances::new(&inputs, centers),
            outputs_mm: corners.iter().map(|c| c.point_in_board.xy()).collect(),
        })
    }

    /// The network of a spread.
    pub fn train(&self, spread_px: f64) -> Option<Network> {
        self.distances.train(&self.outputs_mm, spread_px)
    }
}

impl PlaneMap {
    /// Trains on the corners of a view. Corners far off the rest are left out of a second training.
    ///
    /// `None` for fewer than [`MIN_CORNERS`] corners.
    pub fn train(corners: &[ObservedCorner], settings: &NetworkSettings) -> Option<Self> {
        let train = |corners: &[ObservedCorner]| {
            TrainingSet::new(corners, settings.neurons, settings.seed)?.train(settings.spread_px)
        };
        let mut network = train(corners)?;
        let kept = without_outliers(&network, corners);
        if kept.len() < corners.len() {
            network = train(&kept)?;
        }
        Some(Self {
            network,
            hull: convex_hull(kept.iter().map(|corner| corner.pixel).collect()),
        })
    }

    /// Where on the board a pixel looks, board frame, mm; `None` outside the hull of the corners,
    /// where a network says anything.
    pub fn board_point(&self, pixel: PixelPoint) -> Option<Vector3<f64>> {
        hull_contains(&self.hull, pixel).then(|| {
            let point = self.network.evaluate(pixel);
            Vector3::new(point.x, point.y, 0.0)
        })
    }
}

/// Errors of a network at corners, mm.
pub fn errors_mm(network: &Network, corners: &[ObservedCorner]) -> Vec<f64> {
    corners
        .iter()
        .map(|corner| (network.evaluate(corner.pixel) - corner.point_in_board.xy()).norm())
        .collect()
}

fn without_outliers(network: &Network, corners: &[ObservedCorner]) -> Vec<ObservedCorner> {
    let errors = errors_mm(network, corners);
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let limit = REJECT_BEYOND_SIGMA * (median / MEDIAN_LENGTH).max(FLOOR_MM);
    corners
        .iter()
        .zip(errors)
        .filter(|(_, error)| *error <= limit)
        .map(|(corner, _)| *corner)
        .collect()
}
