//! Corners by other tools as `corners.csv`: what was seen, not a calibration.
//!
//! [`columns`] reads any table of values by names of its columns, [`vnl`] mrcal's and mrgingham's `.vnl`, [`views`] the image points in a
//! file of `OpenCV`'s calibration sample. Kalibr dumps no corners in a file of its own.

pub mod columns;
mod row;
pub mod views;
pub mod vnl;

pub use row::{CornerRow, to_csv};
