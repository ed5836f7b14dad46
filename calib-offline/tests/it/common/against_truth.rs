//! Estimates of simulated scenes judged against their truth.

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::init::screening::{Finding, FindingKind};
use calib_estimate::joint::{Estimate, estimate_screened};
use calib_judge::known_points::{PointWithTruth, TruthErrors, compare_with_truth};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, RigidTransform, best_placement, so3};
use calib_rays::measure::{PointSource, RigSource};
use calib_rays::observed::View;
use calib_simulate::{CameraOptics, MatchSet, OpticsKind, Scene, SceneSettings, TrueMatch};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Points that each comparison measures, unless it says otherwise.
pub const MATCHES: usize = 3000;
/// Of the cameras, as nothing else names them.
const NAMES: [&str; 2] = ["left", "right"];
/// Quantiles of a chi-square variable of 3 degrees of freedom at 68 % and 95 %.
const CHI_SQUARE_68: f64 = 3.5059;
const CHI_SQUARE_95: f64 = 7.8147;

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
        settings.board = BoardSpec::chessboard(7, 10, 14.0);
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
    Observations::new(scene.settings.board.clone(), sensors, views)
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
    let (mut points, mut outside) = (Vec::new(), 0);
    for set in [MatchSet::Points, MatchSet::Holdout] {
        let (measured, left_out) = measured_points(scene, estimate, set, noisy);
        points.extend(measured);
        outside += left_out;
    }
    let errors = compare_with_truth(&points).unwrap();
    Measured {
        error_mm: errors.placed_rms_mm,
        ratio: errors.placed_ratio,
        outside,
    }
}

/// Errors of one set of matches with noisy pixels, and the share that was not measured.
pub fn measure_set(scene: &Scene, estimate: &Estimate, set: MatchSet) -> (TruthErrors, f64) {
    let rig = estimate.rig(&NAMES.map(str::to_owned));
    let source = RigSource::new(&rig, None).unwrap();
    let (errors, share) = errors_and_share(&source, &scene.matches(set, MATCHES)).unwrap();
    (errors, 1.0 - share)
}

fn measured_points(
    scene: &Scene,
    estimate: &Estimate,
    set: MatchSet,
    noisy: bool,
) -> (Vec<PointWithTruth>, usize) {
    let rig = estimate.rig(&NAMES.map(str::to_owned));
    let matches = scene.matches(set, MATCHES);
    let pixels: fn(&TrueMatch) -> &[PixelPoint] = if noisy {
        |m| &m.pixels
    } else {
        |m| &m.true_pixels
    };
    let source = RigSource::new(&rig, None).unwrap();
    let points = points_with_truth(&source, &matches, pixels);
    let outside = matches.len() - points.len();
    (points, outside)
}

/// Points of the matches that can be measured, beside their truth.
pub fn points_with_truth(
    source: &dyn PointSource<Number = f64>,
    matches: &[TrueMatch],
    pixels: fn(&TrueMatch) -> &[PixelPoint],
) -> Vec<PointWithTruth> {
    matches
        .iter()
        .filter_map(|m| {
            let pixels = pixels(m).iter().enumerate();
            let sightings: Vec<_> = pixels.map(|(k, p)| (k, [p.u, p.v])).collect();
            Some(PointWithTruth {
                measured_mm: source.point(&sightings).ok()?.point_mm.into(),
                true_mm: m.point_in_datum,
                oracle_mm: m.oracle_in_datum,
            })
        })
        .collect()
}

/// Errors of matches with noisy pixels, and the share that was measured; `None` if that is nothing
/// to speak of.
pub fn errors_and_share(
    source: &dyn PointSource<Number = f64>,
    matches: &[TrueMatch],
) -> Option<(TruthErrors, f64)> {
    let points = points_with_truth(source, matches, |m| &m.pixels);
    let share = points.len() as f64 / matches.len() as f64;
    Some((compare_with_truth(&points)?, share))
}

/// How often errors lie inside their predicted ellipsoids.
#[derive(Debug, Clone, Copy)]
pub struct Coverage {
    /// Share of errors inside the ellipsoid of 68 %, with the noise of pixels.
    pub within_68: f64,
    /// The same of 95 %.
    pub within_95: f64,
    /// Squared errors with exact pixels over the calibration's part of what is predicted for the
    /// same points, their own best placement taken out of both; both summed.
    pub calibration_squared: f64,
}

/// Points whose joint covariance is compared with their errors.
const JOINT_MATCHES: usize = 150;

/// Measures matches and compares their errors with what was predicted. The uncertainty is that of
/// shape: a rigid motion of the whole rig is taken out.
pub fn coverage(scene: &Scene, estimate: &mut Estimate, set: MatchSet) -> Coverage {
    let mut rig = estimate.rig(&NAMES.map(str::to_owned));
    estimate.fill_uncertainty(&mut rig).unwrap();
    let matches = scene.matches(set, MATCHES);
    let noisy: Vec<(Vector3<f64>, _)> = {
        let measured: Vec<(Vector3<f64>, Vector3<f64>, _)> = matches
            .iter()
            .filter_map(|m| {
                let pair = [(0, m.pixels[0]), (1, m.pixels[1])];
                let point = rig.triangulate(&pair).ok()?.point_mm;
                Some((point, m.point_in_datum, rig.pair_covariance(pair)?))
            })
            .collect();
        let (from, to): (Vec<_>, Vec<_>) = measured.iter().map(|m| (m.0, m.1)).unzip();
        let placement = best_placement(&from, &to).unwrap();
        measured
            .into_iter()
            .map(|(point, truth, covariance)| (placement.point(&point) - truth, covariance))
            .collect()
    };
    let share_within = |limit: f64| {
        let within = noisy.iter().filter(|(error, covariance)| {
            let inverse = covariance.total_mm2().try_inverse().unwrap();
            error.dot(&(inverse * error)) < limit
        });
        within.count() as f64 / noisy.len() as f64
    };
    let within = [CHI_SQUARE_68, CHI_SQUARE_95].map(share_within);
    let (pairs, truth): (Vec<_>, Vec<_>) = matches
        .iter()
        .map(|m| {
            (
                [(0, m.true_pixels[0]), (1, m.true_pixels[1])],
                m.point_in_datum,
            )
        })
        .filter(|(pair, _)| rig.triangulate(pair).is_ok())
        .take(JOINT_MATCHES)
        .unzip();
    let exact: Vec<Vector3<f64>> = pairs
        .iter()
        .map(|pair| rig.triangulate(pair).unwrap().point_mm)
        .collect();
    let placement = best_placement(&exact, &truth).unwrap();
    let squared: f64 = exact
        .iter()
        .zip(&truth)
        .map(|(point, truth)| (placement.point(point) - truth).norm_squared())
        .sum();
    let predicted = estimate.point_covariance(&rig, &pairs).unwrap().unwrap();
    Coverage {
        within_68: within[0],
        within_95: within[1],
        calibration_squared: squared / predicted.trace(),
    }
}
