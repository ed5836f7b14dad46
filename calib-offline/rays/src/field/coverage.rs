//! Which part of the sensor is calibrated: a mask of equal cells.

use crate::geometry::hull::convex_hull;
use crate::geometry::{PixelPoint, SensorSize};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The calibrated area as a grid of equal cells over the sensor, outer edge to outer edge.
///
/// A cell counts as calibrated if it touches the convex hull of the observed corners, so the
/// margin beyond the hull is less than one cell.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CoverageMask {
    /// The sensor that the mask covers.
    pub sensor: SensorSize,
    /// Cells along u.
    pub cells_u: usize,
    /// Cells along v.
    pub cells_v: usize,
    /// One flag per cell, row-major.
    pub covered: Vec<bool>,
}

/// Cells along the longer side of the sensor.
const CELLS_ALONG_LONGER_SIDE: f64 = 48.0;

impl CoverageMask {
    /// A mask in which every cell has the same value.
    pub fn uniform(sensor: SensorSize, covered: bool) -> Self {
        let cell_px = f64::from(sensor.width.max(sensor.height)) / CELLS_ALONG_LONGER_SIDE;
        let cells = |extent: u32| ((f64::from(extent) / cell_px).round() as usize).max(1);
        let (cells_u, cells_v) = (cells(sensor.width), cells(sensor.height));
        Self {
            sensor,
            cells_u,
            cells_v,
            covered: vec![covered; cells_u * cells_v],
        }
    }

    /// The mask of the convex hull of the observed corners.
    pub fn from_corners(sensor: SensorSize, corners: impl Iterator<Item = PixelPoint>) -> Self {
        let hull = convex_hull(corners.filter(|p| sensor.contains(*p)).collect());
        let mut mask = Self::uniform(sensor, false);
        let (width_px, height_px) = mask.cell_size_px();
        for j in 0..mask.cells_v {
            for i in 0..mask.cells_u {
                let (u0, v0) = (i as f64 * width_px - 0.5, j as f64 * height_px - 0.5);
                mask.covered[j * mask.cells_u + i] =
                    rectangle_touches_hull([u0, v0, u0 + width_px, v0 + height_px], &hull);
            }
        }
        mask
    }

    /// Width and height of a cell, px.
    pub fn cell_size_px(&self) -> (f64, f64) {
        (
            f64::from(self.sensor.width) / self.cells_u as f64,
            f64::from(self.sensor.height) / self.cells_v as f64,
        )
    }

    /// Number of the cell that a pixel lies in; `None` off the sensor.
    pub fn cell_of(&self, pixel: PixelPoint) -> Option<usize> {
        if !self.sensor.contains(pixel) {
            return None;
        }
        // The product of a pixel is exact, and so is the quotient where a border between cells meets one: by the
        // width of a cell, which is rounded, some borders fell to the cell before, and on the device to the cell behind.
        let cell = |x: f64, cells: usize, extent: u32| {
            let cell = (x + 0.5) * cells as f64 / f64::from(extent);
            (cell as usize).min(cells - 1)
        };
        let i = cell(pixel.u, self.cells_u, self.sensor.width);
        let j = cell(pixel.v, self.cells_v, self.sensor.height);
        Some(j * self.cells_u + i)
    }

    /// Whether the pixel is in the calibrated area.
    pub fn contains(&self, pixel: PixelPoint) -> bool {
        self.cell_of(pixel).is_some_and(|cell| self.covered[cell])
    }

    /// Middles of the calibrated cells, row by row.
    pub fn covered_middles(&self) -> Vec<PixelPoint> {
        let (width_px, height_px) = self.cell_size_px();
        (0..self.cells_u * self.cells_v)
            .filter(|cell| self.covered[*cell])
            .map(|cell| {
                PixelPoint::new(
                    ((cell % self.cells_u) as f64 + 0.5) * width_px - 0.5,
                    ((cell / self.cells_u) as f64 + 0.5) * height_px - 0.5,
                )
            })
            .collect()
    }

    /// Share of the sensor that is calibrated, 0 to 1.
    pub fn covered_share(&self) -> f64 {
        self.covered.iter().filter(|c| **c).count() as f64 / self.covered.len() as f64
    }
}

/// Separating-axis test between an axis-aligned rectangle `[u0, v0, u1, v1]` and a convex polygon.
fn rectangle_touches_hull([u0, v0, u1, v1]: [f64; 4], hull: &[PixelPoint]) -> bool {
    if hull.is_empty()
        || hull.iter().all(|p| p.u < u0)
        || hull.iter().all(|p| p.u > u1)
        || hull.iter().all(|p| p.v < v0)
        || hull.iter().all(|p| p.v > v1)
    {
        return false;
    }
    let corners = [(u0, v0), (u1, v0), (u1, v1), (u0, v1)];
    (0..hull.len()).all(|k| {
        let (a, b) = (hull[k], hull[(k + 1) % hull.len()]);
        corners
            .iter()
            .any(|(u, v)| (b.u - a.u) * (v - a.v) - (b.v - a.v) * (u - a.u) >= 0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_between_cells_belong_to_the_cell_behind_whatever_the_size() {
        for (width, height) in [
            (800, 600),
            (1600, 1200),
            (640, 480),
            (801, 601),
            (5472, 3648),
        ] {
            let mask = CoverageMask::uniform(SensorSize::new(width, height), true);
            // Quarter pixels from the sensor's edge, in whole numbers.
            for quarter in 0..4 * width as usize {
                let exact = quarter * mask.cells_u / (4 * width as usize);
                let pixel = PixelPoint::new(quarter as f64 / 4.0 - 0.5, 0.0);
                assert_eq!(mask.cell_of(pixel), Some(exact), "{width}: {pixel:?}");
            }
            for quarter in 0..4 * height as usize {
                let exact = quarter * mask.cells_v / (4 * height as usize) * mask.cells_u;
                let pixel = PixelPoint::new(0.0, quarter as f64 / 4.0 - 0.5);
                assert_eq!(mask.cell_of(pixel), Some(exact), "{height}: {pixel:?}");
            }
        }
    }

    #[test]
    fn everything_inside_the_hull_is_answered_and_far_outside_is_not() {
        let sensor = SensorSize::new(640, 480);
        let triangle = [(100.0, 100.0), (500.0, 120.0), (300.0, 400.0)];
        let mask = CoverageMask::from_corners(
            sensor,
            triangle.iter().map(|(u, v)| PixelPoint::new(*u, *v)),
        );
        for (a, b) in [(0.2, 0.3), (0.0, 0.5), (0.98, 0.01), (0.33, 0.33)] {
            let c = 1.0 - a - b;
            let weights = [a, b, c];
            let mix = |f: fn(&(f64, f64)) -> f64| -> f64 {
                triangle.iter().zip(weights).map(|(p, w)| f(p) * w).sum()
            };
            assert!(mask.contains(PixelPoint::new(mix(|p| p.0), mix(|p| p.1))));
        }
        let margin = mask.cell_size_px().0.max(mask.cell_size_px().1) * 1.5;
        assert!(!mask.contains(PixelPoint::new(300.0, 100.0 - margin)));
        assert!(!mask.contains(PixelPoint::new(10.0, 470.0)));
        assert!(!mask.contains(PixelPoint::new(-1.0, 100.0)));
    }
}
