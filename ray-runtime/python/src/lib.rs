//! What the Python package `rays` does in Rust: opens a blob and asks `ray-runtime` about whole arrays.
//!
//! The package (`python/rays`) has the documentation, the checks of shapes and types and the words of
//! errors; here are the loops. Arrays come in as they lie in memory, `float32` or `float64`, and the
//! lock of the interpreter is released while they are worked on, by one thread.

mod arrays;
mod blob;
mod loops;
#[cfg(feature = "timing")]
mod timing;

use pyo3::prelude::*;

/// The part of `rays` that is written in Rust.
#[pymodule]
mod _rays {
    #[pymodule_export]
    use super::blob::Blob;
    #[cfg(feature = "timing")]
    #[pymodule_export]
    use super::timing::RustMatches;
}
