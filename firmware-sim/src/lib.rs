#![doc = include_str!("../README.md")]

#[cfg(feature = "client")]
pub mod client;
pub mod simulated;
#[cfg(feature = "simulated")]
pub mod slot_image;
