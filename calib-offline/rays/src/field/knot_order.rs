//! The order in which a spline's knots enter equations, and the stencils of their thin-plate energy.
//!
//! Knots are counted along the shorter side of the grid first, so that neighbors stay near each
//! other and the equations stay banded: two knots that share a pixel are at most `3 n + 3` apart,
//! `n` knots along the shorter side (METHOD 2.5).

use super::spline::{AxisWeights, SplineGrid};

/// Order of the knots of one grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KnotOrder {
    grid: SplineGrid,
    u_is_longer: bool,
}

/// A sum of knots whose square is part of the thin-plate energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stencil {
    /// What its square counts.
    pub weight: f64,
    /// Place of each knot and its factor; a factor of zero stands for a knot that has no part.
    terms: [(usize, f64); 4],
    term_count: usize,
}

impl Stencil {
    fn new<const N: usize>(weight: f64, given: [(usize, f64); N]) -> Self {
        let mut terms = [(0, 0.0); 4];
        terms[..N].copy_from_slice(&given);
        Self {
            weight,
            terms,
            term_count: N,
        }
    }

    /// Place of each knot, and its factor.
    pub fn terms(&self) -> &[(usize, f64)] {
        &self.terms[..self.term_count]
    }
}

impl KnotOrder {
    /// The order for a grid.
    pub fn new(grid: SplineGrid) -> Self {
        Self {
            grid,
            u_is_longer: grid.knots_u() >= grid.knots_v(),
        }
    }

    /// The grid.
    pub fn grid(&self) -> &SplineGrid {
        &self.grid
    }

    /// Cells along the side with more of them.
    pub fn cells_along_longer_side(&self) -> usize {
        self.grid.cells_u.max(self.grid.cells_v)
    }

    /// Knots along the side with fewer of them.
    pub fn knots_along_shorter_side(&self) -> usize {
        self.grid.knots_u().min(self.grid.knots_v())
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

    /// Half bandwidth of equations in which each knot has so many neighboring components.
    pub fn half_bandwidth(&self, components: usize) -> usize {
        components * (3 * self.knots_along_shorter_side() + 3) + components - 1
    }

    /// The 16 knots around a pixel, by the weights along its axes: place and weight of each.
    pub fn around(&self, u: &AxisWeights, v: &AxisWeights) -> [(usize, f64); 16] {
        std::array::from_fn(|k| {
            let (i, j) = (k % 4, k / 4);
            (
                self.place(u.first + i, v.first + j),
                u.value[i] * v.value[j],
            )
        })
    }

    /// What begins at a knot of the discrete thin-plate energy `|D_uu c|^2 + |D_vv c|^2 + 2 |D_uv c|^2`
    /// (METHOD 2.3): second differences of neighboring knots.
    pub fn thin_plate_at(&self, i: usize, j: usize) -> impl Iterator<Item = Stencil> + use<> {
        let (nu, nv) = (self.grid.knots_u(), self.grid.knots_v());
        let order = *self;
        let at = move |di: usize, dj: usize| order.place(i + di, j + dj);
        let along_u = (i + 2 < nu)
            .then(|| Stencil::new(1.0, [(at(0, 0), 1.0), (at(1, 0), -2.0), (at(2, 0), 1.0)]));
        let along_v = (j + 2 < nv)
            .then(|| Stencil::new(1.0, [(at(0, 0), 1.0), (at(0, 1), -2.0), (at(0, 2), 1.0)]));
        let mixed = (i + 1 < nu && j + 1 < nv).then(|| {
            let terms = [
                (at(0, 0), 1.0),
                (at(1, 0), -1.0),
                (at(0, 1), -1.0),
                (at(1, 1), 1.0),
            ];
            Stencil::new(2.0, terms)
        });
        [along_u, along_v, mixed].into_iter().flatten()
    }

    /// All of the thin-plate energy, knot by knot in row-major order.
    pub fn thin_plate(&self) -> impl Iterator<Item = Stencil> {
        let order = *self;
        let nu = self.grid.knots_u();
        (0..self.knot_count()).flat_map(move |k| order.thin_plate_at(k % nu, k / nu))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SensorSize;

    #[test]
    fn every_pixel_stays_within_the_band() {
        for (width, height) in [(640, 480), (480, 640), (2000, 200)] {
            let grid = SplineGrid::with_spacing(SensorSize::new(width, height), 60.0);
            let order = KnotOrder::new(grid);
            let spread = |i: usize, j: usize| order.place(i + 3, j + 3) - order.place(i, j);
            for components in [1, 2] {
                let widest = components * spread(0, 0) + components - 1;
                assert!(widest <= order.half_bandwidth(components));
            }
        }
    }
}
