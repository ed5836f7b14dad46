//! The same work without Python, to be timed beside it.

use crate::arrays::{Held, Rows};
use crate::blob::Blob;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use ray_runtime::{MeasureError, Measurement, PixelPoint, Triangulation};

/// Matches as Rust holds them.
#[pyclass(frozen, module = "rays._rays")]
pub struct RustMatches {
    matches: Vec<[PixelPoint; 2]>,
}

#[pymethods]
impl RustMatches {
    /// Of two arrays of `float32`.
    #[new]
    fn new(uv_a: &Bound<'_, PyAny>, uv_b: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (held_a, held_b) = (Held::new(uv_a)?, Held::new(uv_b)?);
        let (Rows::Single(a), Rows::Single(b)) = (held_a.rows::<2>()?, held_b.rows::<2>()?) else {
            return Err(PyTypeError::new_err("expected float32"));
        };
        let pixel = |[u, v]: &[f32; 2]| PixelPoint::new(*u, *v);
        let matches = a.iter().zip(b).map(|(a, b)| [pixel(a), pixel(b)]);
        Ok(Self {
            matches: matches.collect(),
        })
    }

    /// Triangulates them into a vector of the runtime's own answers; how many points there are.
    fn triangulate(&self, py: Python<'_>, blob: &Blob) -> usize {
        let blob = blob.blob();
        py.detach(|| {
            let matches = self.matches.iter();
            let found = matches.map(|[a, b]| blob.triangulate((0, *a), (1, *b)));
            let found: Vec<Result<Triangulation, MeasureError>> = found.collect();
            std::hint::black_box(&found).iter().flatten().count()
        })
    }

    /// The same with covariances.
    fn triangulate_with_covariance(&self, py: Python<'_>, blob: &Blob) -> usize {
        let blob = blob.blob();
        py.detach(|| {
            let matches = self.matches.iter();
            let found = matches.map(|[a, b]| blob.triangulate_with_covariance((0, *a), (1, *b)));
            let found: Vec<Result<Measurement, MeasureError>> = found.collect();
            std::hint::black_box(&found).iter().flatten().count()
        })
    }
}
