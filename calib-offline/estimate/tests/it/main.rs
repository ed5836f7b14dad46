//! Tests of the crate from outside, in one program.

mod explain;
mod known_part;
mod known_points;
mod pinhole;
