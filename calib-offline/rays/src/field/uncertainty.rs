//! How well a pair of cameras knows its rays: a coarse grid of covariances over the first sensor.

use crate::geometry::{PixelPoint, SensorSize};
use nalgebra::Matrix4;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Joint covariance of where two cameras see one point at the working distance, px^2.
///
/// What the calibration leaves uncertain in a ray is said as the shift of its pixel that would make
/// up for it, so that a point is uncertain as if its pixels were: with the derivative of the point
/// by its four pixel coordinates ([`Rig::pair_covariance`](super::Rig::pair_covariance)), both parts
/// become one covariance. Components: first camera's u and v, second camera's u and v. The two
/// pixels are *not* independent: poses are shared, so errors of both cameras go together, and a
/// sum of separate covariances would overstate the error of a point about twofold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PairUncertainty {
    /// Index of the camera whose sensor the grid covers.
    pub first: usize,
    /// Index of the other camera.
    pub second: usize,
    /// Sensor of the first camera.
    pub sensor: SensorSize,
    /// Nodes along u, at least 2; the first and last lie on the sensor's outer edges.
    pub nodes_u: usize,
    /// Nodes along v, likewise.
    pub nodes_v: usize,
    /// What the calibration leaves uncertain, the six rigid motions of the whole rig taken out
    /// (they change no measured shape). Per node, row-major: upper triangle row by row, px^2.
    pub calibration_px2: Vec<[f64; 10]>,
    /// Variance of a measured pixel coordinate, that of the corners' noise, px^2.
    pub noise_px2: f64,
}

impl PairUncertainty {
    /// Pixel of a node.
    pub fn node(&self, i: usize, j: usize) -> PixelPoint {
        node_pixel(self.sensor, self.nodes_u, self.nodes_v, i, j)
    }

    /// The calibration's part at a pixel of the first camera, bilinear between nodes, px^2.
    pub fn calibration_at(&self, pixel: PixelPoint) -> Matrix4<f64> {
        let place = |x: f64, extent: u32, nodes: usize| {
            let position = (x + 0.5) / f64::from(extent) * (nodes - 1) as f64;
            let first = (position.floor().max(0.0) as usize).min(nodes - 2);
            (first, (position - first as f64).clamp(0.0, 1.0))
        };
        let (i, a) = place(pixel.u, self.sensor.width, self.nodes_u);
        let (j, b) = place(pixel.v, self.sensor.height, self.nodes_v);
        let mut sum = [0.0; 10];
        for (di, wi) in [(0, 1.0 - a), (1, a)] {
            for (dj, wj) in [(0, 1.0 - b), (1, b)] {
                let value = self.calibration_px2[(j + dj) * self.nodes_u + i + di];
                for k in 0..10 {
                    sum[k] += wi * wj * value[k];
                }
            }
        }
        unpacked(&sum)
    }
}

/// The upper triangle of a symmetric matrix, row by row.
pub fn packed(matrix: &Matrix4<f64>) -> [f64; 10] {
    let mut values = [0.0; 10];
    let mut k = 0;
    for row in 0..4 {
        for column in row..4 {
            values[k] = matrix[(row, column)];
            k += 1;
        }
    }
    values
}

/// The symmetric matrix of [`packed`].
pub fn unpacked(values: &[f64; 10]) -> Matrix4<f64> {
    let mut matrix = Matrix4::zeros();
    let mut k = 0;
    for row in 0..4 {
        for column in row..4 {
            matrix[(row, column)] = values[k];
            matrix[(column, row)] = values[k];
            k += 1;
        }
    }
    matrix
}

/// Pixel of the node (i, j) of a grid that spans a sensor from edge to edge.
pub fn node_pixel(
    sensor: SensorSize,
    nodes_u: usize,
    nodes_v: usize,
    i: usize,
    j: usize,
) -> PixelPoint {
    PixelPoint::new(
        i as f64 / (nodes_u - 1) as f64 * f64::from(sensor.width) - 0.5,
        j as f64 / (nodes_v - 1) as f64 * f64::from(sensor.height) - 0.5,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_covariance_is_interpolated_exactly() {
        let sensor = SensorSize::new(640, 480);
        let nodes: Vec<[f64; 10]> = (0..12)
            .map(|k| {
                let mut values = [0.0; 10];
                values[0] = 1.0 + f64::from(k % 4);
                values[3] = 0.1 * f64::from(k / 4);
                values
            })
            .collect();
        let grid = PairUncertainty {
            first: 0,
            second: 1,
            sensor,
            nodes_u: 4,
            nodes_v: 3,
            calibration_px2: nodes,
            noise_px2: 0.01,
        };
        let calibration = grid.calibration_at(PixelPoint::new(319.5, 119.5));
        assert!((calibration[(0, 0)] - 2.5).abs() < 1e-12);
        assert!((calibration[(3, 0)] - 0.05).abs() < 1e-12);
        // Off the sensor the edge's value holds.
        let beyond = grid.calibration_at(PixelPoint::new(-50.0, -50.0));
        assert_eq!(beyond[(0, 0)], 1.0);
        assert_eq!(grid.node(3, 2), PixelPoint::new(639.5, 479.5));
    }

    #[test]
    fn packing_is_undone_by_unpacking() {
        let matrix = Matrix4::from_fn(|r, c| (r * c) as f64 + (r + c) as f64);
        assert_eq!(unpacked(&packed(&matrix)), matrix);
    }
}
