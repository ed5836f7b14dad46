//! Tests of the crate from outside, in one program.

mod golden_blob;
mod integers;
