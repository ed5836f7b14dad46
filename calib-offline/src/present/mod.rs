//! How results are shown, whatever they are of: numbers, tables and drawings. Knows no calibration.

pub mod axes;
pub mod chart;
pub mod numbers;
pub mod svg;
pub mod table;
