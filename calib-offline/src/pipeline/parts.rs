//! What the steps found, for the record.

use super::Corners;
use crate::methods::Solution;
use calib_estimate::adjust::Observations;
use calib_judge::agreement::Agreement;
use calib_judge::plausibility::Explained;
use calib_judge::verdict::Thresholds;
use calib_judge::{Cause, CrossChecks, ExpectedError, HeldOut};
use calib_recording::dataset::Dataset;

/// Results of all steps.
pub struct Parts<'a> {
    /// The dataset.
    pub dataset: &'a Dataset,
    /// All corners, excluded poses included.
    pub corners: &'a Corners,
    /// What was offered to the estimate.
    pub observations: &'a Observations,
    /// What the method made of it.
    pub solution: &'a Solution,
    /// The check on unseen boards.
    pub held_out: &'a HeldOut,
    /// Residuals of the same corners by the whole and by the folds.
    pub agreement: Agreement,
    /// What a pixel of the first camera is at the working distance, mm.
    pub mm_per_px: f64,
    /// RMS of what the calibration leaves open of points at the working distance, mm.
    pub left_open_mm: Option<f64>,
    /// Checks of the calibration against itself, where the method has them.
    pub checks: Option<&'a CrossChecks>,
    /// What was found about the recording, most likely first.
    pub causes: &'a [Cause],
    /// Views that are meant otherwise than they are written.
    pub explained: &'a [Explained],
    /// The expected error of the measurement asked for.
    pub task: Option<&'a ExpectedError>,
    /// What counts as good.
    pub thresholds: &'a Thresholds,
}
