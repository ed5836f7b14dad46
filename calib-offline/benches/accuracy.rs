//! How near the joint estimate comes to the oracle, and how true its uncertainty is, over optics
//! and noise draws: the table of `BENCHMARKS.md`.
//!
//! `cargo bench -p calib-offline --bench accuracy -- [ROW ...] [--draws N] [--first SEED] [--detail]`. The oracle
//! triangulates the same noisy pixels with the true rays; 1 is the limit that their noise sets.
//! Draws run in parallel; every figure is a mean over them.

#[allow(dead_code, reason = "other benches use the rest")]
mod common;

use calib_estimate::joint::Estimate;
use calib_rays::geometry::SensorSize;
use calib_simulate::{MatchSet, OpticsKind, Scene, SceneSettings};
use common::against_truth::{Coverage, coverage, hand_held, measure_set, run_scene};
use common::{Arguments, Result, print_table};
use std::process::ExitCode;

/// A row: its name, and the scene of a draw.
struct Row {
    name: &'static str,
    scene: fn(u64) -> Result<Scene>,
}

fn of(optics: OpticsKind, seed: u64, change: impl FnOnce(&mut SceneSettings)) -> Result<Scene> {
    let mut settings = SceneSettings::standard_noisy(optics, seed);
    change(&mut settings);
    Ok(Scene::new(settings)?)
}

const ROWS: [Row; 26] = [
    Row {
        name: "brown",
        scene: |seed| of(OpticsKind::Brown, seed, |_| ()),
    },
    Row {
        name: "paper",
        scene: |seed| of(OpticsKind::Paper, seed, |_| ()),
    },
    Row {
        name: "window",
        scene: |seed| of(OpticsKind::Window, seed, |_| ()),
    },
    Row {
        name: "port",
        scene: |seed| of(OpticsKind::Port, seed, |_| ()),
    },
    Row {
        name: "fisheye",
        scene: |seed| of(OpticsKind::Fisheye, seed, |_| ()),
    },
    Row {
        name: "bumps",
        scene: |seed| of(OpticsKind::Bumps, seed, |_| ()),
    },
    Row {
        name: "bumps-5-placements",
        scene: |seed| of(OpticsKind::Bumps, seed, |s| s.placements = 5),
    },
    Row {
        name: "paper-10-poses",
        scene: |seed| {
            of(OpticsKind::Paper, seed, |s| {
                s.placements = 1;
                s.angles_deg = (-5..5).map(|k| f64::from(k) * 5.0).collect();
            })
        },
    },
    Row {
        name: "outliers",
        scene: |seed| {
            of(OpticsKind::Brown, seed, |s| {
                s.outlier_share = 0.05;
                s.missing_share = 0.1;
            })
        },
    },
    Row {
        name: "paper-outliers",
        scene: |seed| {
            of(OpticsKind::Paper, seed, |s| {
                s.outlier_share = 0.05;
                s.missing_share = 0.1;
            })
        },
    },
    Row {
        name: "bow",
        scene: |seed| of(OpticsKind::Brown, seed, |s| s.bow_mm = 0.05),
    },
    Row {
        name: "noise-0.2",
        scene: |seed| of(OpticsKind::Brown, seed, |s| s.noise_px = 0.2),
    },
    Row {
        name: "dome",
        scene: |seed| of(OpticsKind::Dome, seed, |_| ()),
    },
    Row {
        name: "wide",
        scene: |seed| of(OpticsKind::Wide, seed, |_| ()),
    },
    Row {
        name: "telephoto",
        scene: |seed| of(OpticsKind::Telephoto, seed, |_| ()),
    },
    Row {
        name: "unequal",
        scene: |seed| of(OpticsKind::Unequal, seed, |_| ()),
    },
    Row {
        name: "port-1-placement",
        scene: |seed| of(OpticsKind::Port, seed, |s| s.placements = 1),
    },
    Row {
        name: "port-10-poses",
        scene: |seed| {
            of(OpticsKind::Port, seed, |s| {
                s.angles_deg = (-2..=2).map(|k| f64::from(k) * 20.0).collect();
            })
        },
    },
    Row {
        name: "window-1-placement",
        scene: |seed| of(OpticsKind::Window, seed, |s| s.placements = 1),
    },
    Row {
        name: "wide-10-poses",
        scene: |seed| {
            of(OpticsKind::Wide, seed, |s| {
                s.angles_deg = (-2..=2).map(|k| f64::from(k) * 20.0).collect();
            })
        },
    },
    Row {
        name: "hand-held-8",
        scene: |seed| Ok(hand_held(8, seed)),
    },
    Row {
        name: "hand-held-12",
        scene: |seed| Ok(hand_held(12, seed)),
    },
    Row {
        name: "correlated",
        scene: |seed| of(OpticsKind::Paper, seed, |s| s.noise_correlation = 0.5),
    },
    Row {
        name: "heavy-tails",
        scene: |seed| of(OpticsKind::Paper, seed, |s| s.noise_tail = Some(4.0)),
    },
    Row {
        name: "6000x4000",
        scene: |seed| {
            of(OpticsKind::Bumps, seed, |s| {
                s.sensor = SensorSize::new(6000, 4000);
            })
        },
    },
    Row {
        name: "640x480",
        scene: |seed| {
            of(OpticsKind::Paper, seed, |s| {
                s.sensor = SensorSize::new(640, 480);
            })
        },
    },
];

fn main() -> ExitCode {
    print_table(table)
}

fn table(arguments: &Arguments) -> Result<()> {
    let is_row = |name: &&String| ROWS.iter().any(|row| row.name == **name);
    if let Some(other) = arguments.names.iter().find(|name| !is_row(name)) {
        let known: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
        return Err(format!("no row {other}; there are {}", known.join(", ")).into());
    }
    let draws = arguments.draws;
    println!(
        "{draws} draws each. RMS error over the oracle's, after the rigid placement that suits best | as it \
         is;\nshare of errors inside their 68 % and 95 % ellipsoid; RMS error with exact pixels over \
         predicted\n"
    );
    println!(
        "{:<19} {:>15} {:>15} {:>7} {:>11} {:>11} {:>11} {:>7}",
        "", "points", "held-out boards", "worst", "68 %", "95 %", "calibration", "outside"
    );
    for row in &ROWS {
        if arguments.names.is_empty() || arguments.names.iter().any(|name| name == row.name) {
            let drawn = arguments.drawn(row.name, |seed| draw(row, seed))?;
            if arguments.detail {
                drawn.iter().for_each(Drawn::print);
            }
            print(row, &drawn);
        }
    }
    Ok(())
}

/// What a draw of a row gave.
struct Drawn {
    estimate: Estimate,
    findings: usize,
    /// (placed, direct) ratio to the oracle.
    points: (f64, f64),
    holdout: (f64, f64),
    coverage: Coverage,
    outside_share: f64,
}

fn draw(row: &Row, seed: u64) -> Result<Drawn> {
    let scene = (row.scene)(seed)?;
    let (mut estimate, findings) = run_scene(&scene);
    let [points, holdout] =
        [MatchSet::Points, MatchSet::Holdout].map(|set| measure_set(&scene, &estimate, set));
    Ok(Drawn {
        coverage: coverage(&scene, &mut estimate, MatchSet::Points),
        findings: findings.len(),
        points: (points.0.placed_ratio, points.0.direct_ratio),
        holdout: (holdout.0.placed_ratio, holdout.0.direct_ratio),
        outside_share: points.1,
        estimate,
    })
}

impl Drawn {
    fn print(&self) {
        println!(
            "  points {:.4} | {:.4}, held-out {:.4} | {:.4}, inside {:.3} {:.3}, calibration {:.2}, {} findings, \
             sigma {:.4} px, nu {:.0}, rho {:.3}",
            self.points.0,
            self.points.1,
            self.holdout.0,
            self.holdout.1,
            self.coverage.within_68,
            self.coverage.within_95,
            self.coverage.calibration_squared.sqrt(),
            self.findings,
            self.estimate.noise.variance_px2.sqrt(),
            self.estimate.noise.freedom,
            self.estimate.neighbor_correlation,
        );
        for choice in &self.estimate.choices {
            println!("    {choice:?}");
        }
        for found in &self.estimate.smoothness {
            println!(
                "    camera {} {:?}: {:.1} of {}, {:.2e}",
                found.camera_idx, found.family, found.effective, found.parameters, found.precision
            );
        }
    }
}

fn print(row: &Row, drawn: &[Drawn]) {
    let mean = |of: fn(&Drawn) -> f64| drawn.iter().map(of).sum::<f64>() / drawn.len() as f64;
    let worst = drawn
        .iter()
        .map(|d| d.points.0.max(d.holdout.0))
        .fold(0.0, f64::max);
    println!(
        "{:<19} {:>6.4} | {:>6.4} {:>6.4} | {:>6.4} {worst:>7.4} {:>11.3} {:>11.3} {:>11.2} {:>6.2}%",
        row.name,
        mean(|d| d.points.0),
        mean(|d| d.points.1),
        mean(|d| d.holdout.0),
        mean(|d| d.holdout.1),
        mean(|d| d.coverage.within_68),
        mean(|d| d.coverage.within_95),
        mean(|d| d.coverage.calibration_squared).sqrt(),
        100.0 * mean(|d| d.outside_share),
    );
}
