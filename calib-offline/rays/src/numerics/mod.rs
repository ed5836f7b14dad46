//! Numerical mathematics: factorizations, least squares, statistics. No camera is named here.

pub mod arrowhead;
pub mod banded;
pub mod banded_system;
pub mod cholesky;
pub mod product;
pub mod statistics;

pub use statistics::rms;
