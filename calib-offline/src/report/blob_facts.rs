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
    /// Whether the search for tables ended before everything was tried: it may take no more work than it was given.
    pub search_ended_early: bool,
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
            search_ended_early: packed.work.is_spent,
            curve: packed.curve.clone(),
        }
    }

    /// That the blob is worse than it was to be, if it is.
    pub fn warning(&self) -> Option<String> {
        (self.max_error_px > self.wanted_error_px).then(|| {
            let why = if self.search_ended_early {
                "the search for a better table ended at the work that packing may take"
            } else {
                "no table tried holds that for this sensor and lens"
            };
            format!(
                "the blob is within {} px of the calibration, not within {} px: {why}",
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_that_was_not_met_is_said_with_its_reason() {
        let mut blob = BlobFacts {
            bytes: 3000,
            max_error_px: 0.0012,
            max_error_mm: 0.001,
            wanted_error_px: 0.001,
            search_ended_early: false,
            curve: Vec::new(),
        };
        assert!(blob.warning().unwrap().contains("no table tried"));
        blob.search_ended_early = true;
        let words = blob.warning().unwrap();
        assert!(
            words.contains("0.00120 px") && words.contains("ended at the work"),
            "{words}"
        );
        blob.max_error_px = 0.001;
        assert_eq!(blob.warning(), None);
    }
}
