//! A comparison for the tests of what is said of one.

use super::bootstrap::Ratio;
use super::record::{
    Comparison, HeldOutFigures, MethodFigures, Ratios, SCHEMA, Training, TruthFigures,
};
use calib_judge::known_points::TruthErrors;
use std::time::Duration;

fn method(method: &'static str, title: &'static str, factor: f64) -> MethodFigures {
    MethodFigures {
        method,
        title,
        failure: None,
        training: Some(Training {
            rms_px: 0.07 * factor,
            corners: 1000,
            rejected: 3,
        }),
        conversion_error_px: Some(0.0),
        failed_folds: Vec::new(),
        held_out: Some(HeldOutFigures {
            rms_px: Some(0.08 * factor),
            median_px: Some(0.05 * factor),
            neighbor_rms_percent: Some(0.3 * factor),
            neighbor_rms_mm: Some(0.03 * factor),
            rigid_rms_mm: Some(0.04 * factor),
            points: 500,
            unanswered: 7,
        }),
        against_first: None,
        truth: vec![TruthFigures {
            file: "matches.csv".to_owned(),
            unanswered: 2,
            errors: Some(TruthErrors {
                points: 300,
                direct_rms_mm: 0.05 * factor,
                placed_rms_mm: 0.04 * factor,
                oracle_rms_mm: 0.02,
                direct_ratio: 2.5 * factor,
                placed_ratio: 2.0 * factor,
            }),
        }],
        time: Duration::from_secs(3),
    }
}

/// Two methods, the second with half the errors of the first.
pub fn example() -> Comparison {
    let ratio = Some(Ratio {
        ratio: 0.5,
        low: 0.45,
        high: 0.55,
        boards: 20,
    });
    let mut better = method("joint", "ray field, joint", 0.5);
    better.against_first = Some(Ratios {
        residual: ratio,
        neighbor: ratio,
        rigid: ratio,
    });
    Comparison {
        schema: SCHEMA,
        tool_version: "0",
        input_sha256: String::new(),
        square_mm: 10.0,
        working_distance_mm: Some(380.0),
        poses: 20,
        views: 40,
        corners: 1003,
        outliers: 0,
        folds: 5,
        held_out_corners: 1003,
        common_corners: 990,
        boards: 20,
        methods: vec![method("baseline", "pinhole", 1.0), better],
        conclusion: vec!["In words.".to_owned()],
    }
}
