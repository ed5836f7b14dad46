//! How near the published procedure comes to the oracle: as printed, and as it is built here.
//!
//! `cargo bench -p calib-offline --bench alternating -- [OPTICS ...] [--draws N]`. Every pixel has the
//! ray of its own control points; nothing is smoothed over pixels. The oracle triangulates the same
//! noisy pixels with the true rays. Ratios are of RMS errors of points after the rigid placement that
//! suits best; the share of matches with a ray in both cameras stands beside.

#[allow(dead_code, reason = "other benches use the rest")]
mod common;

use calib_estimate::alternating::alternation::AlternationSettings;
use calib_estimate::alternating::{AlternatingSettings, estimate};
use calib_estimate::init::rig::start_rig;
use calib_simulate::{MatchSet, OpticsKind, Scene, SceneSettings};
use common::against_truth::{errors_and_share, observations};
use common::{Arguments, Result, print_table};
use std::process::ExitCode;

/// A ray of the table costs a network per board: fewer points than elsewhere do.
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
    print_table(table)
}

fn table(arguments: &Arguments) -> Result<()> {
    use OpticsKind::{Brown, Bumps, Paper, Port, Window};
    println!(
        "{} draws each: mean (worst) ratio, points | held-out boards, share measured, sweeps\n",
        arguments.draws
    );
    for kind in arguments.optics(&[Brown, Paper, Bumps, Window, Port])? {
        for variant in &VARIANTS {
            let drawn =
                arguments.drawn(kind.name(), |seed| draw(kind, seed, &(variant.settings)()))?;
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

fn draw(kind: OpticsKind, seed: u64, settings: &AlternatingSettings) -> Result<Drawn> {
    let scene = Scene::new(SceneSettings::standard_noisy(kind, seed))?;
    let observations = observations(&scene, &scene.observe_corners());
    let start = start_rig(&observations)?;
    let placement = |pose: usize| scene.pose_placements.get(pose).copied();
    let found = estimate(&start, &placement, settings)?;
    let measure =
        |set| errors_and_share(&found, &scene.matches(set, MATCHES)).ok_or("nothing was measured");
    let (points, share) = measure(MatchSet::Points)?;
    let (holdout, _) = measure(MatchSet::Holdout)?;
    Ok(Drawn {
        points: points.placed_ratio,
        holdout: holdout.placed_ratio,
        share,
        sweeps: found.alternated.rms_mm.len() - 1,
    })
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
