//! The f64 field at many pixels of a row: what depends on the column alone is computed once for
//! all rows, what depends on the row once for all columns. The numbers are those of
//! [`RayField::sample`] up to round-off, some ten times faster.

use calib_rays::field::polynomial::{self, Polynomial};
use calib_rays::field::spline::{AxisWeights, Spline};
use calib_rays::field::{FieldSample, RayField, SmoothMap};
use calib_rays::geometry::{PixelPoint, SensorSize};
use nalgebra::{Matrix2, Vector2};

/// A field prepared for a list of columns.
pub struct FieldRows<'a> {
    field: &'a RayField,
    columns_px: Vec<f64>,
    direction: Columns<'a>,
    offset: Option<Columns<'a>>,
}

/// A field prepared for one row of those columns.
pub struct FieldRow<'a> {
    rows: &'a FieldRows<'a>,
    v: f64,
    direction: Row<'a>,
    offset: Option<Row<'a>>,
}

/// A map, and what its columns need.
struct Columns<'a> {
    map: &'a SmoothMap,
    sensor: SensorSize,
    /// `degree + 1` Legendre polynomials for each column, with their derivatives per px.
    legendre: Vec<[f64; 2]>,
    /// Of the spline's grid, for each column.
    weights: Vec<AxisWeights>,
}

/// A map collapsed to one row: a polynomial and a spline in u alone.
struct Row<'a> {
    columns: &'a Columns<'a>,
    /// Factor of each Legendre polynomial in u, and its derivative by v.
    legendre: Vec<[Vector2<f64>; 2]>,
    /// Knots along u, and their derivatives by v.
    knots: Vec<[Vector2<f64>; 2]>,
}

impl<'a> FieldRows<'a> {
    /// Prepares a field for columns at these places, px.
    pub fn new(field: &'a RayField, columns_px: Vec<f64>) -> Self {
        let columns = |map| Columns::new(map, field.sensor, &columns_px);
        Self {
            field,
            direction: columns(&field.direction),
            offset: field.offset.as_ref().map(columns),
            columns_px,
        }
    }

    /// The row at v, px.
    pub fn row(&self, v: f64) -> FieldRow<'_> {
        FieldRow {
            rows: self,
            v,
            direction: self.direction.row(v),
            offset: self.offset.as_ref().map(|offset| offset.row(v)),
        }
    }
}

impl FieldRow<'_> {
    /// The field at a column of the list, by its place in it.
    pub fn sample(&self, column: usize) -> FieldSample {
        let field = self.rows.field;
        let center = field.sensor.center();
        let offset_px = Vector2::new(self.rows.columns_px[column] - center.u, self.v - center.v);
        let (base, base_derivative) = field.base.evaluate(&offset_px);
        let (deviation, deviation_derivative) = self.direction.evaluate(column);
        let (m_mm, dm) = self.offset.as_ref().map_or_else(
            || (Vector2::zeros(), Matrix2::zeros()),
            |offset| offset.evaluate(column),
        );
        FieldSample {
            s: base + deviation,
            ds: base_derivative + deviation_derivative,
            m_mm,
            dm,
        }
    }
}

impl<'a> Columns<'a> {
    fn new(map: &'a SmoothMap, sensor: SensorSize, columns_px: &[f64]) -> Self {
        let degree = map.polynomial.degree;
        let mut products = Vec::new();
        let mut legendre = Vec::with_capacity(columns_px.len() * (degree + 1));
        for &u in columns_px {
            polynomial::basis(sensor, degree, PixelPoint::new(u, 0.0), &mut products);
            // The product P_i(x) P_0(y) is the first of total degree i.
            legendre.extend((0..=degree).map(|i| {
                let [value, du, _] = products[first_of_total(i)];
                [value, du]
            }));
        }
        let weights = map.spline.as_ref().map_or_else(Vec::new, |spline| {
            columns_px
                .iter()
                .map(|u| spline.grid.weights_u(*u))
                .collect()
        });
        Self {
            map,
            sensor,
            legendre,
            weights,
        }
    }

    fn row(&self, v: f64) -> Row<'_> {
        Row {
            columns: self,
            legendre: collapsed_polynomial(&self.map.polynomial, self.sensor, v),
            knots: self
                .map
                .spline
                .as_ref()
                .map_or_else(Vec::new, |spline| collapsed_spline(spline, v)),
        }
    }
}

impl Row<'_> {
    /// Value, and derivative by (u, v) per px (columns).
    fn evaluate(&self, column: usize) -> (Vector2<f64>, Matrix2<f64>) {
        let (mut value, mut du, mut dv) = (Vector2::zeros(), Vector2::zeros(), Vector2::zeros());
        let terms = self.legendre.len();
        let in_u = &self.columns.legendre[column * terms..(column + 1) * terms];
        for ([factor, factor_dv], [p, dp]) in self.legendre.iter().zip(in_u) {
            value += factor * *p;
            du += factor * *dp;
            dv += factor_dv * *p;
        }
        if let Some(weights) = self.columns.weights.get(column) {
            let knots = &self.knots[weights.first..weights.first + 4];
            for (i, [knot, knot_dv]) in knots.iter().enumerate() {
                value += knot * weights.value[i];
                du += knot * weights.derivative[i];
                dv += knot_dv * weights.value[i];
            }
        }
        (value, Matrix2::from_columns(&[du, dv]))
    }
}

/// Place of the product `P_total(x) P_0(y)` in the order of [`polynomial::terms`].
fn first_of_total(total: usize) -> usize {
    total * (total + 1) / 2
}

fn collapsed_polynomial(
    polynomial: &Polynomial,
    sensor: SensorSize,
    v: f64,
) -> Vec<[Vector2<f64>; 2]> {
    let degree = polynomial.degree;
    let mut products = Vec::new();
    polynomial::basis(sensor, degree, PixelPoint::new(0.0, v), &mut products);
    let mut collapsed = vec![[Vector2::zeros(); 2]; degree + 1];
    for ((i, j), coefficient) in polynomial::terms(degree).zip(&polynomial.coefficients) {
        // The product P_0(x) P_j(y) is the last of total degree j.
        let [value, _, dv] = products[first_of_total(j) + j];
        collapsed[i][0] += coefficient * value;
        collapsed[i][1] += coefficient * dv;
    }
    collapsed
}

fn collapsed_spline(spline: &Spline, v: f64) -> Vec<[Vector2<f64>; 2]> {
    let weights = spline.grid.weights_v(v);
    let knots_u = spline.grid.knots_u();
    (0..knots_u)
        .map(|i| {
            let mut collapsed = [Vector2::zeros(); 2];
            for j in 0..4 {
                let knot = spline.coefficients[(weights.first + j) * knots_u + i];
                collapsed[0] += knot * weights.value[j];
                collapsed[1] += knot * weights.derivative[j];
            }
            collapsed
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::tests::{bumpy_camera, port_camera};

    #[test]
    fn rows_give_the_numbers_of_single_samples() {
        // An offset with a spline, as a field from sampled rays has it.
        let mut splines = port_camera();
        let spline = bumpy_camera().field.direction.spline;
        splines.field.offset.as_mut().unwrap().spline = spline;
        for camera in [bumpy_camera(), port_camera(), splines] {
            let sensor = camera.field.sensor;
            let columns: Vec<f64> = (0..9)
                .map(|k| f64::from(sensor.width) * f64::from(k) / 8.0 - 0.5)
                .collect();
            let rows = FieldRows::new(&camera.field, columns.clone());
            for v in [-0.5, 3.0, 211.7, f64::from(sensor.height) - 0.5] {
                let row = rows.row(v);
                for (k, &u) in columns.iter().enumerate() {
                    let (a, b) = (row.sample(k), camera.field.sample(PixelPoint::new(u, v)));
                    // Numbers of order 1 and some 40 additions.
                    assert!((a.s - b.s).norm() < 1e-13, "{:?} {:?}", a.s, b.s);
                    assert!((a.ds - b.ds).norm() < 1e-13);
                    assert!((a.m_mm - b.m_mm).norm() < 1e-12);
                    assert!((a.dm - b.dm).norm() < 1e-13);
                }
            }
        }
    }
}
