#![doc = include_str!("../README.md")]
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod app;
pub mod cobs;
pub mod frame;
pub mod health;
pub mod manifest;
pub mod port;
pub mod protocol;
pub mod session;
pub mod storage;
