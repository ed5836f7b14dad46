//! Known lengths against measured ones: length measurement errors, their predicted standard deviations and their
//! limits.

use super::grade::Grade;
use calib_blob::matches::KnownLength;
use calib_rays::numerics::rms;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

/// A measured end of a length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct End {
    /// Where, mm.
    pub point_mm: Vector3<f64>,
    /// Its covariance in the same frame, mm^2; `None` where the rig does not say.
    pub covariance_mm2: Option<Matrix3<f64>>,
}

/// A length that was checked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CheckedLength {
    /// One end.
    pub id_a: String,
    /// The other.
    pub id_b: String,
    /// As known, mm.
    pub length_mm: f64,
    /// As measured, mm; `None` if an end has no point.
    pub measured_mm: Option<f64>,
    /// The length measurement error: measured minus known, mm.
    pub error_mm: Option<f64>,
    /// Its predicted standard deviation, mm; `None` where the rig does not say.
    pub sd_mm: Option<f64>,
    /// What the error may be at most, mm.
    pub limit_mm: Option<f64>,
    /// Whether it is within; `None` without a limit or without a measurement.
    pub inside: Option<bool>,
}

/// What all lengths say.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CheckedLengths {
    /// `fail` if an error exceeds its limit, `doubtful` if a length with a limit was not measured, else `pass`;
    /// `None` without any limit.
    pub verdict: Option<Grade>,
    /// With an error within its limit.
    pub inside: usize,
    /// With an error beyond its limit.
    pub outside: usize,
    /// Without a measurement.
    pub not_measured: usize,
    /// The error of largest amount, mm.
    pub largest_error_mm: Option<f64>,
    /// RMS of the errors, mm.
    pub rms_error_mm: Option<f64>,
    /// RMS of errors over their standard deviations: about 1 if these are true.
    pub error_over_sd: Option<f64>,
    /// Each, in the file's order.
    pub lengths: Vec<CheckedLength>,
}

/// Checks lengths between ends; `None` of an end that has no point. Both ends count as independent: what the
/// calibration leaves open moves them together, so that for short lengths the standard deviation is too large.
///
/// `board_ppm` is the standard deviation of the scale of the calibration's board: it is one of every length.
pub fn check(known: &[KnownLength], ends: &[[Option<End>; 2]], board_ppm: f64) -> CheckedLengths {
    let lengths: Vec<CheckedLength> = known
        .iter()
        .zip(ends)
        .map(|(known, ends)| checked(known, ends, board_ppm))
        .collect();
    let errors: Vec<f64> = lengths.iter().filter_map(|l| l.error_mm).collect();
    let over_sd: Vec<f64> = lengths
        .iter()
        .filter_map(|l| Some(l.error_mm? / l.sd_mm.filter(|sd| *sd > 0.0)?))
        .collect();
    let count = |inside| lengths.iter().filter(|l| l.inside == inside).count();
    let (within, beyond) = (count(Some(true)), count(Some(false)));
    let untested = |l: &CheckedLength| l.limit_mm.is_some() && l.inside.is_none();
    let verdict = if beyond > 0 {
        Some(Grade::Fail)
    } else if lengths.iter().any(untested) {
        Some(Grade::Doubtful)
    } else {
        (within > 0).then_some(Grade::Pass)
    };
    CheckedLengths {
        verdict,
        inside: within,
        outside: beyond,
        not_measured: lengths.iter().filter(|l| l.measured_mm.is_none()).count(),
        largest_error_mm: errors
            .iter()
            .copied()
            .max_by(|a, b| a.abs().total_cmp(&b.abs())),
        rms_error_mm: rms(&errors),
        error_over_sd: rms(&over_sd),
        lengths,
    }
}

fn checked(known: &KnownLength, ends: &[Option<End>; 2], board_ppm: f64) -> CheckedLength {
    let measured = match ends {
        [Some(a), Some(b)] => Some((a, b)),
        _ => None,
    };
    let measured_mm = measured.map(|(a, b)| (b.point_mm - a.point_mm).norm());
    let error_mm = measured_mm.map(|measured_mm| measured_mm - known.length_mm);
    let sd_mm = measured.and_then(|(a, b)| {
        let along = (b.point_mm - a.point_mm).try_normalize(f64::MIN_POSITIVE)?;
        let both_mm2 = a.covariance_mm2? + b.covariance_mm2?;
        let scale_mm = 1e-6 * board_ppm * known.length_mm;
        Some((along.dot(&(both_mm2 * along)).max(0.0) + scale_mm * scale_mm).sqrt())
    });
    CheckedLength {
        id_a: known.ids[0].clone(),
        id_b: known.ids[1].clone(),
        length_mm: known.length_mm,
        measured_mm,
        error_mm,
        sd_mm,
        limit_mm: known.limit_mm,
        inside: known
            .limit_mm
            .zip(error_mm)
            .map(|(limit_mm, error_mm)| error_mm.abs() <= limit_mm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(length_mm: f64, limit_mm: Option<f64>) -> KnownLength {
        KnownLength {
            line: 2,
            ids: ["a".to_owned(), "b".to_owned()],
            length_mm,
            limit_mm,
        }
    }

    fn end(x: f64, variance_mm2: f64) -> End {
        End {
            point_mm: Vector3::new(x, 7.0, 500.0),
            covariance_mm2: Some(Matrix3::from_diagonal(&Vector3::new(
                variance_mm2,
                9.0,
                9.0,
            ))),
        }
    }

    #[test]
    fn an_error_has_the_variance_of_both_ends_along_the_length_and_of_the_scale() {
        let ends = [[end(0.0, 0.0004), end(100.01, 0.0005)].map(Some)];
        let found = check(&[known(100.0, Some(0.02))], &ends, 400.0);
        let length = &found.lengths[0];
        assert!((length.error_mm.unwrap() - 0.01).abs() < 1e-12);
        // 0.0009 of the ends and 0.04 mm of 400 ppm: 3, 4, 5.
        assert!((length.sd_mm.unwrap() - 0.05).abs() < 1e-12);
        assert_eq!(length.inside, Some(true));
        assert_eq!(found.verdict, Some(Grade::Pass));
        assert!((found.error_over_sd.unwrap() - 0.2).abs() < 1e-9);
    }

    #[test]
    fn a_verdict_takes_limits_and_measurements() {
        let measured = [end(0.0, 1.0), end(100.01, 1.0)].map(Some);
        let verdict = |all: &[(Option<f64>, [Option<End>; 2])]| {
            let lengths: Vec<_> = all.iter().map(|(limit, _)| known(100.0, *limit)).collect();
            let ends: Vec<_> = all.iter().map(|(_, ends)| *ends).collect();
            check(&lengths, &ends, 0.0).verdict
        };
        assert_eq!(verdict(&[(None, measured)]), None);
        assert_eq!(
            verdict(&[(Some(0.02), measured), (None, measured)]),
            Some(Grade::Pass)
        );
        let unmeasured = (Some(0.02), [None, Some(end(0.0, 1.0))]);
        assert_eq!(
            verdict(&[(Some(0.02), measured), unmeasured]),
            Some(Grade::Doubtful)
        );
        assert_eq!(
            verdict(&[(Some(0.005), measured), unmeasured]),
            Some(Grade::Fail)
        );
    }
}
