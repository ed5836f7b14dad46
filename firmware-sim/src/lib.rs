#![doc = include_str!("../README.md")]
#![cfg_attr(not(feature = "std"), no_std)]

pub mod app;
pub mod cobs;
pub mod counting;
pub mod frame;
pub mod port;
pub mod protocol;
pub mod random;
pub mod same_bits;
pub mod session;
pub mod yardstick;

#[cfg(feature = "std")]
pub mod client;
#[cfg(feature = "std")]
pub mod cost;
#[cfg(feature = "std")]
pub mod host;
#[cfg(feature = "std")]
pub mod qemu;
