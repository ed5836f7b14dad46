//! The uncertainty of pairs of cameras as a blob carries it: a coarse grid of Cholesky factors, one
//! byte a number, with as many nodes as its predictions need.

use super::sigma_error::{PackedPair, compare};
use super::{AlignedBytes, PackError};
use calib_rays::field::{CoverageMask, PairUncertainty, Rig};
use calib_rays::geometry::PixelPoint;
use nalgebra::{DMatrix, Matrix4};
use ray_runtime::RayBlob;
use ray_runtime::format::{NODE_LEN, PairHeader, TRIANGLE};

/// Nodes along the longer side of the calibrated area, tried in turn. Eight take 648 bytes for the
/// usual sensor and are enough for smooth lenses; fields with strong local bumps are known here and
/// not known there, and want more. The calibration itself has eleven along the sensor's longer
/// side, so that sixteen add nothing but places that fit its own better.
const NODES_ALONG_LONGER_SIDE: [f64; 3] = [8.0, 11.0, 16.0];
/// More nodes are taken while the predicted standard deviation of a point is off by more, RMS.
const MOST_SIGMA_ERROR: f64 = 0.05;
/// Pull of every node towards the factor at its place, relative to that of the cells around it: it
/// decides only where the calibrated area has no cells.
const PULL: f64 = 1e-3;
/// Added to a covariance, as a share of its trace, so that round-off cannot make it indefinite.
const ROUND_OFF: f64 = 1e-12;
/// A factor smaller than this does not weigh more, px: no measurement would notice.
const SMALLEST_FACTOR_PX: f64 = 1e-6;
/// Largest magnitude of a node's number.
const LARGEST_NUMBER: f64 = 127.0;
/// Largest scale of a node.
const LARGEST_SCALE: f64 = 255.0;

/// The sections of a rig in the blob's order, each with the fewest nodes that keep the error below
/// [`MOST_SIGMA_ERROR`] or else with the most that are tried, and what they cost. `encode` makes a
/// blob with the sections it is given.
///
/// # Errors
/// [`PackError::Uncertainty`] where a covariance is none, and those of `encode`.
pub fn choose(
    rig: &Rig,
    working_distance_mm: f64,
    mut encode: impl FnMut(&[Vec<u8>]) -> Result<Vec<u8>, PackError>,
) -> Result<Vec<PackedPair>, PackError> {
    let mut pairs: Vec<&PairUncertainty> = rig.uncertainty.iter().collect();
    pairs.sort_by_key(|pair| (pair.first, pair.second));
    let mut tries = vec![0; pairs.len()];
    loop {
        let sections = pairs
            .iter()
            .zip(&tries)
            .map(|(pair, tried)| {
                let first = rig.cameras.get(pair.first);
                first
                    .and_then(|first| {
                        section(pair, &first.coverage, NODES_ALONG_LONGER_SIDE[*tried])
                    })
                    .ok_or(PackError::Uncertainty {
                        first: pair.first,
                        second: pair.second,
                    })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let bytes = AlignedBytes::from(encode(&sections)?.as_slice());
        let packed = compare(rig, &RayBlob::open(&bytes)?, working_distance_mm);
        let mut is_chosen = true;
        for (tried, pair) in tries.iter_mut().zip(&packed) {
            let is_last = *tried + 1 == NODES_ALONG_LONGER_SIDE.len();
            if pair.sigma_error.rms > MOST_SIGMA_ERROR && !is_last {
                *tried += 1;
                is_chosen = false;
            }
        }
        if is_chosen {
            return Ok(packed);
        }
    }
}

/// Header and nodes of a pair; `None` where a covariance is none.
fn section(
    pair: &PairUncertainty,
    mask: &CoverageMask,
    nodes_along_longer_side: f64,
) -> Option<Vec<u8>> {
    let grid = NodeGrid::over(mask, nodes_along_longer_side)?;
    let factors = fit(pair, mask, &grid)?;
    let largest_px = |factor: &[f64; TRIANGLE]| factor.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let step_px =
        factors.iter().map(largest_px).fold(0.0, f64::max) / (LARGEST_NUMBER * LARGEST_SCALE);
    let header = PairHeader {
        cameras: [pair.first as u16, pair.second as u16],
        nodes: grid.nodes.map(|count| count as u16),
        first_px: grid.first_px.map(|x| x as f32),
        nodes_per_px: grid.nodes_per_px.map(|x| x as f32),
        step_px: step_px as f32,
        noise_px2: pair.noise_px2 as f32,
    };
    let mut bytes = header.to_bytes().to_vec();
    for factor in &factors {
        let scale = (largest_px(factor) / (LARGEST_NUMBER * step_px)).ceil();
        // Without any uncertainty the step is zero and the quotient no number: then it is 1.
        let scale = scale.clamp(1.0, LARGEST_SCALE).max(1.0);
        bytes.push(scale as u8);
        // Casts saturate, and what is no number becomes 0.
        let number = |x: &f64| (x / (scale * step_px)).round() as i8;
        bytes.extend(factor.iter().map(|x| number(x).cast_unsigned()));
    }
    debug_assert_eq!(bytes.len(), header.section_len());
    debug_assert_eq!(
        bytes.len(),
        grid.count() * NODE_LEN + header.to_bytes().len()
    );
    Some(bytes)
}

/// Nodes over the bounding rectangle of the calibrated cells, on its corners and between them.
#[derive(Debug, Clone, Copy)]
struct NodeGrid {
    nodes: [usize; 2],
    first_px: [f64; 2],
    nodes_per_px: [f64; 2],
}

impl NodeGrid {
    /// `None` if no cell is calibrated.
    fn over(mask: &CoverageMask, nodes_along_longer_side: f64) -> Option<Self> {
        let (width_px, height_px) = mask.cell_size_px();
        let covered = || (0..mask.covered.len()).filter(|cell| mask.covered[*cell]);
        let reach = |place: &dyn Fn(usize) -> usize, cell_px: f64| {
            let (low, high) = (covered().map(place).min()?, covered().map(place).max()?);
            Some([
                low as f64 * cell_px - 0.5,
                (high + 1) as f64 * cell_px - 0.5,
            ])
        };
        let [low_u, high_u] = reach(&|cell| cell % mask.cells_u, width_px)?;
        let [low_v, high_v] = reach(&|cell| cell / mask.cells_u, height_px)?;
        let extent_px = [high_u - low_u, high_v - low_v];
        let longer_px = extent_px[0].max(extent_px[1]);
        let nodes = extent_px
            .map(|px| ((nodes_along_longer_side * px / longer_px).round() as usize).max(2));
        Some(Self {
            nodes,
            first_px: [low_u, low_v],
            nodes_per_px: [0, 1].map(|k| (nodes[k] - 1) as f64 / extent_px[k]),
        })
    }

    fn count(&self) -> usize {
        self.nodes[0] * self.nodes[1]
    }

    fn pixel(&self, node: usize) -> PixelPoint {
        let at = |k: usize, index: usize| self.first_px[k] + index as f64 / self.nodes_per_px[k];
        PixelPoint::new(at(0, node % self.nodes[0]), at(1, node / self.nodes[0]))
    }

    /// The four nodes around a pixel and their weights.
    fn around(&self, pixel: PixelPoint) -> [(usize, f64); 4] {
        let place = |k: usize, x: f64| {
            let position = (x - self.first_px[k]) * self.nodes_per_px[k];
            let node = (position.max(0.0) as usize).min(self.nodes[k] - 2);
            (node, (position - node as f64).clamp(0.0, 1.0))
        };
        let ((i, a), (j, b)) = (place(0, pixel.u), place(1, pixel.v));
        let node = j * self.nodes[0] + i;
        [
            (node, (1.0 - a) * (1.0 - b)),
            (node + 1, a * (1.0 - b)),
            (node + self.nodes[0], (1.0 - a) * b),
            (node + self.nodes[0] + 1, a * b),
        ]
    }
}

/// The factors of the nodes that come nearest to those of all calibrated cells, each cell weighted
/// by the inverse of its own size: least squares of relative errors.
///
/// Factors are blended, not covariances: the standard deviation, linear in the factor, is what
/// varies smoothly, and any blend is a factor of some covariance.
fn fit(
    pair: &PairUncertainty,
    mask: &CoverageMask,
    grid: &NodeGrid,
) -> Option<Vec<[f64; TRIANGLE]>> {
    let count = grid.count();
    let mut normal = DMatrix::<f64>::zeros(count, count);
    let mut right = DMatrix::<f64>::zeros(count, TRIANGLE);
    let mut weight_sum = 0.0;
    let (width_px, height_px) = mask.cell_size_px();
    for cell in (0..mask.covered.len()).filter(|cell| mask.covered[*cell]) {
        let pixel = PixelPoint::new(
            ((cell % mask.cells_u) as f64 + 0.5) * width_px - 0.5,
            ((cell / mask.cells_u) as f64 + 0.5) * height_px - 0.5,
        );
        let factor = factor_px(&pair.calibration_at(pixel))?;
        let squared: f64 = factor.iter().map(|x| x * x).sum();
        let weight = 1.0 / (squared + SMALLEST_FACTOR_PX * SMALLEST_FACTOR_PX);
        weight_sum += weight;
        let around = grid.around(pixel);
        for (a, share_a) in around {
            for (b, share_b) in around {
                normal[(a, b)] += weight * share_a * share_b;
            }
            for (k, x) in factor.iter().enumerate() {
                right[(a, k)] += weight * share_a * x;
            }
        }
    }
    let pull = PULL * weight_sum / count as f64;
    for node in 0..count {
        let own = factor_px(&pair.calibration_at(grid.pixel(node)))?;
        normal[(node, node)] += pull;
        for (k, x) in own.iter().enumerate() {
            right[(node, k)] += pull * x;
        }
    }
    let solution = normal.cholesky()?.solve(&right);
    solution.iter().all(|x| x.is_finite()).then(|| {
        (0..count)
            .map(|node| std::array::from_fn(|k| solution[(node, k)]))
            .collect()
    })
}

/// Lower triangle of the Cholesky factor, row by row; `None` if there is none.
fn factor_px(covariance: &Matrix4<f64>) -> Option<[f64; TRIANGLE]> {
    let ridge = ROUND_OFF * covariance.trace() + f64::MIN_POSITIVE;
    let factor = (covariance + Matrix4::identity() * ridge).cholesky()?.l();
    let mut values = [0.0; TRIANGLE];
    let places = (0..4).flat_map(|row| (0..=row).map(move |column| (row, column)));
    for (value, place) in values.iter_mut().zip(places) {
        *value = factor[place];
    }
    Some(values)
}
