#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![allow(
    clippy::inline_always,
    reason = "on the hot path only, each counted by `firmware-sim cost`"
)]

#[cfg(target_endian = "big")]
compile_error!("a blob is read in place and holds little-endian numbers");

mod aligned;
mod blob;
mod camera;
mod camera_check;
mod check;
mod epipolar_row;
mod error;
pub mod format;
mod grid;
#[cfg(feature = "integer")]
pub mod integer;
mod knots;
mod lookup;
mod mask;
mod match_noise;
#[cfg(feature = "nalgebra")]
mod nalgebra_types;
mod polynomial;
mod project;
mod quantized;
mod ray;
mod rounding;
mod row;
mod self_test;
mod sensor_window;
mod spline;
mod triangulate;
mod uncertainty;
mod vector;
mod weights;

pub use aligned::Aligned;
pub use blob::RayBlob;
pub use camera::{Camera, Region, RigFromCamera};
pub use epipolar_row::EpipolarRun;
pub use error::{LookupError, MeasureError, OpenError, ProjectError, ReadoutError, Table};
pub use match_noise::MatchNoise;
pub use project::{EpipolarCurve, EpipolarPoint};
pub use ray::{PixelPoint, Ray};
pub use rounding::Rounding;
pub use row::{Matched, Row, RowPoint};
pub use self_test::{SelfTestFailure, SelfTests};
pub use sensor_window::{Readout, SensorWindow};
pub use triangulate::{MIN_PARALLAX_SIN, Triangulation, triangulate_pair};
pub use uncertainty::{Measurement, PointCovariance};
