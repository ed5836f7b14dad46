#![doc = include_str!("../README.md")]

pub mod audit;
pub mod cli;
pub mod compare;
pub mod demo;
pub mod device;
pub mod methods;
pub mod pipeline;
pub mod present;
pub mod report;

#[cfg(test)]
#[path = "../tests/it/common/snapshot.rs"]
mod snapshot;
