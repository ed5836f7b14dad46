//! What is said of the blob that was written beside a report.

use crate::present::numbers::short;
use calib_blob::pack::{CurvePoint, Packed};
use serde::Serialize;

/// What is known of the blob that was written beside the report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BlobFacts {
    /// Its size.
    pub bytes: usize,
    /// Largest difference of a ray from the calibration's, px.
    pub max_error_px: f64,
    /// Largest difference of a ray from the calibration's at the working distance, mm.
    pub max_error_mm: f64,
    /// What it was to be at most, px.
    pub wanted_error_px: f64,
    /// What other sizes of the tables would cost, from small to large.
    pub curve: Vec<CurvePoint>,
}

impl BlobFacts {
    /// Of a blob that was to be within `wanted_error_px`.
    pub fn new(packed: &Packed, wanted_error_px: f64) -> Self {
        Self {
            bytes: packed.bytes.len(),
            max_error_px: packed.worst_error_px,
            max_error_mm: packed.worst_error_mm,
            wanted_error_px,
            curve: packed.curve.clone(),
        }
    }

    /// That the blob is worse than it was to be, if it is.
    pub fn warning(&self) -> Option<String> {
        (self.max_error_px > self.wanted_error_px).then(|| {
            format!(
                "the blob is within {} px of the calibration, not within {} px: no table of \
                 single-precision numbers holds that for this sensor and lens",
                short(self.max_error_px),
                short(self.wanted_error_px)
            )
        })
    }

    /// Size and error with their units.
    pub fn in_words(&self) -> String {
        format!(
            "{} bytes ({} kB), within {} px of the calibration, {} mm at the working distance",
            self.bytes,
            short(self.bytes as f64 / 1000.0),
            short(self.max_error_px),
            short(self.max_error_mm)
        )
    }
}
