//! What a calibration is worth: on boards that it never saw, in millimeters and in pixels.

pub mod held_out;
pub mod measured_board;
pub mod resection;
pub mod verdict;

pub use held_out::{HeldOut, held_out};
