//! Recordings that leave the lens open: the estimate is as good as a pinhole with five numbers of
//! distortion, where the lenses are such.

use crate::common::against_truth::observations;
use crate::weak_rigs::{Boards, USUAL, matches, scene};
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::{Alternative, estimate_screened};
use calib_estimate::pinhole::{RigSettings, calibrate_rig};
use calib_rays::geometry::best_placement;
use nalgebra::Vector3;

const FRONTAL: Boards = Boards {
    tilt_deg: 2.0,
    depth: [1.0, 1.0],
    ..USUAL
};
const DRAWS: u64 = 4;
/// On a board that is known to be flat the two differ by weak priors and the weights of corners: a few
/// percent, by a fifth of a standard deviation in a single draw.
const FLAT_MM: f64 = 1e-3;
const MOST: f64 = 1.2;

#[test]
fn frontal_boards_at_one_distance_cost_what_they_cost_a_pinhole() {
    let (mut ours, mut theirs) = (0.0, 0.0);
    for seed in 1..=DRAWS {
        let scene = scene(&FRONTAL, seed).unwrap();
        let corners = observations(&scene, &scene.observe_corners()).with_flatness(Some(FLAT_MM));
        let (estimate, _) = estimate_screened(&corners, start_rig(&corners).unwrap()).unwrap();
        let is_pinhole = estimate
            .choices
            .iter()
            .any(|choice| choice.tried == Alternative::Pinhole && choice.taken);
        assert!(is_pinhole, "{:?}", estimate.choices);
        let rig = estimate.rig(&["left", "right"].map(str::to_owned));
        let pinhole = calibrate_rig(&corners, &RigSettings::default()).unwrap();
        let (mut truth, mut by_us, mut by_them) = (Vec::new(), Vec::new(), Vec::new());
        for (point, [a, b]) in matches(&scene, [0.85, 1.15], 200) {
            let pair = [(0, a), (1, b)];
            if let (Ok(x), Ok(y)) = (rig.triangulate(&pair), pinhole.triangulate(&pair)) {
                truth.push(point);
                by_us.push(x.point_mm);
                by_them.push(y.point_mm);
            }
        }
        ours += squared(&by_us, &truth);
        theirs += squared(&by_them, &truth);
    }
    let ratio = (ours / theirs).sqrt();
    assert!(ratio < MOST, "{ratio}");
}

fn squared(points: &[Vector3<f64>], truth: &[Vector3<f64>]) -> f64 {
    let placement = best_placement(points, truth).unwrap();
    let errors = points.iter().zip(truth);
    let squares = errors.map(|(p, t)| (placement.point(p) - t).norm_squared());
    squares.sum::<f64>() / points.len() as f64
}
