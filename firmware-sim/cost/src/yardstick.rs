//! Two ways to find what a pixel sees that need no ray blob: what the runtime's cost is compared
//! with. `firmware-sim cost` counts them in the same image, on the same pixels.
//!
//! Both are written as one would for a device: `f32`, no panic that the compiler cannot rule out,
//! nothing that could be computed once and for all left to the call.

use ray_runtime::{PixelPoint, Ray};

/// A look-up table with four channels on a grid of nodes over the sensor, read by bilinear
/// interpolation.
///
/// The channels are a ray in two planes, rig frame: its slopes dx/dz and dy/dz, and x and y in mm
/// where it crosses the plane in which the camera stands.
#[derive(Debug, Clone, Copy)]
pub struct BilinearTable<'a> {
    /// Nodes along u and v, at least 2 each.
    pub nodes: [usize; 2],
    /// Where the first node is, px.
    pub first_px: [f32; 2],
    /// Nodes in a pixel along u and v.
    pub nodes_per_px: [f32; 2],
    /// The plane in which the camera stands, rig frame, mm.
    pub z_mm: f32,
    /// Row by row.
    pub values: &'a [[f32; 4]],
}

impl BilinearTable<'_> {
    /// The four channels at a pixel; `None` outside of the grid.
    pub fn at(&self, pixel: PixelPoint) -> Option<[f32; 4]> {
        let [nodes_u, nodes_v] = self.nodes;
        let x = (pixel.u - self.first_px[0]) * self.nodes_per_px[0];
        let y = (pixel.v - self.first_px[1]) * self.nodes_per_px[1];
        let (cells_u, cells_v) = (nodes_u.checked_sub(1)?, nodes_v.checked_sub(1)?);
        let in_range = x >= 0.0 && x <= cells_u as f32 && y >= 0.0 && y <= cells_v as f32;
        if !in_range {
            return None;
        }
        // The last edge belongs to the last cell.
        let col = (x as usize).min(cells_u.checked_sub(1)?);
        let row = (y as usize).min(cells_v.checked_sub(1)?);
        let (s, t) = (x - col as f32, y - row as f32);
        let start = row * nodes_u + col;
        let [a, b] = self.values.get(start..)?.first_chunk::<2>()?;
        let [c, d] = self.values.get(start + nodes_u..)?.first_chunk::<2>()?;
        let along = |from: f32, to: f32, part: f32| from + part * (to - from);
        let mix = |a, b, c, d| along(along(a, b, s), along(c, d, s), t);
        let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (*a, *b);
        let ([c0, c1, c2, c3], [d0, d1, d2, d3]) = (*c, *d);
        Some([
            mix(a0, b0, c0, d0),
            mix(a1, b1, c1, d1),
            mix(a2, b2, c2, d2),
            mix(a3, b3, c3, d3),
        ])
    }

    /// The ray of a pixel, rig frame; `None` outside of the grid.
    pub fn ray(&self, pixel: PixelPoint) -> Option<Ray> {
        let [slope_x, slope_y, x_mm, y_mm] = self.at(pixel)?;
        Some(Ray {
            origin_mm: [x_mm, y_mm, self.z_mm],
            direction: [slope_x, slope_y, 1.0],
        })
    }
}

/// Rounds of [`Brown::undistorted`].
pub const BROWN_ROUNDS: usize = 5;

/// A pinhole with the distortion of Brown's five coefficients: `k1 k2 k3` radial, `p1 p2`
/// tangential, as D. C. Brown, "Close-range camera calibration" (1971), has them.
#[derive(Debug, Clone, Copy)]
pub struct Brown {
    /// One over the focal length along u and v, 1/px.
    pub inverse_focal: [f32; 2],
    /// Principal point, px.
    pub center_px: [f32; 2],
    /// Radial coefficients.
    pub k: [f32; 3],
    /// Tangential coefficients.
    pub p: [f32; 2],
    /// From the camera's frame into the rig's, row by row.
    pub rotation: [f32; 9],
    /// Center of projection in the rig's frame, mm.
    pub center_mm: [f32; 3],
}

impl Brown {
    /// The ideal image point of a pixel, at distance 1 in front of the camera: five rounds of the
    /// fixed-point iteration that takes off the distortion of the estimate before.
    pub fn undistorted(&self, pixel: PixelPoint) -> [f32; 2] {
        let [k1, k2, k3] = self.k;
        let [p1, p2] = self.p;
        let x0 = (pixel.u - self.center_px[0]) * self.inverse_focal[0];
        let y0 = (pixel.v - self.center_px[1]) * self.inverse_focal[1];
        let (mut x, mut y) = (x0, y0);
        for _ in 0..BROWN_ROUNDS {
            let r2 = x * x + y * y;
            let inverse = 1.0 / (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)));
            let product = 2.0 * (x * y);
            let shift_x = p1 * product + p2 * (r2 + 2.0 * (x * x));
            let shift_y = p1 * (r2 + 2.0 * (y * y)) + p2 * product;
            x = (x0 - shift_x) * inverse;
            y = (y0 - shift_y) * inverse;
        }
        [x, y]
    }

    /// The ray of a pixel, rig frame.
    pub fn ray(&self, pixel: PixelPoint) -> Ray {
        let [x, y] = self.undistorted(pixel);
        let r = &self.rotation;
        Ray {
            origin_mm: self.center_mm,
            direction: [
                r[0] * x + r[1] * y + r[2],
                r[3] * x + r[4] * y + r[5],
                r[6] * x + r[7] * y + r[8],
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_gives_back_what_is_linear_in_each_coordinate() {
        let at = |u: f32, v: f32| [u, 2.0 - v, 0.5 * u * v, 7.0];
        let mut values = [[0.0; 4]; 12];
        for (index, value) in values.iter_mut().enumerate() {
            *value = at(
                3.0 + 2.0 * (index % 4) as f32,
                1.0 + 4.0 * (index / 4) as f32,
            );
        }
        let table = BilinearTable {
            nodes: [4, 3],
            first_px: [3.0, 1.0],
            nodes_per_px: [0.5, 0.25],
            z_mm: 0.0,
            values: &values,
        };
        for (u, v) in [(3.0, 1.0), (4.5, 2.0), (8.75, 8.5), (9.0, 9.0)] {
            // Small binary fractions: exact.
            assert_eq!(table.at(PixelPoint::new(u, v)), Some(at(u, v)), "{u} {v}");
        }
        for (u, v) in [
            (2.9, 1.0),
            (9.1, 1.0),
            (3.0, 0.9),
            (3.0, 9.1),
            (f32::NAN, 2.0),
        ] {
            assert_eq!(table.at(PixelPoint::new(u, v)), None, "{u} {v}");
        }
    }

    #[test]
    fn undistorting_takes_off_the_distortion() {
        let camera = Brown {
            inverse_focal: [1.0 / 800.0; 2],
            center_px: [320.0, 240.0],
            k: [-0.1, 0.02, -0.003],
            p: [1e-3, -5e-4],
            rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            center_mm: [0.0; 3],
        };
        for (x, y) in [(0.0, 0.0), (0.2, -0.1), (-0.3, 0.25)] {
            let r2: f32 = x * x + y * y;
            let [k1, k2, k3] = camera.k;
            let [p1, p2] = camera.p;
            let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
            let u = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
            let v = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
            let pixel = PixelPoint::new(320.0 + 800.0 * u, 240.0 + 800.0 * v);
            let [found_x, found_y] = camera.undistorted(pixel);
            // Each round takes off a factor of about 3 |k1| r2 < 0.05: 3e-7 of 0.4 is left, and
            // as much is round-off.
            assert!((found_x - x).abs() < 1e-6, "{found_x} for {x}");
            assert!((found_y - y).abs() < 1e-6, "{found_y} for {y}");
        }
    }
}
