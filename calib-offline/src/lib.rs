//! Camera calibration with one ray per pixel, from a chessboard on a rotation stage.

pub mod adjust;
pub mod atomic_file;
pub mod board;
pub mod cli;
pub mod dataset;
pub mod demo;
pub mod detect;
pub mod error;
pub mod evaluate;
pub mod field;
pub mod geometry;
pub mod init;
pub mod joint;
pub mod matches;
pub mod pack;
pub mod pipeline;
pub mod progress;
pub mod report;
pub mod simulate;
