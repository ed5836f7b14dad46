//! The check of two halves of a scene's poses.

use super::against_truth::run_views;
use calib_estimate::joint::Estimate;
use calib_judge::half_data::{HalfData, HalfDataCheck, first_halves};
use calib_judge::{CrossChecks, cross_check};
use calib_rays::observed::View;
use calib_simulate::{OpticsKind, Scene, SceneSettings};

pub fn names() -> [String; 2] {
    ["left".to_owned(), "right".to_owned()]
}

/// All checks of an estimate of some of a scene's cameras.
pub fn checked(scene: &Scene, estimate: &Estimate) -> CrossChecks {
    let halves = first_halves(&estimate.observations, |pose| {
        scene.pose_placements.get(pose).copied()
    });
    let names = &names()[..scene.cameras.len()];
    cross_check(estimate, &estimate.rig(names), &halves)
}

/// The halves of what the cameras record.
pub fn halves_of(scene: &Scene, views: &[View]) -> HalfData {
    let (estimate, _) = run_views(scene, views);
    match checked(scene, &estimate).half_data {
        HalfDataCheck::Compared(halves) => halves,
        HalfDataCheck::Skipped(reason) => panic!("{reason:?}"),
    }
}

/// The halves of a plain rig's left camera alone.
pub fn halves_of_one_camera(seed: u64) -> HalfData {
    let mut scene = Scene::new(SceneSettings::standard_noisy(OpticsKind::Brown, seed)).unwrap();
    let mut views = scene.observe_corners();
    views.retain(|view| view.camera_idx == 0);
    scene.cameras.truncate(1);
    halves_of(&scene, &views)
}
