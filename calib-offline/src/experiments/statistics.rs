//! Mean, spread and size of errors.

use calib_rays::numerics::rms;
use serde::Serialize;

/// Of errors, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorStatistics {
    /// How many.
    pub count: usize,
    /// Mean.
    pub mean_mm: f64,
    /// Standard deviation about the mean.
    pub deviation_mm: f64,
    /// Its square.
    pub variance_mm2: f64,
    /// Root mean square.
    pub rms_mm: f64,
    /// The largest.
    pub worst_mm: f64,
}

impl ErrorStatistics {
    /// `None` without errors.
    pub fn of(errors_mm: &[f64]) -> Option<Self> {
        let rms_mm = rms(errors_mm)?;
        let count = errors_mm.len() as f64;
        let mean_mm = errors_mm.iter().sum::<f64>() / count;
        let variance_mm2 = errors_mm.iter().map(|e| (e - mean_mm).powi(2)).sum::<f64>() / count;
        Some(Self {
            count: errors_mm.len(),
            mean_mm,
            deviation_mm: variance_mm2.sqrt(),
            variance_mm2,
            rms_mm,
            worst_mm: errors_mm.iter().copied().fold(0.0, f64::max),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_three_errors() {
        let found = ErrorStatistics::of(&[1.0, 2.0, 6.0]).unwrap();
        // Round-off of a few operations.
        let near = |a: f64, b: f64| (a - b).abs() < 1e-14;
        assert!(near(found.mean_mm, 3.0) && near(found.variance_mm2, 14.0 / 3.0));
        assert!(near(found.rms_mm, (41f64 / 3.0).sqrt()));
        assert_eq!((found.count, found.worst_mm), (3, 6.0));
        assert_eq!(ErrorStatistics::of(&[]), None);
    }
}
