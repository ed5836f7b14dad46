//! Products of Legendre polynomials over the sensor, two components.

use crate::geometry::{PixelPoint, SensorSize};
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Number of products `P_i(x) P_j(y)` with `i + j <= degree`.
pub const fn term_count(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// The powers `(i, j)` in storage order: by total degree, then by falling `i`.
pub fn terms(degree: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..=degree).flat_map(|total| (0..=total).rev().map(move |i| (i, total - i)))
}

/// Values and derivatives of `P_0 ..= P_degree` at `x`, appended to the two vectors.
fn legendre(x: f64, degree: usize, value: &mut [f64], derivative: &mut [f64]) {
    value[0] = 1.0;
    derivative[0] = 0.0;
    if degree == 0 {
        return;
    }
    value[1] = x;
    derivative[1] = 1.0;
    for n in 1..degree {
        let nf = n as f64;
        value[n + 1] = ((2.0 * nf + 1.0) * x * value[n] - nf * value[n - 1]) / (nf + 1.0);
        // P'_{n+1} = P'_{n-1} + (2n + 1) P_n
        derivative[n + 1] = derivative[n - 1] + (2.0 * nf + 1.0) * value[n];
    }
}

/// Highest degree that [`basis`] evaluates.
pub const MAX_DEGREE: usize = 15;

/// Values of the single Legendre polynomials at a pixel; places beyond the degree are zero.
#[derive(Debug, Clone, Copy)]
pub struct AxisValues {
    /// Along u.
    pub u: [f64; MAX_DEGREE + 1],
    /// Along v.
    pub v: [f64; MAX_DEGREE + 1],
}

/// The polynomials up to a degree at a pixel, the sensor's outer edges at -1 and 1.
///
/// # Panics
/// If `degree` is above [`MAX_DEGREE`].
pub fn axis_values(sensor: SensorSize, degree: usize, pixel: PixelPoint) -> AxisValues {
    let [x, y] = normalized(sensor, pixel);
    let mut p = [[0.0; MAX_DEGREE + 1]; 4];
    let [u, du, v, dv] = &mut p;
    legendre(x, degree, u, du);
    legendre(y, degree, v, dv);
    AxisValues { u: p[0], v: p[2] }
}

fn normalized(sensor: SensorSize, pixel: PixelPoint) -> [f64; 2] {
    let center = sensor.center();
    [
        (pixel.u - center.u) * 2.0 / f64::from(sensor.width),
        (pixel.v - center.v) * 2.0 / f64::from(sensor.height),
    ]
}

/// Every product with its derivatives by u and by v (per px) at a pixel: `[value, du, dv]`, in the
/// order of [`terms`]. `x` and `y` run from -1 to 1 between the sensor's outer edges.
///
/// # Panics
/// If `degree` is above [`MAX_DEGREE`].
pub fn basis(sensor: SensorSize, degree: usize, pixel: PixelPoint, out: &mut Vec<[f64; 3]>) {
    assert!(
        degree <= MAX_DEGREE,
        "degree {degree} is above {MAX_DEGREE}"
    );
    let [x, y] = normalized(sensor, pixel);
    let (scale_u, scale_v) = (
        2.0 / f64::from(sensor.width),
        2.0 / f64::from(sensor.height),
    );
    let mut p = [[0.0; MAX_DEGREE + 1]; 4];
    let [px, dx, py, dy] = &mut p;
    legendre(x, degree, px, dx);
    legendre(y, degree, py, dy);
    out.clear();
    out.extend(terms(degree).map(|(i, j)| {
        [
            px[i] * py[j],
            dx[i] * py[j] * scale_u,
            px[i] * dy[j] * scale_v,
        ]
    }));
}

/// A polynomial map from the sensor to two numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Polynomial {
    /// Highest total degree.
    pub degree: usize,
    /// One pair per product, in the order of [`terms`].
    #[schemars(with = "Vec<[f64; 2]>")]
    pub coefficients: Vec<Vector2<f64>>,
}

impl Polynomial {
    /// The polynomial that is zero everywhere.
    pub fn zero(degree: usize) -> Self {
        Self {
            degree,
            coefficients: vec![Vector2::zeros(); term_count(degree)],
        }
    }

    /// Value, and derivative by (u, v) per px (columns).
    pub fn evaluate(&self, sensor: SensorSize, pixel: PixelPoint) -> (Vector2<f64>, Matrix2<f64>) {
        let mut products = Vec::with_capacity(self.coefficients.len());
        basis(sensor, self.degree, pixel, &mut products);
        let mut value = Vector2::zeros();
        let mut derivative = Matrix2::zeros();
        for (coefficient, [p, du, dv]) in self.coefficients.iter().zip(&products) {
            value += coefficient * *p;
            derivative += coefficient * nalgebra::RowVector2::new(*du, *dv);
        }
        (value, derivative)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENSOR: SensorSize = SensorSize::new(200, 100);

    #[test]
    fn products_come_by_total_degree() {
        let order: Vec<_> = terms(2).collect();
        assert_eq!(order, [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]);
        assert_eq!(order.len(), term_count(2));
    }

    #[test]
    fn corner_of_the_sensor_has_every_product_equal_to_one() {
        let mut products = Vec::new();
        basis(SENSOR, 7, PixelPoint::new(199.5, 99.5), &mut products);
        for [value, _, _] in products {
            assert!((value - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn derivative_matches_differences() {
        let mut polynomial = Polynomial::zero(7);
        for (k, c) in polynomial.coefficients.iter_mut().enumerate() {
            *c = Vector2::new(1.0 / (k as f64 + 1.0), (k as f64).sin());
        }
        let at = |u, v| polynomial.evaluate(SENSOR, PixelPoint::new(u, v));
        let (_, derivative) = at(120.0, 30.0);
        let h = 1e-4;
        let du = (at(120.0 + h, 30.0).0 - at(120.0 - h, 30.0).0) / (2.0 * h);
        let dv = (at(120.0, 30.0 + h).0 - at(120.0, 30.0 - h).0) / (2.0 * h);
        assert!((derivative.column(0) - du).norm() < 1e-8);
        assert!((derivative.column(1) - dv).norm() < 1e-8);
    }
}
