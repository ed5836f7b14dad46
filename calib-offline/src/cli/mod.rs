//! The command line.

pub mod detect;
