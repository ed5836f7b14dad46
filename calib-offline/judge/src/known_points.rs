//! Measured points against where they truly are, beside what a perfect calibration would do: for anything
//! that turns matches into points.

use calib_blob::matches::{KnownMatches, TruePoint};
use calib_rays::geometry::best_placement;
use calib_rays::measure::{PointSource, Sighting};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

/// A measured point with its truth, one frame for all three, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointWithTruth {
    /// As measured.
    pub measured_mm: Vector3<f64>,
    /// Where it is.
    pub true_mm: Vector3<f64>,
    /// What the true rays of the same pixels give: the limit that the noise of the pixels sets.
    pub oracle_mm: Vector3<f64>,
}

impl PointWithTruth {
    /// What was measured of a point.
    pub fn new(measured_mm: Vector3<f64>, truth: &TruePoint) -> Self {
        Self {
            measured_mm,
            true_mm: truth.true_mm(),
            oracle_mm: truth.oracle_mm(),
        }
    }
}

/// Points of matches, in their order, mm; `None` where there is none.
pub type Points = Vec<Option<Vector3<f64>>>;

/// Measures matches with anything that turns them into points.
pub fn measure<S>(source: &S, matches: &[Vec<Sighting<S::Number>>]) -> Points
where
    S: PointSource + ?Sized,
{
    let point = |sightings: &Vec<_>| {
        let found = source.point(sightings).ok()?;
        Some(Vector3::from(found.point_mm.map(Into::into)))
    };
    matches.par_iter().map(point).collect()
}

/// Points beside their truth, of the matches (by place in the list) that are wanted and have a point.
pub fn beside_truth(
    points: &[Option<Vector3<f64>>],
    truth: &[TruePoint],
    is_wanted: impl Fn(usize) -> bool,
) -> Vec<PointWithTruth> {
    let pairs = points.iter().zip(truth).enumerate();
    pairs
        .filter(|(k, _)| is_wanted(*k))
        .filter_map(|(_, (point, truth))| Some(PointWithTruth::new((*point)?, truth)))
        .collect()
}

/// A file of matches whose truth is known, and what a source made of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KnownPoints {
    /// The file's name.
    pub file: String,
    /// Matches in it.
    pub matches: usize,
    /// Matches without a point: outside the calibrated area, or with rays that do not meet.
    pub without_point: usize,
    /// How far the points are from the truth.
    pub errors: Option<TruthErrors>,
}

impl KnownPoints {
    /// Measures all of a file's matches.
    pub fn of<S: PointSource + ?Sized>(source: &S, known: &KnownMatches<S::Number>) -> Self {
        let points = beside_truth(&measure(source, &known.matches), &known.truth, |_| true);
        Self {
            file: known.file.clone(),
            matches: known.matches.len(),
            without_point: known.matches.len() - points.len(),
            errors: compare_with_truth(&points),
        }
    }
}

/// RMS errors of measured points, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TruthErrors {
    /// Points compared.
    pub points: usize,
    /// As measured, in the common frame.
    pub direct_rms_mm: f64,
    /// After the rigid placement that suits them best: without the error of the frame itself.
    pub placed_rms_mm: f64,
    /// Of the oracle, in the common frame.
    pub oracle_rms_mm: f64,
    /// Direct over oracle.
    pub direct_ratio: f64,
    /// Placed over oracle.
    pub placed_ratio: f64,
}

/// Compares points with their truth; `None` for fewer than 3 points.
pub fn compare_with_truth(points: &[PointWithTruth]) -> Option<TruthErrors> {
    let column = |of: fn(&PointWithTruth) -> Vector3<f64>| points.iter().map(of).collect();
    let measured: Vec<Vector3<f64>> = column(|p| p.measured_mm);
    let truth: Vec<Vector3<f64>> = column(|p| p.true_mm);
    let oracle: Vec<Vector3<f64>> = column(|p| p.oracle_mm);
    let truth_from_measured = best_placement(&measured, &truth)?;
    let placed: Vec<Vector3<f64>> = measured
        .iter()
        .map(|point| truth_from_measured.point(point))
        .collect();
    let [direct_rms_mm, placed_rms_mm, oracle_rms_mm] =
        [&measured, &placed, &oracle].map(|points| rms_distance_mm(points, &truth));
    Some(TruthErrors {
        points: points.len(),
        direct_rms_mm,
        placed_rms_mm,
        oracle_rms_mm,
        direct_ratio: direct_rms_mm / oracle_rms_mm,
        placed_ratio: placed_rms_mm / oracle_rms_mm,
    })
}

fn rms_distance_mm(points: &[Vector3<f64>], truth: &[Vector3<f64>]) -> f64 {
    let sum: f64 = points
        .iter()
        .zip(truth)
        .map(|(point, truth)| (point - truth).norm_squared())
        .sum();
    (sum / points.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_is_an_error_of_the_frame_alone() {
        let shift = Vector3::new(0.0, 3.0, 4.0);
        let points: Vec<PointWithTruth> = [[0.0, 0.0, 0.0], [7.0, 1.0, 0.0], [2.0, 9.0, 5.0]]
            .map(|true_mm| PointWithTruth {
                measured_mm: Vector3::from(true_mm) + shift,
                true_mm: true_mm.into(),
                oracle_mm: Vector3::from(true_mm) + shift / 10.0,
            })
            .into();
        let errors = compare_with_truth(&points).unwrap();
        assert!((errors.direct_rms_mm - 5.0).abs() < 1e-12);
        assert!((errors.direct_ratio - 10.0).abs() < 1e-12);
        assert!(errors.placed_rms_mm < 1e-12);
        assert_eq!(errors.points, 3);
        assert_eq!(compare_with_truth(&points[..2]), None);
    }
}
