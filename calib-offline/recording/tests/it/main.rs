//! Tests of the crate from outside, in one program.

mod ring_shots;
mod ring_target;
