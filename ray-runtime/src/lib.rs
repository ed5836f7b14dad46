#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(target_endian = "big")]
compile_error!("a blob is read in place and holds little-endian numbers");

mod aligned;
mod blob;
mod camera;
mod camera_check;
mod check;
mod error;
pub mod format;
mod grid;
mod lookup;
mod polynomial;
mod quantized;
mod ray;
mod self_test;
#[cfg(feature = "old-versions")]
mod spline;
mod triangulate;
mod uncertainty;

pub use aligned::Aligned;
pub use blob::RayBlob;
pub use camera::{Camera, Region, RigFromCamera};
pub use error::{LookupError, MeasureError, OpenError, Table};
pub use ray::{PixelPoint, Ray};
pub use self_test::{SelfTestFailure, SelfTests};
pub use triangulate::{MIN_PARALLAX_SIN, Triangulation, triangulate_pair};
pub use uncertainty::{Measurement, PointCovariance};
