//! The baseline on simulated corners.

use super::adjustment::{Loss, Settings};
use super::{PinholeError, PinholeRig, Refine, RigSettings, calibrate_camera, calibrate_rig};
use crate::adjust::Observations;
use crate::init::InitError;
use crate::reprojection::residuals;
use calib_rays::board::BoardShape;
use calib_rays::geometry::{RigidTransform, so3};
use calib_rays::numerics::levenberg::StopReason;
use calib_simulate::optics::{Distortion, Lens};
use calib_simulate::{CameraOptics, OpticsKind, Scene, SceneSettings};

fn scene(change: impl FnOnce(&mut SceneSettings)) -> Scene {
    let mut settings = SceneSettings::standard_noisy(OpticsKind::Brown, 3);
    // A board small enough for quick tests.
    settings.board.rows = 7;
    settings.board.cols = 6;
    settings.board.square_mm = 22.0;
    settings.angles_deg = (-3..=3).map(|k| f64::from(k) * 13.0).collect();
    change(&mut settings);
    Scene::new(settings).unwrap()
}

fn observations(scene: &Scene) -> Observations {
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    Observations::new(
        scene.settings.board.clone(),
        sensors,
        &scene.observe_corners(),
    )
}

/// `fx, fy, cx, cy, k1, k2, p1, p2, k3` of a scene's camera.
fn true_intrinsics(scene: &Scene, camera_idx: usize) -> [f64; 9] {
    let Lens::Perspective(lens) = scene.cameras[camera_idx].lens() else {
        panic!("not a perspective lens");
    };
    let Distortion::Brown { k1, k2, k3, p1, p2 } = lens.distortion else {
        panic!("not Brown's distortion");
    };
    let [fx, fy] = lens.focal_px;
    let center = lens.principal;
    [fx, fy, center.u, center.v, k1, k2, p1, p2, k3]
}

#[test]
fn exact_corners_give_the_exact_camera_from_every_start() {
    let scene = scene(|settings| settings.noise_px = 0.0);
    let rig = calibrate_rig(&observations(&scene), &RigSettings::default()).unwrap();
    for (camera_idx, fit) in rig.fits.iter().enumerate() {
        let truth = true_intrinsics(&scene, camera_idx);
        for (found, truth) in fit.camera.intrinsics().iter().zip(truth) {
            assert!(
                (found - truth).abs() < 1e-6 * truth.abs().max(0.01),
                "{found} {truth}"
            );
        }
        assert!(fit.rms_px < 1e-8);
        assert_eq!(fit.starts.len(), 3);
        for start in &fit.starts {
            assert!(start.cost_px2.unwrap() < 1e-12, "{start:?}");
        }
    }
    for (pose, truth) in rig.first_from_board.iter().zip(&scene.true_poses) {
        let pose = pose.unwrap();
        assert!((pose.translation_mm - truth.translation_mm).norm() < 1e-6);
        assert!((pose.rotation - truth.rotation).norm() < 1e-8);
    }
    let left_from_right = rig.camera_from_first[1].inverse();
    assert!(
        (left_from_right.translation_mm - scene.left_from_camera[1].translation_mm).norm() < 1e-6
    );
}

#[test]
fn errors_are_as_large_as_the_standard_deviations_say() {
    let mut squared = 0.0;
    let mut count = 0;
    for seed in 1..=6 {
        let scene = scene(|settings| settings.seed = seed);
        let observations = observations(&scene);
        for camera_idx in 0..2 {
            let fit = calibrate_camera(&observations, camera_idx, &Settings::default()).unwrap();
            assert_eq!(fit.stop, StopReason::Converged);
            // 2 x 0.05^2 px^2 per corner, less the share of the parameters.
            assert!(
                (fit.rms_px / (0.05 * 2f64.sqrt()) - 1.0).abs() < 0.1,
                "{}",
                fit.rms_px
            );
            let truth = true_intrinsics(&scene, camera_idx);
            let deviations = fit.standard_deviations.unwrap();
            for ((found, truth), deviation) in
                fit.camera.intrinsics().iter().zip(truth).zip(deviations)
            {
                squared += ((found - truth) / deviation).powi(2);
                count += 1;
            }
        }
    }
    // Nine numbers that go together count like some three: 12 fits x 3, +- 4 sigma of the mean of
    // 36 squares.
    let mean = squared / f64::from(count);
    assert!((0.3..2.0).contains(&mean), "{mean}");
}

/// Angle (rad) and distance (mm) of the second camera from where it is.
fn misplaced(scene: &Scene, rig: &PinholeRig) -> (f64, f64) {
    let found = rig.camera_from_first[1].inverse();
    let truth = scene.left_from_camera[1];
    (
        so3::angle_rad(&(found.rotation.transpose() * truth.rotation)),
        (found.translation_mm - truth.translation_mm).norm(),
    )
}

#[test]
fn a_pose_seen_by_one_camera_only_is_placed_in_the_rig() {
    let scene = scene(|_| ());
    let mut seen = observations(&scene);
    // Each camera misses one pose; one pose has too few corners in both.
    seen.views
        .retain(|v| (v.camera_idx, v.pose_idx) != (0, 2) && (v.camera_idx, v.pose_idx) != (1, 5));
    for view in seen.views.iter_mut().filter(|view| view.pose_idx == 7) {
        view.corners.truncate(5);
    }
    for refine in [Refine::Extrinsics, Refine::Everything] {
        let settings = RigSettings {
            refine,
            ..RigSettings::default()
        };
        let rig = calibrate_rig(&seen, &settings).unwrap();
        assert!(rig.fits[0].camera_from_board[2].is_none());
        assert!(rig.first_from_board[7].is_none());
        for pose in [2, 5] {
            let found = rig.first_from_board[pose].unwrap();
            let off_mm = (found.translation_mm - scene.true_poses[pose].translation_mm).norm();
            // 0.05 px of 42 corners at 350 mm; a principal point off by a pixel shifts by 0.17 mm.
            assert!(off_mm < 1.0, "{off_mm}");
        }
        let (angle_rad, distance_mm) = misplaced(&scene, &rig);
        assert!(
            angle_rad < 2e-3 && distance_mm < 1.0,
            "{angle_rad} {distance_mm}"
        );
    }
}

#[test]
fn robust_weights_leave_outliers_out() {
    let scene = scene(|settings| settings.outlier_share = 0.05);
    let observations = observations(&scene);
    let rms = |loss| {
        let settings = Settings {
            loss,
            ..Settings::default()
        };
        let fit = calibrate_camera(&observations, 0, &settings).unwrap();
        (fit.rms_px, fit.corner_count)
    };
    let (plain_px, all) = rms(Loss::LeastSquares);
    let (robust_px, kept) = rms(Loss::StudentT);
    // 5 % of corners 3 to 10 px off: 1.5 px RMS; without them 0.05 x sqrt 2, save those near the limit.
    assert!(plain_px > 1.0 && robust_px < 0.1, "{plain_px} {robust_px}");
    assert_eq!(all, observations.of_camera(0).corner_count());
    assert!(kept < all && kept as f64 > 0.9 * all as f64);
}

#[test]
fn what_cannot_be_calibrated_is_refused_with_facts() {
    let scene = scene(|_| ());
    let all = observations(&scene);
    let settings = RigSettings::default();
    let few = all.with_pose_indices(|idx| idx < 2);
    assert_eq!(
        calibrate_rig(&few, &settings).unwrap_err(),
        PinholeError::Init(InitError::TooFewPoses {
            camera_idx: 0,
            have: 2
        })
    );
    let mut apart = all.clone();
    apart
        .views
        .retain(|view| (view.camera_idx == 0) == (view.pose_idx < 7));
    assert_eq!(
        calibrate_rig(&apart, &settings).unwrap_err(),
        PinholeError::Init(InitError::NoCommonPose { camera_idx: 1 })
    );
    assert_eq!(
        calibrate_camera(&all, 2, &settings.adjustment).unwrap_err(),
        PinholeError::NoSuchCamera {
            camera_idx: 2,
            have: 2
        }
    );
}

#[test]
fn a_third_camera_is_placed_through_the_second() {
    let scene = scene(|settings| settings.noise_px = 0.0);
    let mut seen = observations(&scene);
    // The left camera again as a third one, sharing poses with the right one only.
    seen.sensors.push(seen.sensors[0]);
    let again: Vec<_> = seen
        .views
        .iter()
        .filter(|v| v.camera_idx == 0)
        .cloned()
        .collect();
    seen.views
        .retain(|view| view.camera_idx == 1 || view.pose_idx < 8);
    for mut view in again.into_iter().filter(|view| view.pose_idx >= 8) {
        view.camera_idx = 2;
        seen.views.push(view);
    }
    let rig = calibrate_rig(&seen, &RigSettings::default()).unwrap();
    assert!(rig.camera_from_first[2].translation_mm.norm() < 1e-5);
}

#[test]
fn as_ray_fields_the_cameras_measure_the_same_points() {
    let scene = scene(|_| ());
    let mut seen = observations(&scene);
    // The first pose is placed by nobody: the rig's frame is the second.
    for view in seen.views.iter_mut().filter(|view| view.pose_idx == 0) {
        view.corners.truncate(5);
    }
    let pinhole = calibrate_rig(&seen, &RigSettings::default()).unwrap();
    let found = pinhole.rig(&seen.numbered_cameras(), &seen).unwrap();
    assert!(found.worst_error_px < 1e-5, "{}", found.worst_error_px);
    assert_eq!(found.rig.datum_pose, 1);
    assert!(found.rig_from_board[0].is_none());
    let rig_from_first = pinhole.first_from_board[1].unwrap().inverse();
    let mut compared = 0;
    for view in seen.views.iter().filter(|v| v.camera_idx == 0) {
        for corner in &view.corners {
            let other = seen
                .views
                .iter()
                .find(|other| (other.camera_idx, other.pose_idx) == (1, view.pose_idx));
            let label = (corner.row, corner.col);
            let other = other.and_then(|o| o.corners.iter().find(|c| (c.row, c.col) == label));
            let Some(other) = other else { continue };
            let sightings = [(0, corner.pixel), (1, other.pixel)];
            let Ok(point) = found.rig.triangulate(&sightings) else {
                // Corners that took no part may lie outside.
                assert_eq!(view.pose_idx, 0);
                continue;
            };
            let exact = rig_from_first.point(&pinhole.triangulate(&sightings).unwrap().point_mm);
            // 1e-5 px at 350 mm and 900 px of focal length are 4e-6 mm, a few times that in depth.
            assert!((point.point_mm - exact).norm() < 2e-5);
            compared += 1;
        }
    }
    assert!(compared > 300, "{compared}");

    // The residuals of the fields are the adjustment's, to first order in residuals of 0.05 px.
    let poses: Vec<_> = found
        .rig_from_board
        .iter()
        .map(|p| p.unwrap_or_else(RigidTransform::identity))
        .collect();
    let residuals = residuals(&found.rig, &poses, &BoardShape::default(), &seen);
    let used = residuals
        .iter()
        .flatten()
        .zip(pinhole.is_used.iter().flatten());
    let squared: Vec<f64> = used
        .filter(|(_, used)| **used)
        .map(|(residual, _)| residual.unwrap().norm_squared())
        .collect();
    assert_eq!(squared.len(), pinhole.corner_count);
    let rms_px = (squared.iter().sum::<f64>() / squared.len() as f64).sqrt();
    assert!(
        (rms_px / pinhole.rms_px - 1.0).abs() < 1e-3,
        "{rms_px} {}",
        pinhole.rms_px
    );
}

#[test]
fn beyond_the_fold_nothing_is_calibrated() {
    let scene = scene(|_| ());
    let seen = observations(&scene);
    let mut pinhole = calibrate_rig(&seen, &RigSettings::default()).unwrap();
    let names = seen.numbered_cameras();
    let area = |rig: &PinholeRig| {
        let found = rig.rig(&names, &seen).unwrap();
        found.rig.cameras[0].coverage.covered_share()
    };
    let all = area(&pinhole);
    // r - r^3 / 3 s^2 rises up to r = s: with 3 k1 s^2 = -1 and s = 0.3 up to 0.2 focal lengths off.
    pinhole.cameras[0].distortion = [-1.0 / (3.0 * 0.09), 0.0, 0.0, 0.0, 0.0];
    let part = area(&pinhole);
    assert!(part > 0.0 && part < all, "{part} of {all}");
    // And none at all.
    pinhole.cameras[0].distortion = [f64::NAN; 5];
    assert_eq!(
        pinhole.rig(&names, &seen).unwrap_err(),
        PinholeError::NoRays { camera_idx: 0 }
    );
}
