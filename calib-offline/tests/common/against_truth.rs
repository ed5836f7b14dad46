//! Estimates of simulated scenes judged against their truth.

use calib_offline::adjust::Observations;
use calib_offline::board::BoardSpec;
use calib_offline::dataset::View;
use calib_offline::evaluate::measured_board::best_placement;
use calib_offline::geometry::{RigidTransform, so3};
use calib_offline::init::rig::start_rig;
use calib_offline::init::screening::{Finding, FindingKind};
use calib_offline::joint::{Estimate, estimate_screened};
use calib_offline::simulate::{CameraOptics, MatchSet, OpticsKind, Scene, SceneSettings};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Points that each comparison measures.
const MATCHES: usize = 3000;

/// The standard dataset of a rig with 0.05 px of noise, changed.
pub fn scene(optics: OpticsKind, change: impl FnOnce(&mut SceneSettings)) -> Scene {
    let mut settings = SceneSettings::standard_noisy(optics, 1);
    change(&mut settings);
    Scene::new(settings).unwrap()
}

/// A board in the hand before a pinhole rig: tilts to 35 degrees, any place in the image, and
/// distances from 0.75 to 1.4 of the rig's.
pub fn hand_held(poses: usize, seed: u64) -> Scene {
    let mut scene = scene(OpticsKind::Brown, |settings| {
        settings.placements = 1;
        settings.angles_deg = vec![0.0; poses];
        settings.seed = seed;
        settings.board = BoardSpec {
            rows: 7,
            cols: 10,
            square_mm: 14.0,
        };
    });
    let middle_in_board = scene.settings.board.center_in_board();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for pose in &mut scene.true_poses {
        let mut draw = |low: f64, high: f64| rng.random_range(low..high);
        let middle = pose.point(&middle_in_board);
        let tilt = Vector3::new(draw(-0.6, 0.6), draw(-0.6, 0.6), draw(-0.8, 0.8));
        let place = Vector3::new(
            middle.x + 0.1 * middle.z * draw(-1.0, 1.0),
            middle.y + 0.1 * middle.z * draw(-1.0, 1.0),
            middle.z * draw(0.75, 1.4),
        );
        let rotation = so3::exp(&tilt) * pose.rotation;
        *pose = RigidTransform::new(rotation, place - rotation * middle_in_board);
    }
    scene
}

/// The corners of a scene, arranged.
pub fn observations(scene: &Scene, views: &[View]) -> Observations {
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    Observations::new(scene.settings.board, sensors, views)
}

/// The whole way from corners to the screened estimate.
pub fn run_views(scene: &Scene, views: &[View]) -> (Estimate, Vec<Finding>) {
    let observations = observations(scene, views);
    let start = start_rig(&observations).unwrap();
    estimate_screened(&observations, start).unwrap()
}

/// [`run_views`] of what the scene's cameras record.
pub fn run_scene(scene: &Scene) -> (Estimate, Vec<Finding>) {
    run_views(scene, &scene.observe_corners())
}

/// (camera, pose) of the views that were renumbered, split off and left out.
#[derive(Debug, PartialEq, Default)]
pub struct Named {
    pub renumbered: Vec<(usize, usize)>,
    pub unsynchronized: Vec<(usize, usize)>,
    pub misfits: Vec<(usize, usize)>,
}

pub fn named(findings: &[Finding]) -> Named {
    let mut named = Named::default();
    for finding in findings {
        let list = match finding.kind {
            FindingKind::Renumbered { .. } => &mut named.renumbered,
            FindingKind::Unsynchronized { .. } => &mut named.unsynchronized,
            FindingKind::Misfit { .. } => &mut named.misfits,
        };
        list.push((finding.camera_idx, finding.pose));
    }
    named
}

/// What measuring with an estimate gave, both sets of matches together.
#[derive(Debug)]
pub struct Measured {
    /// RMS error after the best rigid placement, mm.
    pub error_mm: f64,
    /// The same over what the true rays of the same pixels give.
    pub ratio: f64,
    /// Matches outside the calibrated area.
    pub outside: usize,
}

/// Measures random points and held-out boards; with noisy pixels or with exact ones.
pub fn measure(scene: &Scene, estimate: &Estimate, noisy: bool) -> Measured {
    let rig = estimate.rig(&["left".to_owned(), "right".to_owned()]);
    let (mut measured, mut truth, mut limit, mut outside) = (vec![], vec![], 0.0, 0);
    for set in [MatchSet::Points, MatchSet::Holdout] {
        for m in scene.matches(set, MATCHES) {
            let pixels = if noisy { &m.pixels } else { &m.true_pixels };
            match rig.triangulate(&[(0, pixels[0]), (1, pixels[1])]) {
                Ok(point) => {
                    measured.push(point.point_mm);
                    truth.push(m.point_in_datum);
                    limit += (m.oracle_in_datum - m.point_in_datum).norm_squared();
                }
                Err(_) => outside += 1,
            }
        }
    }
    let placement = best_placement(&measured, &truth).unwrap();
    let squared: f64 = measured
        .iter()
        .zip(&truth)
        .map(|(p, q)| (placement.point(p) - q).norm_squared())
        .sum();
    Measured {
        error_mm: (squared / measured.len() as f64).sqrt(),
        ratio: (squared / limit).sqrt(),
        outside,
    }
}
