//! From the pixels of one view to the plane of its board: a network trained on the view's corners.

use super::k_means::k_means;
use super::network::{Distances, Network};
use crate::adjust::observations::ObservedCorner;
use crate::init::bearing_pose::BoardHomography;
use calib_rays::geometry::PixelPoint;
use calib_rays::geometry::hull::{convex_hull, hull_contains};
use calib_rays::numerics::median;
use nalgebra::{Matrix3, Vector2, Vector3};

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
    /// Whether the networks learn only what a homography leaves.
    pub warp: bool,
}

/// A trained network, on top of a homography if there is one.
#[derive(Debug, Clone)]
pub struct BoardNetwork {
    network: Network,
    /// Board points (mm, homogeneous) from pixels.
    warp: Option<Matrix3<f64>>,
}

impl BoardNetwork {
    /// Where on the board a pixel looks, mm.
    pub fn evaluate(&self, pixel: PixelPoint) -> Vector2<f64> {
        warped(self.warp.as_ref(), pixel) + self.network.evaluate(pixel)
    }
}

/// What the homography alone says, mm; zero without one.
fn warped(warp: Option<&Matrix3<f64>>, pixel: PixelPoint) -> Vector2<f64> {
    warp.map_or_else(Vector2::zeros, |warp| {
        let point = warp * Vector3::new(pixel.u, pixel.v, 1.0);
        point.xy() / point.z
    })
}

/// The homography of corners, from pixels to the board; `None` if they have none.
fn homography(corners: &[ObservedCorner]) -> Option<Matrix3<f64>> {
    let count = corners.len() as f64;
    let mean = |of: fn(&ObservedCorner) -> f64| corners.iter().map(of).sum::<f64>() / count;
    let (u, v) = (mean(|c| c.pixel.u), mean(|c| c.pixel.v));
    let reach = corners
        .iter()
        .map(|c| (c.pixel.u - u).hypot(c.pixel.v - v))
        .fold(1.0, f64::max);
    // Pixels about their middle and of the size of 1, for the digits.
    let unit_from_pixel = Matrix3::new(
        1.0 / reach,
        0.0,
        -u / reach,
        0.0,
        1.0 / reach,
        -v / reach,
        0.0,
        0.0,
        1.0,
    );
    let (units, points): (Vec<_>, Vec<_>) = corners
        .iter()
        .map(|c| {
            let pixel = Vector3::new(c.pixel.u, c.pixel.v, 1.0);
            (unit_from_pixel * pixel, c.point_in_board)
        })
        .unzip();
    let unit_from_board = BoardHomography::fit(&units, &points)?.matrix();
    Some(unit_from_board.try_inverse()? * unit_from_pixel)
}

/// The map of one view.
#[derive(Debug, Clone)]
pub struct PlaneMap {
    network: BoardNetwork,
    hull: Vec<PixelPoint>,
}

/// The corners of a view as a network takes them, with the neurons among them.
pub struct TrainingSet {
    distances: Distances,
    outputs_mm: Vec<Vector2<f64>>,
    warp: Option<Matrix3<f64>>,
}

impl TrainingSet {
    /// Places neurons among the corners; `None` if there are too few corners. The spread is not
    /// used.
    pub fn new(corners: &[ObservedCorner], settings: &NetworkSettings) -> Option<Self> {
        if corners.len() < MIN_CORNERS {
            return None;
        }
        let inputs: Vec<Vector2<f64>> = corners
            .iter()
            .map(|corner| Vector2::new(corner.pixel.u, corner.pixel.v))
            .collect();
        let count = settings.neurons.min(corners.len() / CORNERS_PER_NEURON);
        let centers = k_means(&inputs, count, settings.seed);
        let warp = if settings.warp {
            Some(homography(corners)?)
        } else {
            None
        };
        Some(Self {
            distances: Distances::new(&inputs, centers),
            outputs_mm: corners
                .iter()
                .map(|c| c.point_in_board.xy() - warped(warp.as_ref(), c.pixel))
                .collect(),
            warp,
        })
    }

    /// The network of a spread.
    pub fn train(&self, spread_px: f64) -> Option<BoardNetwork> {
        Some(BoardNetwork {
            network: self.distances.train(&self.outputs_mm, spread_px)?,
            warp: self.warp,
        })
    }
}

impl PlaneMap {
    /// Trains on the corners of a view. Corners far off the rest are left out of a second training.
    ///
    /// `None` for fewer than [`MIN_CORNERS`] corners.
    pub fn train(corners: &[ObservedCorner], settings: &NetworkSettings) -> Option<Self> {
        let train = |corners: &[ObservedCorner]| {
            TrainingSet::new(corners, settings)?.train(settings.spread_px)
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
pub fn errors_mm(network: &BoardNetwork, corners: &[ObservedCorner]) -> Vec<f64> {
    corners
        .iter()
        .map(|corner| (network.evaluate(corner.pixel) - corner.point_in_board.xy()).norm())
        .collect()
}

fn without_outliers(network: &BoardNetwork, corners: &[ObservedCorner]) -> Vec<ObservedCorner> {
    let errors = errors_mm(network, corners);
    let median = median(errors.iter().copied()).unwrap_or(0.0);
    let limit = REJECT_BEYOND_SIGMA * (median / MEDIAN_LENGTH).max(FLOOR_MM);
    corners
        .iter()
        .zip(errors)
        .filter(|(_, error)| *error <= limit)
        .map(|(corner, _)| *corner)
        .collect()
}
