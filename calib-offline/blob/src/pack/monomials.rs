//! Polynomials of two variables by least squares, in the order in which the runtime stores them.

use nalgebra::{DMatrix, DVector};
use ray_runtime::format::{MAX_DEGREE, coefficient_count};

/// Powers of x and y of the coefficients: by falling power of y, and within it by falling power of x.
pub fn powers(degree: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..=degree)
        .rev()
        .flat_map(move |j| (0..=degree - j).rev().map(move |i| (i, j)))
}

/// The value of every monomial at a place.
pub fn terms(degree: usize, x: f64, y: f64) -> impl Iterator<Item = f64> {
    let (x, y) = (ascending(x), ascending(y));
    powers(degree).map(move |(i, j)| x[i] * y[j])
}

/// Powers by repeated multiplication, whose bits are the same everywhere.
fn ascending(x: f64) -> [f64; MAX_DEGREE as usize + 1] {
    let mut powers = [1.0; MAX_DEGREE as usize + 1];
    for k in 1..powers.len() {
        powers[k] = powers[k - 1] * x;
    }
    powers
}

/// A place, what the polynomials should be there, and how much that counts.
#[derive(Debug, Clone, Copy)]
pub struct Equation {
    /// Variables, of the order of 1.
    pub at: [f64; 2],
    /// Values of all channels.
    pub value: [f64; 4],
    /// Weight of the squared misfit.
    pub weight: f64,
}

/// Coefficients of the polynomials of a total degree that fit best, all four channels; `None` if the
/// places do not determine them. `ridge` is the weight of a coefficient's square beside those of the
/// misfits: it keeps small what the places leave open.
///
/// By Householder's triangle, whose round-off is that of the problem and not of its square.
pub fn fit(equations: &[Equation], degree: usize, ridge: f64) -> Option<Vec<[f64; 4]>> {
    let count = coefficient_count(degree);
    let ridges = if ridge > 0.0 { count } else { 0 };
    if equations.len() + ridges < count {
        return None;
    }
    let mut rows = DMatrix::zeros(equations.len() + ridges, count);
    let mut values = DMatrix::zeros(equations.len() + ridges, 4);
    for k in 0..ridges {
        rows[(equations.len() + k, k)] = ridge.sqrt();
    }
    for (k, equation) in equations.iter().enumerate() {
        let root = equation.weight.sqrt();
        let [x, y] = equation.at;
        for (c, term) in terms(degree, x, y).enumerate() {
            rows[(k, c)] = root * term;
        }
        for (c, value) in equation.value.iter().enumerate() {
            values[(k, c)] = root * value;
        }
    }
    let qr = rows.qr();
    qr.q_tr_mul(&mut values);
    let triangle = qr.r();
    let solved: Option<Vec<DVector<f64>>> = (0..4)
        .map(|c| triangle.solve_upper_triangular(&values.column(c).rows(0, count).into_owned()))
        .collect();
    let solved = solved?;
    let coefficients: Vec<[f64; 4]> = (0..count)
        .map(|k| std::array::from_fn(|c| solved[c][k]))
        .collect();
    let is_finite = coefficients.as_flattened().iter().all(|x| x.is_finite());
    is_finite.then_some(coefficients)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_found_again() {
        let value = |x: f64, y: f64| [x * x * y - 2.0, y * y * y, 0.5, x + y];
        let equations: Vec<Equation> = (0..100)
            .map(|k| {
                let (x, y) = ((f64::from(k) * 0.618).fract(), f64::from(k) / 99.0);
                Equation {
                    at: [x, y],
                    value: value(x, y),
                    weight: 1.0 + y,
                }
            })
            .collect();
        let found = fit(&equations, 3, 0.0).unwrap();
        for (k, (i, j)) in powers(3).enumerate() {
            let expected = match (i, j) {
                (2, 1) => [1.0, 0.0, 0.0, 0.0],
                (0, 3) => [0.0, 1.0, 0.0, 0.0],
                (1, 0) | (0, 1) => [0.0, 0.0, 0.0, 1.0],
                (0, 0) => [-2.0, 0.0, 0.5, 0.0],
                _ => [0.0; 4],
            };
            for c in 0..4 {
                assert!((found[k][c] - expected[c]).abs() < 1e-12, "{i} {j} {c}");
            }
        }
        assert_eq!(fit(&equations[..9], 3, 0.0), None);
        // A ridge decides what they leave open, and little else.
        let held = fit(&equations[..9], 3, 1e-12).unwrap();
        assert!(
            held.as_flattened().iter().all(|c| c.abs() < 10.0),
            "{held:?}"
        );
    }
}
