//! The field's block of the normal equations from sums of few functions.
//!
//! The block of components a and b is `sum w (j_a . j_b) f g^T` over the Legendre products f and g
//! of total degree up to D, 36 x 36 numbers per corner for D = 7. But `f g` is a polynomial of
//! degree 2 D, so the sums against the 120 products up to that degree say everything, and the
//! block follows from them by Adams' product formula (J. C. Adams, Proc. R. Soc. 27, 1878):
//! `P_m P_n = sum_r A_r A_(m-r) A_(n-r) / A_(m+n-r) (2m+2n-4r+1) / (2m+2n-2r+1) P_(m+n-2r)`,
//! `A_r = (2r - 1)!! / r!`.

use super::components::{Components, pair};
use calib_rays::field::polynomial::{AxisValues, terms};
use nalgebra::DMatrix;

/// Sums over corners of `w (j_a . j_b) P_p(x) P_q(y)`, `p + q <= 2 D`, per pair of components.
#[derive(Debug, Clone)]
pub struct FieldMoments {
    degree: usize,
    /// Rows (p, q) by rising p, then q; columns: pairs of components, see [`pair`].
    sums: DMatrix<f64>,
    /// What one corner has at each (p, q).
    row: Vec<f64>,
}

impl FieldMoments {
    /// None yet, for fields of total degree up to `degree` with so many components.
    pub fn zero(degree: usize, components: usize) -> Self {
        let rows = (2 * degree + 1) * (degree + 1);
        Self {
            degree,
            sums: DMatrix::zeros(rows, components * (components + 1) / 2),
            row: vec![0.0; rows],
        }
    }

    /// Adds a corner with its `w (j_a . j_b)` per pair. Cost: 120 multiplications per pair for
    /// fields of degree 7.
    pub fn add(&mut self, axes: &AxisValues, pairs: &[f64]) {
        let highest = 2 * self.degree;
        let mut target = self.row.as_mut_slice();
        for (p, x) in axes.u[..=highest].iter().enumerate() {
            let (now, rest) = target.split_at_mut(highest - p + 1);
            for (entry, y) in now.iter_mut().zip(&axes.v) {
                *entry = x * y;
            }
            target = rest;
        }
        let sums = self.sums.as_mut_slice().chunks_exact_mut(self.row.len());
        for (sums, weight) in sums.zip(pairs) {
            for (sum, product) in sums.iter_mut().zip(&self.row) {
                *sum += weight * product;
            }
        }
    }

    /// Adds other corners of the same camera.
    pub fn merge(&mut self, other: &Self) {
        self.sums += &other.sums;
    }

    /// The block of all components, columns as in [`Components`]; its lower triangle.
    pub fn block(&self, components: &Components) -> DMatrix<f64> {
        let products = products(self.degree);
        let count = components.count();
        let mut block = DMatrix::zeros(components.len(), components.len());
        for a in 0..count {
            for b in 0..=a {
                let sums = self.sums.column(pair(count, b, a));
                self.fill(&mut block, components, (a, b), sums.as_slice(), &products);
            }
        }
        block
    }

    /// One component by another. First the products along v, then those along u.
    fn fill(
        &self,
        block: &mut DMatrix<f64>,
        components: &Components,
        (a, b): (usize, usize),
        sums: &[f64],
        products: &[Vec<AxisProduct>],
    ) {
        let (degree, highest) = (self.degree, 2 * self.degree);
        // Rows of the sums: p has q up to 2 D - p.
        let starts: Vec<usize> = (0..=highest)
            .scan(0, |next, p| {
                let start = *next;
                *next += highest - p + 1;
                Some(start)
            })
            .collect();
        // [j1][j2][p]
        let mut along_v = vec![0.0; (degree + 1) * (degree + 1) * (highest + 1)];
        let of_pairs = products
            .iter()
            .flatten()
            .zip(along_v.chunks_exact_mut(highest + 1));
        for (product, target) in of_pairs {
            for (sum, start) in target[..=highest - product.highest].iter_mut().zip(&starts) {
                *sum = product.sum(&sums[*start..]);
            }
        }
        let own: Vec<(usize, usize)> = terms(degree).take(components.terms(a)).collect();
        let other: Vec<(usize, usize)> = terms(degree).take(components.terms(b)).collect();
        for (k2, (i2, j2)) in other.iter().enumerate() {
            for (k1, (i1, j1)) in own.iter().enumerate() {
                let at = (j1 * (degree + 1) + j2) * (highest + 1);
                block[(components.start(a) + k1, components.start(b) + k2)] =
                    products[*i1][*i2].sum(&along_v[at..]);
            }
        }
    }
}

/// `P_m P_n` as a sum of Legendre polynomials: every second one up to `m + n`.
struct AxisProduct {
    lowest: usize,
    highest: usize,
    coefficients: Vec<f64>,
}

impl AxisProduct {
    /// The same sum over given values per polynomial.
    fn sum(&self, values: &[f64]) -> f64 {
        self.coefficients
            .iter()
            .zip(values[self.lowest..].iter().step_by(2))
            .map(|(c, value)| c * value)
            .sum()
    }
}

/// The products of all pairs of Legendre polynomials up to a degree.
fn products(degree: usize) -> Vec<Vec<AxisProduct>> {
    let mut a = vec![1.0];
    for r in 1..=2 * degree {
        a.push(a[r - 1] * (2 * r - 1) as f64 / r as f64);
    }
    let product = |m: usize, n: usize| AxisProduct {
        lowest: m.abs_diff(n),
        highest: m + n,
        coefficients: (0..=m.min(n))
            .rev()
            .map(|r| {
                let share = (2 * (m + n) - 4 * r + 1) as f64 / (2 * (m + n) - 2 * r + 1) as f64;
                a[r] * a[m - r] * a[n - r] / a[m + n - r] * share
            })
            .collect(),
    };
    (0..=degree)
        .map(|m| (0..=degree).map(|n| product(m, n)).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::field::polynomial::axis_values;
    use calib_rays::geometry::{PixelPoint, SensorSize};

    #[test]
    fn products_of_legendre_polynomials_are_sums_of_them() {
        let sensor = SensorSize::new(200, 100);
        let table = products(7);
        for u in [3.0, 50.5, 180.25] {
            let values = axis_values(sensor, 14, PixelPoint::new(u, 20.0)).u;
            for m in 0..=7 {
                for n in 0..=7 {
                    let sum = table[m][n].sum(&values);
                    assert!((sum - values[m] * values[n]).abs() < 1e-13, "{m} {n}");
                }
            }
        }
    }
}
