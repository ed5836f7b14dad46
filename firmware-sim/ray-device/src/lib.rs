#![doc = include_str!("../README.md")]
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod app;
pub mod cobs;
pub mod frame;
pub mod health;
#[cfg(feature = "embedded-io")]
pub mod io_link;
pub mod port;
pub mod protocol;
pub mod session;
pub mod storage;
