//! Arrays of NumPy as slices of rows, and back.

use numpy::{Element, IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// A coordinate as it comes in; the runtime computes in `f32`, to which the other is rounded.
pub trait Coordinate: Element + Copy + Sync {
    /// The nearest `f32`.
    fn narrow(self) -> f32;
}

impl Coordinate for f32 {
    #[inline(always)]
    fn narrow(self) -> f32 {
        self
    }
}

impl Coordinate for f64 {
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "said to round")]
    fn narrow(self) -> f32 {
        self as f32
    }
}

/// An array of rows, held so that it stays where it is.
pub enum Held<'py> {
    /// Of `float32`.
    Single(PyReadonlyArray2<'py, f32>),
    /// Of `float64`.
    Double(PyReadonlyArray2<'py, f64>),
}

/// Its rows.
#[derive(Clone, Copy)]
pub enum Rows<'a, const WIDTH: usize> {
    /// Of `float32`.
    Single(&'a [[f32; WIDTH]]),
    /// Of `float64`.
    Double(&'a [[f64; WIDTH]]),
}

impl<'py> Held<'py> {
    /// Holds an array of two axes of one of both types.
    pub fn new(array: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = array.cast::<PyArray2<f32>>() {
            return Ok(Self::Single(array.try_readonly()?));
        }
        if let Ok(array) = array.cast::<PyArray2<f64>>() {
            return Ok(Self::Double(array.try_readonly()?));
        }
        Err(PyTypeError::new_err(
            "expected an array of float32 or float64 with two axes",
        ))
    }

    /// Its rows, which must lie one behind the other.
    pub fn rows<const WIDTH: usize>(&self) -> PyResult<Rows<'_, WIDTH>> {
        match self {
            Self::Single(array) => rows(array).map(Rows::Single),
            Self::Double(array) => rows(array).map(Rows::Double),
        }
    }
}

fn rows<'a, T: Element, const WIDTH: usize>(
    array: &'a PyReadonlyArray2<'_, T>,
) -> PyResult<&'a [[T; WIDTH]]> {
    let found = array.as_array().ncols();
    if found != WIDTH {
        return Err(PyValueError::new_err(format!(
            "expected rows of {WIDTH} numbers, found {found}"
        )));
    }
    let (rows, _) = array.as_slice()?.as_chunks();
    Ok(rows)
}

impl<const WIDTH: usize> Rows<'_, WIDTH> {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Single(rows) => rows.len(),
            Self::Double(rows) => rows.len(),
        }
    }
}

/// Numbers as an array of rows; they are not copied.
pub fn table(
    py: Python<'_>,
    numbers: Vec<f32>,
    width: usize,
) -> PyResult<Bound<'_, PyArray2<f32>>> {
    let rows = numbers.len() / width;
    numbers.into_pyarray(py).reshape([rows, width])
}

/// Numbers as an array; they are not copied.
pub fn list<T: Element>(py: Python<'_>, numbers: Vec<T>) -> Bound<'_, PyArray1<T>> {
    numbers.into_pyarray(py)
}
