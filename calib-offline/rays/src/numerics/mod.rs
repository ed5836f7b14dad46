//! Numerical mathematics: factorizations, least squares, statistics. No camera is named here.

pub mod arrowhead;
pub mod banded;
pub mod banded_system;
pub mod cholesky;
pub mod levenberg;
pub mod pivoted_qr;
pub mod product;
pub mod singular_values;
pub mod statistics;

pub use singular_values::SingularValues;
pub use statistics::{median, rms};
