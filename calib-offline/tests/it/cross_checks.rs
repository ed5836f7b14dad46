//! The checks of a calibration against itself: right where the simulation is what the model says,
//! and telling where it is not.

use crate::common::against_truth::{run_scene, run_views, scene};
use crate::common::halves::{checked, halves_of_one_camera, names};
use crate::common::standard::standard;
use calib_judge::central_model::CentralModel;
use calib_judge::cross_check;
use calib_judge::half_data::{HalfDataCheck, Skipped};
use calib_judge::working_volume::{Match, compare, matches_at, span};
use calib_rays::field::Rig;
use calib_rays::geometry::best_placement;
use calib_rays::geometry::{Ray, nearest_point, triangulate_pair};
use calib_simulate::{OpticsKind, Scene};

/// Noise draws per kind of optics.
const SEEDS: u64 = 4;

#[test]
fn halves_differ_as_predicted() {
    for optics in [OpticsKind::Brown, OpticsKind::Port] {
        let (mut squares, mut variance) = (0.0, 0.0);
        for seed in 1..=SEEDS {
            let halves = standard(optics, seed).halves();
            squares += halves.ratio.powi(2) / SEEDS as f64;
            variance += 2.0 / halves.modes / (SEEDS * SEEDS) as f64;
        }
        // The mean square is that of chi-square variables: three standard deviations.
        assert!(
            (squares - 1.0).abs() < 3.0 * f64::sqrt(variance),
            "{optics:?}: {squares} +- {}",
            variance.sqrt()
        );
    }
}

#[test]
fn a_camera_that_changes_between_poses_is_seen() {
    let scene = scene(OpticsKind::Brown, |_| ());
    let mut views = scene.observe_corners();
    // In every other pose the focus is 0.02 % longer: 0.1 px at the edge of the image, so that the
    // residuals hardly grow.
    let [width, height] = [scene.settings.sensor.width, scene.settings.sensor.height];
    for view in views.iter_mut().filter(|view| view.pose % 2 == 1) {
        for corner in &mut view.corners {
            corner.pixel.u += 2e-4 * (corner.pixel.u - f64::from(width) / 2.0);
            corner.pixel.v += 2e-4 * (corner.pixel.v - f64::from(height) / 2.0);
        }
    }
    let (estimate, findings) = run_views(&scene, &views);
    assert_eq!(findings, []);
    assert!(estimate.noise.variance_px2.sqrt() < 1.1 * scene.settings.noise_px);
    let HalfDataCheck::Compared(halves) = checked(&scene, &estimate).half_data else {
        panic!("its poses make two halves");
    };
    // Points differ in scale by 0.02 % of the calibrated volume's size, a multiple of the noise.
    assert!(halves.is_larger() && halves.ratio > 3.0, "{halves:?}");
}

#[test]
fn few_poses_are_not_halved() {
    let few = scene(OpticsKind::Brown, |s| {
        s.angles_deg = vec![-30.0, -10.0, 10.0, 30.0];
    });
    let (estimate, _) = run_scene(&few);
    assert_eq!(
        checked(&few, &estimate).half_data,
        HalfDataCheck::Skipped(Skipped::TooFewPoses { have: 8, need: 10 })
    );
    let unasked = cross_check(&estimate, &estimate.rig(&names()), &[]);
    assert_eq!(
        unasked.half_data,
        HalfDataCheck::Skipped(Skipped::NotWanted)
    );
}

#[test]
fn rays_of_a_camera_alone_differ_as_predicted() {
    let (mut squares, mut variance) = (0.0, 0.0);
    for seed in 1..=SEEDS {
        let halves = halves_of_one_camera(seed);
        squares += halves.ratio.powi(2) / SEEDS as f64;
        variance += 2.0 / halves.modes / (SEEDS * SEEDS) as f64;
    }
    // As for two cameras.
    assert!(
        (squares - 1.0).abs() < 3.0 * f64::sqrt(variance),
        "{squares} +- {}",
        variance.sqrt()
    );
}

/// RMS distance of the points of matches from where the true rays of their pixels meet, a rigid
/// motion apart, mm.
fn error_mm(scene: &Scene, rig: &Rig, matches: &[Match]) -> f64 {
    let (measured, truth): (Vec<_>, Vec<_>) = matches
        .iter()
        .filter_map(|pair| {
            let [a, b] = pair.map(|(camera, pixel)| scene.true_ray_in_left(camera, pixel));
            let truth = triangulate_pair(&a?, &b?).ok()?.point_mm;
            Some((rig.triangulate(pair).ok()?.point_mm, truth))
        })
        .unzip();
    let placement = best_placement(&measured, &truth).unwrap();
    let squares = measured
        .iter()
        .zip(&truth)
        .map(|(p, q)| (placement.point(p) - q).norm_squared());
    (squares.sum::<f64>() / measured.len() as f64).sqrt()
}

#[test]
fn centrality_and_the_cost_of_a_central_model_are_the_true_ones() {
    let found = standard(OpticsKind::Port, 1);
    let (scene, estimate, checks) = (&found.scene, &found.estimate, found.checks());
    let rig = estimate.rig(&names());
    for (k, found) in checks.centrality.iter().enumerate() {
        let rays: Vec<Ray> = rig.cameras[k]
            .coverage
            .covered_middles()
            .into_iter()
            .map(|pixel| scene.cameras[k].ray(pixel).unwrap())
            .collect();
        let center = nearest_point(&rays).unwrap();
        let squares = rays.iter().map(|ray| ray.distance_mm(&center).powi(2));
        let true_rms_mm = (squares.sum::<f64>() / rays.len() as f64).sqrt();
        let [a, b] = found.halves_rms_mm.unwrap();
        // The halves scatter by sqrt(2) more than the whole; three standard deviations, and a
        // hundredth where both happen to agree.
        let sd_mm = (a - b).abs() / 2.0 + 0.01 * true_rms_mm;
        assert!(
            (found.rms_mm - true_rms_mm).abs() < 3.0 * sd_mm,
            "{found:?}, true {true_rms_mm}"
        );
    }
    let CentralModel::Costs {
        evidence_loss,
        points: Some(points),
    } = &checks.central_model
    else {
        panic!("{:?}", checks.central_model);
    };
    let central = estimate.made_central().unwrap();
    let matches = matches_at(&rig, &span(&estimate.board_distances_mm(&rig)));
    let central_mm = error_mm(scene, &central.estimate.rig(&names()), &matches);
    let own_mm = error_mm(scene, &rig, &matches);
    // What the data say that a central model costs is what it truly costs, but for the rig's own
    // error: both are distances from the same points.
    assert!(*evidence_loss > 100.0);
    assert!(own_mm < 0.3 * central_mm, "{own_mm}, {central_mm}");
    assert!(
        (points.rms_mm - central_mm).abs() < own_mm,
        "{points:?}, {central_mm}, {own_mm}"
    );
    // A rig compared with itself does not differ.
    assert!(compare(&rig, &rig, &matches).unwrap().difference.max_mm < 1e-9);
}

#[test]
fn a_central_rig_loses_nothing_by_being_central() {
    let checks = standard(OpticsKind::Brown, 1).checks();
    let CentralModel::IsCentral {
        offsets_gain: Some(gain),
    } = checks.central_model
    else {
        panic!("{:?}", checks.central_model);
    };
    assert!(gain < calib_estimate::joint::choice::NEEDED_GAIN);
    assert!(
        checks
            .centrality
            .iter()
            .all(|c| c.central && c.rms_mm == 0.0)
    );
}
