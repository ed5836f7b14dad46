//! Judging: what a recording covers before a calibration, how good a calibration is after it.

pub mod capture;
pub mod stage_axis;

pub use capture::Capture;
pub use stage_axis::fit_stage_axes;
