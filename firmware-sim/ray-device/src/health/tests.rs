use super::*;
use ray_runtime::{PointCovariance, Triangulation};
use split_mix::SplitMix;

fn measurement(gap_mm: f32, sigma_mm: Option<f32>) -> Measurement {
    Measurement {
        found: Triangulation {
            point_mm: [0.0; 3],
            gap_squared_mm2: gap_mm * gap_mm,
        },
        is_second_above: gap_mm >= 0.0,
        covariance: sigma_mm.map(|sigma_mm| PointCovariance {
            calibration_mm2: [[0.0; 3]; 3],
            noise_mm2: [[0.0; 3]; 3],
            gap_mm2: sigma_mm * sigma_mm,
        }),
    }
}

/// A sum of twelve is nearly normal, of standard deviation 1.
fn normal(random: &mut SplitMix) -> f32 {
    (0..12).map(|_| random.unit()).sum::<f32>() - 6.0
}

/// Gaps of a predicted standard deviation of 0.02 mm that are `spread` times as large and off by
/// `shift_mm`.
fn counted(points: u32, spread: f32, shift_mm: f32) -> GapReport {
    let mut random = SplitMix(5);
    let mut health = Health::new();
    for _ in 0..points {
        let gap_mm = 0.02 * spread * normal(&mut random) + shift_mm;
        health.note(&measurement(gap_mm, Some(0.02)));
    }
    health.report().unwrap()
}

#[test]
fn gaps_as_predicted_fit() {
    let report = counted(5000, 1.0, 0.0);
    let predicted = report.predicted.unwrap();
    assert_eq!(report.verdict(), Verdict::Fits);
    // The mean of 5000 has a standard deviation of 0.014, the 95 % point one of 1.5 % and the bins' 3 %.
    assert!(predicted.shift.abs() < 0.06, "{report:?}");
    assert!((predicted.spread - 1.0).abs() < 0.08, "{report:?}");
    assert!((predicted.mean_sigma_mm - 0.02).abs() < 1e-5);
    // A normal gap's mean size is 0.798 standard deviations.
    assert!(
        (report.mean_size_mm - 0.02 * 0.798).abs() < 0.02 * 0.05,
        "{report:?}"
    );
    assert!(
        (report.within_95_mm - 0.0392).abs() < 0.0392 * 0.08,
        "{report:?}"
    );
}

#[test]
fn a_rig_that_has_moved_shows_with_the_sign_of_the_move() {
    for shift_mm in [-0.015, 0.015] {
        let report = counted(1000, 1.0, shift_mm);
        assert_eq!(report.verdict(), Verdict::Shifted);
        assert!((report.mean_signed_mm - shift_mm).abs() < 0.003);
        let side = if shift_mm < 0.0 { "below" } else { "above" };
        let words = report.to_string();
        assert!(
            words.contains("no longer fits") && words.contains(side),
            "{words}"
        );
    }
}

#[test]
fn coarse_pixels_and_wrong_matches_are_no_move() {
    assert_eq!(counted(1000, 2.0, 0.0).verdict(), Verdict::Scattered);
    // One match in ten wrong, all to the same side.
    let mut random = SplitMix(6);
    let mut health = Health::new();
    for k in 0..2000 {
        let gap_mm = if k % 10 == 0 {
            5.0
        } else {
            0.02 * normal(&mut random)
        };
        health.note(&measurement(gap_mm, Some(0.02)));
    }
    assert_eq!(health.report().unwrap().verdict(), Verdict::Scattered);
}

#[test]
fn without_enough_to_go_by_it_says_so() {
    assert_eq!(Health::new().report(), None);
    assert_eq!(
        counted(MIN_POINTS - 1, 1.0, 0.0).verdict(),
        Verdict::TooFewPoints
    );
    let mut health = Health::new();
    for sigma_mm in [None, Some(0.0), Some(f32::NAN)] {
        health.note(&measurement(0.02, sigma_mm));
    }
    // A gap that is no number is no point.
    health.note(&measurement(f32::NAN, Some(0.02)));
    let report = health.report().unwrap();
    assert_eq!((report.points, report.predicted), (3, None));
    assert_eq!(report.verdict(), Verdict::NothingPredicted);
}

#[test]
fn what_was_long_ago_is_forgotten() {
    let mut health = Health::new();
    for _ in 0..FORGET_AT {
        health.note(&measurement(0.1, Some(0.02)));
    }
    assert_eq!(health.report().unwrap().verdict(), Verdict::Shifted);
    let mut random = SplitMix(7);
    for _ in 0..4 * FORGET_AT {
        health.note(&measurement(0.02 * normal(&mut random), Some(0.02)));
    }
    let report = health.report().unwrap();
    assert_eq!(report.verdict(), Verdict::Fits, "{report}");
    assert!(report.points <= FORGET_AT);
}
