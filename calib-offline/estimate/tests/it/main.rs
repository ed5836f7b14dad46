//! Tests of the crate from outside, in one program.

mod explain;
mod pinhole;
