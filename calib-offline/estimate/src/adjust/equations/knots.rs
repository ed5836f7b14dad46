//! The thin-plate energy of a spline's knots as a matrix, in the order in which they enter the
//! equations. The two components of a knot are neighbors.

use calib_rays::field::knot_order::KnotOrder;
use calib_rays::numerics::banded::BandedMatrix;
use calib_rays::numerics::cholesky::BandedCholesky;

/// Keeps the energy positive definite, and linear functions, which have no energy of their own, out
/// of the spline: a constant in it would turn the camera, which only the held directions of the
/// polynomial forbid (with 1e-6 that mode stayed open on a fisheye and an adjustment crept). At this
/// size it begins to count for waves longer than 35 knots, which are the polynomial's to follow.
const RIDGE: f64 = 1e-3;

/// Discrete thin-plate energy `D_uu^T D_uu + 2 D_uv^T D_uv + D_vv^T D_vv` (plus a minute
/// ridge) of each component, METHOD 2.3: second differences of neighboring knots.
pub fn thin_plate(order: &KnotOrder) -> BandedMatrix {
    energy(order, 2)
}

/// Natural logarithm of the determinant of [`thin_plate`].
pub fn thin_plate_ln_determinant(order: &KnotOrder) -> f64 {
    // The components do not meet, so one is factorized and counts twice.
    BandedCholesky::of_banded(&energy(order, 1), 1.0)
        .map_or(0.0, |factor| 2.0 * factor.ln_determinant())
}

/// The energy of interleaved components. Second differences reach two knots each way.
fn energy(order: &KnotOrder, components: usize) -> BandedMatrix {
    let (nu, nv) = (order.grid().knots_u(), order.grid().knots_v());
    let half_bandwidth = components * 2 * nu.min(nv).max(2);
    let mut energy = BandedMatrix::zeros(components * order.knot_count(), half_bandwidth);
    let mut add = |weight: f64, terms: &[(usize, f64)]| {
        for &(a, in_a) in terms {
            for &(b, in_b) in terms {
                if a >= b {
                    for component in 0..components {
                        let (row, column) = (components * a, components * b);
                        energy.add(row + component, column + component, weight * in_a * in_b);
                    }
                }
            }
        }
    };
    for j in 0..nv {
        for i in 0..nu {
            add(RIDGE, &[(order.place(i, j), 1.0)]);
            for stencil in order.thin_plate_at(i, j) {
                add(stencil.weight, stencil.terms());
            }
        }
    }
    energy
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::field::spline::SplineGrid;
    use calib_rays::geometry::SensorSize;
    use nalgebra::DVector;

    #[test]
    fn a_plane_has_no_energy_and_a_kink_has() {
        let grid = SplineGrid {
            sensor: SensorSize::new(640, 480),
            cells_u: 5,
            cells_v: 4,
        };
        let order = KnotOrder::new(grid);
        let energy = thin_plate(&order);
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
            let both = BandedCholesky::of_banded(&thin_plate(&order), 1.0).unwrap();
            let difference = thin_plate_ln_determinant(&order) - both.ln_determinant();
            assert!(difference.abs() < 1e-9);
        }
    }
}
