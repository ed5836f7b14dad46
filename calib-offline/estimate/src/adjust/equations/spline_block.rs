//! The equations of one camera's spline, and what is left of them once it is eliminated.
//!
//! The spline's knots meet each other in a band F and everything else in a border E, METHOD 2.5:
//! `F = L L^T`, `Y = L^-1 E`, and `Y^T Y` is what the spline takes off the rest: the rest less that
//! is its Schur complement. The border stays in the fields' own columns (see [`Components`]) and the
//! poses'; only the product is carried over to parameters.
//!
//! [`Components`]: super::components::Components

use super::assembly::SplineSums;
use calib_rays::numerics::banded::BandedMatrix;
use calib_rays::numerics::cholesky::{BandedCholesky, gram};
use calib_rays::numerics::product::{
    column_major, column_major_mut, multiply, row_major, row_major_mut,
};
use nalgebra::{DMatrix, DVector};

/// The equations of one camera's spline.
#[derive(Debug, Clone)]
pub struct SplineBlock {
    /// Knot by knot.
    pub band: BandedMatrix,
    /// Of the knots.
    pub gradient: DVector<f64>,
    /// Knots (rows, row-major) by border columns.
    border: Vec<f64>,
    begins: Vec<usize>,
    columns: BorderColumns,
}

/// What the columns of a border stand for among the remaining parameters.
#[derive(Debug, Clone)]
pub struct BorderColumns {
    /// Columns of the field (rows) by parameters of the field: the first border columns.
    pub field: DMatrix<f64>,
    /// Where the field's parameters start.
    pub field_start: usize,
    /// Where each further column stands; `None` for what is no parameter.
    pub others: Vec<Option<usize>>,
    /// Which of these is the gradient.
    pub gradient: usize,
}

/// A spline that is eliminated: L, Y and the product of Y with itself.
#[derive(Debug, Clone)]
pub struct EliminatedSpline {
    factor: BandedCholesky,
    /// Row-major.
    y: Vec<f64>,
    /// `Y^T Y`, lower triangle.
    product: DMatrix<f64>,
    columns: BorderColumns,
}

impl SplineBlock {
    /// From what the views contribute; priors are still missing.
    pub fn new(sums: SplineSums, columns: BorderColumns) -> Self {
        let len = sums.begins.len();
        let at = columns.gradient_column();
        Self {
            gradient: DVector::from_fn(sums.band.size(), |row, _| sums.border[row * len + at]),
            band: sums.band,
            border: sums.border,
            begins: sums.begins,
            columns,
        }
    }

    /// Adds `weight` times an energy at the given amounts.
    pub fn add_prior(&mut self, weight: f64, energy: &BandedMatrix, amounts: &DVector<f64>) {
        self.band.add_scaled(weight, energy);
        self.gradient += energy.times(amounts) * weight;
        let (len, at) = (self.begins.len(), self.columns.gradient_column());
        for (row, value) in self.gradient.iter().enumerate() {
            self.border[row * len + at] = *value;
        }
    }

    /// Eliminates the knots and takes their share off the lower triangle of the equations of
    /// everything else. `None` if the band is not positive definite.
    pub fn eliminate(&self, damping: f64) -> Option<EliminatedSpline> {
        let factor = BandedCholesky::of_banded(&self.band, 1.0 + damping)?;
        let mut y = self.border.clone();
        factor.solve_lower(&mut y, &self.begins);
        Some(EliminatedSpline {
            product: gram(&y, &self.begins),
            factor,
            y,
            columns: self.columns.clone(),
        })
    }
}

impl BorderColumns {
    fn len(&self) -> usize {
        self.field.nrows() + self.others.len()
    }

    fn gradient_column(&self) -> usize {
        self.field.nrows() + self.gradient
    }

    /// The border's columns of values given for the remaining parameters (rows).
    fn gather(&self, values: &DMatrix<f64>) -> DMatrix<f64> {
        let mut own = DMatrix::zeros(self.len(), values.ncols());
        let field_len = self.field.nrows();
        own.rows_mut(0, field_len).gemm(
            1.0,
            &self.field,
            &values.rows(self.field_start, self.field.ncols()),
            0.0,
        );
        for (k, target) in self.others.iter().enumerate() {
            if let Some(target) = target {
                own.row_mut(field_len + k).copy_from(&values.row(*target));
            }
        }
        own
    }

    /// The transpose of [`Self::gather`]: what border columns (rows) mean for `len` remaining
    /// parameters.
    fn scatter(&self, own: &DMatrix<f64>, len: usize) -> DMatrix<f64> {
        let mut values = DMatrix::zeros(len, own.ncols());
        let field_len = self.field.nrows();
        values
            .rows_mut(self.field_start, self.field.ncols())
            .copy_from(&(self.field.transpose() * own.rows(0, field_len)));
        for (k, target) in self.others.iter().enumerate() {
            if let Some(target) = target {
                values.row_mut(*target).copy_from(&own.row(field_len + k));
            }
        }
        values
    }
}

impl EliminatedSpline {
    /// Takes the spline's share off the remaining equations: a matrix (lower triangle) and a
    /// right-hand side.
    pub fn subtract_from(&self, matrix: &mut DMatrix<f64>, right: &mut DVector<f64>) {
        let len = right.len();
        let mut product = self.product.clone();
        product.fill_upper_triangle_with_lower_triangle();
        let half = self.columns.scatter(&product, len);
        *right += half.column(self.columns.gradient_column());
        *matrix -= self.columns.scatter(&half.transpose(), len);
    }

    /// The knots' part of a solution, given the rest of it.
    pub fn step(&self, rest: &DVector<f64>) -> DVector<f64> {
        let rest = DMatrix::from_column_slice(rest.len(), 1, rest.as_slice());
        let mut own = self.columns.gather(&rest);
        // L^-1 of the negative gradient is minus its column of Y.
        own[(self.columns.gradient_column(), 0)] = 1.0;
        let own = own.column(0);
        let mut knots = DVector::from_iterator(
            self.y.len() / own.len(),
            self.y
                .chunks_exact(own.len())
                .map(|row| -row.iter().zip(own.iter()).map(|(y, x)| y * x).sum::<f64>()),
        );
        self.factor.solve_upper_vector(&mut knots);
        knots
    }

    /// Natural logarithm of the determinant of the band.
    pub fn ln_determinant(&self) -> f64 {
        self.factor.ln_determinant()
    }

    /// Replaces a matrix with a row per knot (row-major) by `L^-1` times it.
    pub fn solve_lower(&self, matrix: &mut [f64], columns: usize) {
        self.factor.solve_lower(matrix, &vec![0; columns]);
    }

    /// `Y^T` times such a matrix, as columns of the `rest_len` remaining parameters.
    pub fn pull(&self, matrix: &[f64], columns: usize, rest_len: usize) -> DMatrix<f64> {
        let (border_len, rows) = (self.columns.len(), matrix.len() / columns);
        let mut pulled = DMatrix::zeros(border_len, columns);
        multiply(
            &mut column_major_mut(pulled.as_mut_slice(), border_len, columns, border_len),
            1.0,
            &column_major(&self.y, border_len, rows, border_len),
            &row_major(matrix, rows, columns, columns),
            0.0,
        );
        self.columns.scatter(&pulled, rest_len)
    }

    /// Number of rows: two per knot.
    pub fn row_count(&self) -> usize {
        self.y.len() / self.columns.len()
    }

    /// The knots' block of the inverse of everything times some columns, row-major; `rest` is the
    /// factor of the remaining equations, of `rest_len` parameters.
    pub fn covariance_times(
        &self,
        columns: &[f64],
        column_count: usize,
        rest: &BandedCholesky,
        rest_len: usize,
    ) -> Vec<f64> {
        let rows = columns.len() / column_count;
        let border_len = self.columns.len();
        let mut solved = columns.to_vec();
        self.solve_lower(&mut solved, column_count);
        let mut inner = -self.pull(&solved, column_count, rest_len).transpose();
        // Column-major storage is the transpose in row-major storage.
        rest.solve_lower(inner.as_mut_slice(), &vec![0; column_count]);
        rest.solve_upper(inner.as_mut_slice(), column_count);
        let own = self.columns.gather(&inner.transpose());
        multiply(
            &mut row_major_mut(&mut solved, rows, column_count, column_count),
            -1.0,
            &row_major(&self.y, rows, border_len, border_len),
            &column_major(own.as_slice(), border_len, column_count, border_len),
            1.0,
        );
        self.factor.solve_upper(&mut solved, column_count);
        solved
    }
}
