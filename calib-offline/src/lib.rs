//! Camera calibration with one ray per pixel, from a chessboard on a rotation stage.

pub mod board;
pub mod cli;
pub mod dataset;
pub mod detect;
pub mod field;
pub mod geometry;
pub mod progress;
pub mod report;
pub mod simulate;
