//! Tests of the crate from outside, in one program.

mod other_targets;
mod ring_shots;
mod ring_target;
mod rolled_circles;
