//! Judging: what a recording covers before a calibration, and what the calibration is worth after
//! it, on boards that it never saw, in millimeters and in pixels.

pub mod capture;
pub mod held_out;
pub mod measured_board;
pub mod resection;
pub mod stage_axis;
pub mod truth;
pub mod verdict;

pub use capture::Capture;
pub use held_out::{Folds, HeldOut, estimate_folds, held_out};
pub use stage_axis::fit_stage_axes;
