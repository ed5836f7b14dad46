//! The baseline (Zhang, Brown-Conrady, stereo extrinsics) on simulated scenes: how near it comes to
//! the oracle, with the intrinsics as each camera alone has them and with everything adjusted
//! together, and what it costs.
//!
//! `cargo bench -p calib-offline --bench pinhole -- [OPTICS ...] [--draws N]`. The oracle
//! triangulates the same noisy pixels with the true rays; 1 is the limit that their noise sets.

use calib_offline::adjust::Observations;
use calib_offline::evaluate::truth::{PointWithTruth, TruthErrors, compare_with_truth};
use calib_offline::geometry::RigidTransform;
use calib_offline::init::focal_scan::start_camera;
use calib_offline::pinhole::adjustment::{Free, State, minimize};
use calib_offline::pinhole::{
    BrownCamera, Loss, PinholeRig, Refine, RigSettings, Settings, calibrate_rig, stereo,
};
use calib_offline::simulate::{
    CameraOptics, MatchSet, OpticsKind, Scene, SceneSettings, TrueMatch,
};
use clap::ValueEnum;
use rayon::prelude::*;
use std::process::ExitCode;
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// Noise draws unless told otherwise.
const DRAWS: u64 = 5;
/// Points that each comparison measures.
const MATCHES: usize = 3000;
const OPTICS: [OpticsKind; 5] = [
    OpticsKind::Brown,
    OpticsKind::Paper,
    OpticsKind::Bumps,
    OpticsKind::Window,
    OpticsKind::Port,
];

fn main() -> ExitCode {
    match table(std::env::args().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn table(arguments: impl Iterator<Item = String>) -> Result<()> {
    let (mut optics, mut draws) = (Vec::new(), DRAWS);
    let mut arguments = arguments.filter(|argument| argument != "--bench");
    while let Some(argument) = arguments.next() {
        if argument == "--draws" {
            draws = arguments.next().ok_or("--draws needs a number")?.parse()?;
        } else {
            optics.push(OpticsKind::from_str(&argument, true)?);
        }
    }
    if optics.is_empty() {
        optics = OPTICS.into();
    }
    println!(
        "{draws} draws each. RMS error over the oracle's after the best rigid placement: points | held-out \
         boards;\nof two cameras per draw, how many reached their lowest minimum from each start: conic, fixed \
         center, focal\nscan; wall seconds of the whole rig, and of one adjustment of one camera\n"
    );
    println!(
        "{:<11} {:>17} {:>17} {:>17} {:>8} {:>10} {:>7} {:>7}",
        "", "extrinsics only", "everything", "Student-t", "RMS px", "starts", "rig s", "fit s"
    );
    for optics in optics {
        let drawn: Vec<Drawn> = (1..=draws)
            .into_par_iter()
            .map(|seed| draw(optics, seed))
            .collect::<Result<_>>()?;
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
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    let observations = Observations::new(scene.settings.board, sensors, &scene.observe_corners());
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
        let [points, holdout] = [0, 1].map(|k| errors(rig, &sets[k]));
        Ok((points?.placed_ratio, holdout?.placed_ratio))
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

fn errors(rig: &PinholeRig, matches: &[TrueMatch]) -> Result<TruthErrors> {
    let points: Vec<PointWithTruth> = matches
        .iter()
        .filter_map(|m| {
            let point = rig
                .triangulate(&[(0, m.pixels[0]), (1, m.pixels[1])])
                .ok()?;
            Some(PointWithTruth {
                measured_mm: point.point_mm,
                true_mm: m.point_in_datum,
                oracle_mm: m.oracle_in_datum,
            })
        })
        .collect();
    Ok(compare_with_truth(&points).ok_or("no point was measured")?)
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
