//! How near the published procedure comes to the oracle: as printed, and as it is built here.
//!
//! `cargo bench -p calib-offline --bench alternating -- [OPTICS ...] [--draws N]`. Every pixel has the
//! ray of its own control points; nothing is smoothed over pixels. The oracle triangulates the same
//! noisy pixels with the true rays. Ratios are of RMS errors of points after the rigid placement that
//! suits best; the share of matches with a ray in both cameras stands beside.

use calib_offline::adjust::Observations;
use calib_offline::alternating::alternation::AlternationSettings;
use calib_offline::alternating::{AlternatingEstimate, AlternatingSettings, estimate};
use calib_offline::evaluate::truth::{PointWithTruth, compare_with_truth};
use calib_offline::geometry::triangulate_rays;
use calib_offline::init::rig::start_rig;
use calib_offline::simulate::{CameraOptics, MatchSet, OpticsKind, Scene, SceneSettings};
use rayon::prelude::*;
use std::process::ExitCode;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

const DRAWS: u64 = 5;
const MATCHES: usize = 2000;

/// A way of doing it.
struct Variant {
    name: &'static str,
    settings: fn() -> AlternatingSettings,
}

/// From the printed procedure to the one built here, one change after the other.
const VARIANTS: [Variant; 5] = [
    Variant {
        name: "as printed",
        settings: AlternatingSettings::published,
    },
    Variant {
        name: "+ best start",
        settings: || AlternatingSettings {
            start: None,
            ..AlternatingSettings::published()
        },
    },
    Variant {
        name: "+ spread chosen",
        settings: || AlternatingSettings {
            start: None,
            spread_px: None,
            warp: true,
            ..AlternatingSettings::published()
        },
    },
    Variant {
        name: "+ 3000 sweeps",
        settings: || AlternatingSettings {
            alternation: AlternationSettings {
                sweeps: 3000,
                step_mm: 0.0,
                mixing: 0,
            },
            ..AlternatingSettings::default()
        },
    },
    Variant {
        name: "mixed (default)",
        settings: AlternatingSettings::default,
    },
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
    let (mut kinds, mut draws) = (Vec::new(), DRAWS);
    let mut arguments = arguments.filter(|argument| argument != "--bench");
    while let Some(argument) = arguments.next() {
        if argument == "--draws" {
            draws = arguments.next().ok_or("--draws needs a number")?.parse()?;
        } else {
            let known = OpticsKind::ALL.iter().find(|k| k.name() == argument);
            kinds.push(*known.ok_or(format!("no optics {argument}"))?);
        }
    }
    if kinds.is_empty() {
        use OpticsKind::{Brown, Bumps, Paper, Port, Window};
        kinds = vec![Brown, Paper, Bumps, Window, Port];
    }
    println!(
        "{draws} draws each: mean (worst) ratio, points | held-out boards, share measured, sweeps\n"
    );
    for kind in kinds {
        for variant in &VARIANTS {
            let drawn: Vec<Drawn> = (1..=draws)
                .into_par_iter()
                .map(|seed| draw(kind, seed, &(variant.settings)()))
                .collect::<std::result::Result<_, String>>()?;
            print(kind, variant, &drawn);
        }
    }
    Ok(())
}

struct Drawn {
    points: f64,
    holdout: f64,
    share: f64,
    sweeps: usize,
}

fn draw(
    kind: OpticsKind,
    seed: u64,
    settings: &AlternatingSettings,
) -> std::result::Result<Drawn, String> {
    let words = |error: &dyn std::fmt::Display| format!("{} {seed}: {error}", kind.name());
    let scene =
        Scene::new(SceneSettings::standard_noisy(kind, seed)).map_err(|error| words(&error))?;
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    let observations = Observations::new(scene.settings.board, sensors, &scene.observe_corners());
    let start = start_rig(&observations).map_err(|error| words(&error))?;
    let placement = |pose: usize| scene.pose_placements.get(pose).copied();
    let found = estimate(&start, &placement, settings).map_err(|error| words(&error))?;
    let (points, share) =
        measure(&scene, &found, MatchSet::Points).ok_or_else(|| words(&"nothing measured"))?;
    let (holdout, _) =
        measure(&scene, &found, MatchSet::Holdout).ok_or_else(|| words(&"nothing measured"))?;
    Ok(Drawn {
        points,
        holdout,
        share,
        sweeps: found.alternated.rms_mm.len() - 1,
    })
}

fn measure(scene: &Scene, found: &AlternatingEstimate, set: MatchSet) -> Option<(f64, f64)> {
    let matches = scene.matches(set, MATCHES);
    let points: Vec<PointWithTruth> = matches
        .iter()
        .filter_map(|m| {
            let rays = [0, 1].map(|c: usize| found.cameras[c].ray(m.pixels[c]));
            let rays: Vec<_> = rays.into_iter().flatten().map(|r| r.ray).collect();
            Some(PointWithTruth {
                measured_mm: triangulate_rays(&rays).ok()?.point_mm,
                true_mm: m.point_in_datum,
                oracle_mm: m.oracle_in_datum,
            })
        })
        .collect();
    let share = points.len() as f64 / matches.len() as f64;
    Some((compare_with_truth(&points)?.placed_ratio, share))
}

fn print(kind: OpticsKind, variant: &Variant, drawn: &[Drawn]) {
    let mean = |of: fn(&Drawn) -> f64| drawn.iter().map(of).sum::<f64>() / drawn.len() as f64;
    let worst = |of: fn(&Drawn) -> f64| drawn.iter().map(of).fold(0.0, f64::max);
    println!(
        "{:<9} {:<16} {:>7.3} ({:.3}) | {:>7.3} ({:.3})  {:>4.0} %  {:>5.0}",
        kind.name(),
        variant.name,
        mean(|d| d.points),
        worst(|d| d.points),
        mean(|d| d.holdout),
        worst(|d| d.holdout),
        100.0 * mean(|d| d.share),
        mean(|d| d.sweeps as f64),
    );
}
