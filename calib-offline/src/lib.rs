//! Camera calibration with one ray per pixel, from a chessboard on a rotation stage.

pub mod board;
pub mod dataset;
pub mod field;
pub mod geometry;
pub mod pack;
pub mod report;
