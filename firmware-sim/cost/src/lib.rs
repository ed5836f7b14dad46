#![doc = include_str!("../README.md")]
#![cfg_attr(not(feature = "std"), no_std)]

pub mod counting;
#[cfg(feature = "integer")]
pub mod probes;
pub mod same_bits;
pub mod yardstick;

#[cfg(feature = "std")]
mod across;
#[cfg(feature = "std")]
mod blobs;
#[cfg(feature = "std")]
mod cores;
#[cfg(feature = "std")]
mod count;
#[cfg(feature = "std")]
mod error;
#[cfg(feature = "std")]
mod image;
#[cfg(feature = "std")]
mod images;
#[cfg(feature = "std")]
mod measure;
#[cfg(feature = "std")]
mod report;
#[cfg(feature = "std")]
mod stack;
#[cfg(feature = "std")]
mod text;

#[cfg(feature = "std")]
pub use across::{AcrossCores, CoreCost, across, usual};
#[cfg(feature = "std")]
pub use blobs::built_in;
#[cfg(feature = "std")]
pub use cores::{CORES, CORTEX_M4F, Core};
#[cfg(feature = "std")]
pub use error::CostError;
#[cfg(feature = "std")]
pub use images::{Images, ImagesError};
#[cfg(feature = "std")]
pub use measure::{measure, panics_in};
#[cfg(feature = "std")]
pub use report::{
    BlobCost, CameraCost, Conditions, Cost, FormsCode, Function, ImageCost, Row, SCHEMA, Spread,
    StackBound, Static,
};
