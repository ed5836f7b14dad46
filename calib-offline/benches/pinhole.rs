//! The baseline (Zhang, Brown-Conrady, stereo extrinsics) on simulated scenes: how near it comes to
//! the oracle, with the intrinsics as each camera alone has them and with everything adjusted
//! together, and what it costs.
//!
//! `cargo bench -p calib-offline --bench pinhole -- [OPTICS ...] [--draws N]`. The oracle
//! triangulates the same noisy pixels with the true rays; 1 is the limit that their noise sets.

#[allow(dead_code, reason = "other benches use the rest")]
mod common;

use calib_estimate::adjust::Observations;
use calib_estimate::init::focal_scan::start_camera;
use calib_estimate::pinhole::adjustment::{Free, State, minimize};
use calib_estimate::pinhole::{
    BrownCamera, Loss, PinholeRig, Refine, RigSettings, Settings, calibrate_rig, stereo,
};
use calib_rays::geometry::RigidTransform;
use calib_simulate::{MatchSet, OpticsKind, Scene, SceneSettings};
use common::against_truth::{MATCHES, errors_and_share, observations};
use common::{Arguments, Result, print_table};
use std::process::ExitCode;
use std::time::Instant;

const OPTICS: [OpticsKind; 5] = [
    OpticsKind::Brown,
    OpticsKind::Paper,
    OpticsKind::Bumps,
    OpticsKind::Window,
    OpticsKind::Port,
];

fn main() -> ExitCode {
    print_table(table)
}

fn table(arguments: &Arguments) -> Result<()> {
    let draws = arguments.draws;
    println!(
        "{draws} draws each. RMS error over the oracle's after the best rigid placement: points | held-out \
         boards;\nof two cameras per draw, how many reached their lowest minimum from each start: conic, fixed \
         center, focal\nscan; wall seconds of the whole rig, and of one adjustment of one camera\n"
    );
    println!(
        "{:<11} {:>17} {:>17} {:>17} {:>8} {:>10} {:>7} {:>7}",
        "", "extrinsics only", "everything", "Student-t", "RMS px", "starts", "rig s", "fit s"
    );
    for optics in arguments.optics(&OPTICS)? {
        let drawn = arguments.drawn(optics.name(), |seed| draw(optics, seed))?;
        print(optics, &drawn);
    }
    Ok(())
}

/// What a draw gave.
struct Drawn {
    /// (points, held-out boards): extrinsics only, everything, everything with robust weights.
    ratios: [(f64, f64); 3],
    rms_px: f64,
    /// Cameras whose lowest minimum a start reached, of two: conic, fixed center, focal scan.
    reached: [usize; 3],
    /// Of the whole rig, starts included.
    seconds: f64,
    fit_seconds: f64,
}

fn draw(optics: OpticsKind, seed: u64) -> Result<Drawn> {
    let scene = Scene::new(SceneSettings::standard_noisy(optics, seed))?;
    let observations = observations(&scene, &scene.observe_corners());
    let fit_seconds = fit_seconds(&observations.of_camera(0))?;
    let started = Instant::now();
    let everything = calibrate_rig(&observations, &RigSettings::default())?;
    let seconds = started.elapsed().as_secs_f64();
    let extrinsics = stereo::join(
        &observations,
        everything.fits.clone(),
        &RigSettings {
            refine: Refine::Extrinsics,
            ..RigSettings::default()
        },
    )?;
    let robust = calibrate_rig(
        &observations,
        &RigSettings {
            adjustment: Settings {
                loss: Loss::StudentT,
                ..Settings::default()
            },
            ..RigSettings::default()
        },
    )?;
    let sets = [MatchSet::Points, MatchSet::Holdout].map(|set| scene.matches(set, MATCHES));
    let ratio = |rig: &PinholeRig| -> Result<(f64, f64)> {
        let [points, holdout] = [0, 1].map(|k| errors_and_share(rig, &sets[k]));
        let (points, holdout) = points.zip(holdout).ok_or("no point was measured")?;
        Ok((points.0.placed_ratio, holdout.0.placed_ratio))
    };
    let mut reached = [0; 3];
    for fit in &everything.fits {
        for (start, count) in fit.starts.iter().zip(&mut reached) {
            let is_lowest = |cost_px2: f64| cost_px2 <= fit.cost_px2 * 1.000_001;
            *count += usize::from(start.cost_px2.is_some_and(is_lowest));
        }
    }
    Ok(Drawn {
        ratios: [ratio(&extrinsics)?, ratio(&everything)?, ratio(&robust)?],
        rms_px: everything.rms_px,
        reached,
        seconds,
        fit_seconds,
    })
}

/// Of one adjustment of one camera from the focal scan's start.
fn fit_seconds(own: &Observations) -> Result<f64> {
    let start = start_camera(own, 0)?;
    let sensor = own.sensors[0];
    let focal_px = start.field.base.focal_px;
    let state = State {
        cameras: vec![BrownCamera::ideal(sensor, [focal_px; 2], sensor.center())],
        camera_from_first: vec![RigidTransform::identity()],
        first_from_board: start.camera_from_board,
    };
    let started = Instant::now();
    minimize(state, own, Free::Intrinsics, &Settings::default())?;
    Ok(started.elapsed().as_secs_f64())
}

fn print(optics: OpticsKind, drawn: &[Drawn]) {
    let mean = |of: &dyn Fn(&Drawn) -> f64| drawn.iter().map(of).sum::<f64>() / drawn.len() as f64;
    let column = |k: usize| {
        format!(
            "{:>7.4} | {:>7.4}",
            mean(&|d| d.ratios[k].0),
            mean(&|d| d.ratios[k].1)
        )
    };
    let reached = [0, 1, 2].map(|k| drawn.iter().map(|d| d.reached[k]).sum::<usize>());
    let [conic, fixed_center, focal_scan] = reached;
    println!(
        "{:<11} {:>17} {:>17} {:>17} {:>8.4} {:>10} {:>7.3} {:>7.4}",
        optics.name(),
        column(0),
        column(1),
        column(2),
        mean(&|d| d.rms_px),
        format!("{conic} {fixed_center} {focal_scan}"),
        mean(&|d| d.seconds),
        mean(&|d| d.fit_seconds),
    );
}
