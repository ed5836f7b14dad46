//! The order in which a spline's knots enter the equations, and their thin-plate energy.
//!
//! Knots are counted along the shorter side of the grid first, so that neighbors stay near each
//! other and the equations stay banded: two knots that share a pixel are at most `3 n + 3` apart,
//! `n` knots along the shorter side (METHOD 2.5). The two components of a knot are neighbors.

use super::banded::BandedMatrix;
use super::cholesky::BandedCholesky;
use crate::field::spline::SplineGrid;

/// Keeps the energy positive definite, and linear functions, which have no energy of their own, out
/// of the spline: a constant in it would turn the camera, which only the held directions of the
/// polynomial forbid (with 1e-6 that mode stayed open on a fisheye and an adjustment crept). At this
/// size it begins to count for waves longer than 35 knots, which are the polynomial's to follow.
const RIDGE: f64 = 1e-3;

/// Order of the knots of one grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KnotOrder {
    grid: SplineGrid,
    u_is_longer: bool,
}

impl KnotOrder {
    /// The order for a grid.
    pub fn new(grid: SplineGrid) -> Self {
        Self {
            grid,
            u_is_longer: grid.knots_u() >= grid.knots_v(),
        }
    }

    /// Cells along the side with more of them.
    pub fn cells_along_longer_side(&self) -> usize {
        self.grid.cells_u.max(self.grid.cells_v)
    }

    /// Number of knots.
    pub fn knot_count(&self) -> usize {
        self.grid.knot_count()
    }

    /// Place of the knot (i along u, j along v).
    pub fn place(&self, i: usize, j: usize) -> usize {
        if self.u_is_longer {
            i * self.grid.knots_v() + j
        } else {
            j * self.grid.knots_u() + i
        }
    }

    /// Place of a knot given by its number in row-major order.
    pub fn from_row_major(&self, number: usize) -> usize {
        self.place(number % self.grid.knots_u(), number / self.grid.knots_u())
    }

    /// Half bandwidth of equations in which each knot has two neighboring components.
    pub fn half_bandwidth(&self) -> usize {
        let shorter = self.grid.knots_u().min(self.grid.knots_v());
        2 * (3 * shorter + 3) + 1
    }

    /// Discrete thin-plate energy `D_uu^T D_uu + 2 D_uv^T D_uv + D_vv^T D_vv` (plus a minute
    /// ridge) of each component, METHOD 2.3: second differences of neighboring knots.
    pub fn thin_plate(&self) -> BandedMatrix {
        self.energy(2)
    }

    /// Natural logarithm of the determinant of [`Self::thin_plate`].
    pub fn thin_plate_ln_determinant(&self) -> f64 {
        // The components do not meet, so one is factorized and counts twice.
        BandedCholesky::of_banded(&self.energy(1), 1.0)
            .map_or(0.0, |factor| 2.0 * factor.ln_determinant())
    }

    /// The energy of interleaved components. Second differences reach two knots each way.
    fn energy(&self, components: usize) -> BandedMatrix {
        let (nu, nv) = (self.grid.knots_u(), self.grid.knots_v());
        let half_bandwidth = components * 2 * nu.min(nv).max(2);
        let mut energy = BandedMatrix::zeros(components * self.knot_count(), half_bandwidth);
        let mut add = |weight: f64, stencil: &[(usize, usize, f64)]| {
            for (i1, j1, c1) in stencil {
                for (i2, j2, c2) in stencil {
                    let (a, b) = (self.place(*i1, *j1), self.place(*i2, *j2));
                    if a >= b {
                        for component in 0..components {
                            let (row, column) = (components * a, components * b);
                            energy.add(row + component, column + component, weight * c1 * c2);
                        }
                    }
                }
            }
        };
        for j in 0..nv {
            for i in 0..nu {
                add(RIDGE, &[(i, j, 1.0)]);
                if i + 2 < nu {
                    add(1.0, &[(i, j, 1.0), (i + 1, j, -2.0), (i + 2, j, 1.0)]);
                }
                if j + 2 < nv {
                    add(1.0, &[(i, j, 1.0), (i, j + 1, -2.0), (i, j + 2, 1.0)]);
                }
                if i + 1 < nu && j + 1 < nv {
                    add(
                        2.0,
                        &[
                            (i, j, 1.0),
                            (i + 1, j, -1.0),
                            (i, j + 1, -1.0),
                            (i + 1, j + 1, 1.0),
                        ],
                    );
                }
            }
        }
        energy
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SensorSize;
    use nalgebra::DVector;

    #[test]
    fn a_plane_has_no_energy_and_a_kink_has() {
        let grid = SplineGrid {
            sensor: SensorSize::new(640, 480),
            cells_u: 5,
            cells_v: 4,
        };
        let order = KnotOrder::new(grid);
        let energy = order.thin_plate();
        // Of the second differences alone: the ridge is taken off.
        let with = |f: fn(f64, f64) -> f64| {
            let mut x = DVector::zeros(2 * order.knot_count());
            for j in 0..grid.knots_v() {
                for i in 0..grid.knots_u() {
                    x[2 * order.place(i, j)] = f(i as f64, j as f64);
                }
            }
            // What the ridge adds is not curvature.
            energy.times(&x).dot(&x) - RIDGE * x.norm_squared()
        };
        assert!(with(|i, j| 3.0 + i - 2.0 * j).abs() < 1e-9);
        // i^2 / 2 has second difference 1 at 6 interior knots of 7 rows.
        assert!((with(|i, _| i * i / 2.0) - 42.0).abs() < 1e-9);
        assert!(with(|i, j| i * j) > 80.0);
    }

    #[test]
    fn the_determinant_is_that_of_both_components() {
        for (width, height) in [(640, 480), (480, 640)] {
            let order = KnotOrder::new(SplineGrid::with_spacing(
                SensorSize::new(width, height),
                90.0,
            ));
            let both = BandedCholesky::of_banded(&order.thin_plate(), 1.0).unwrap();
            let difference = order.thin_plate_ln_determinant() - both.ln_determinant();
            assert!(difference.abs() < 1e-9);
        }
    }

    #[test]
    fn every_pixel_stays_within_the_band() {
        for (width, height) in [(640, 480), (480, 640), (2000, 200)] {
            let grid = SplineGrid::with_spacing(SensorSize::new(width, height), 60.0);
            let order = KnotOrder::new(grid);
            let spread = |i: usize, j: usize| order.place(i + 3, j + 3) - order.place(i, j);
            assert!(2 * spread(0, 0) < order.half_bandwidth());
        }
    }
}
