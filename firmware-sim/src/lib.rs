#![doc = include_str!("../README.md")]

#[cfg(feature = "client")]
mod ask_blob;
#[cfg(feature = "client")]
pub mod client;
#[cfg(feature = "signed")]
pub mod owner;
pub mod simulated;
#[cfg(feature = "simulated")]
pub mod slot_image;
