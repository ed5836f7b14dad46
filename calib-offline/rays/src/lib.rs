//! Ray fields and what is computed with them: pure mathematics, no files and no estimation.
//!
//! Lengths are millimeters, angles radians, pixels those of the image with (0, 0) at the center of the
//! top-left one. `a_from_b` maps coordinates in b to coordinates in a.

pub mod board;
pub mod field;
pub mod geometry;
pub mod in_order;
pub mod measure;
pub mod numerics;
pub mod observed;
pub mod print;
pub mod progress;
pub mod remedy;
