//! Judging: what a recording covers before a calibration, and what the calibration is worth after
//! it, on boards that it never saw, in millimeters and in pixels.

pub mod agreement;
pub mod cause;
pub mod central_model;
pub mod centrality;
pub mod cross_checks;
pub mod difference;
pub mod expected_error;
pub mod grade;
pub mod half_data;
pub mod held_out;
pub mod known_points;
pub mod lengths;
pub mod measured_board;
pub mod model_choice;
pub mod neighbor_noise;
pub mod plausibility;
pub mod screened;
pub mod stage_axis;
mod suspect_words;
pub mod suspects;
pub mod task;
pub mod unexpected_optics;
pub mod validity;
pub mod verdict;
pub mod working_volume;

pub use cause::{Cause, Code};
pub use cross_checks::{CrossChecks, cross_check};
pub use expected_error::{Declared, ExpectedError, TaskError, expected_error};
pub use held_out::{Folds, HeldOut, estimate_folds, held_out};
pub use stage_axis::fit_stage_axes;
pub use task::{Task, TaskWordsError};
