//! Recordings that leave the lens half open, beside a pinhole with five distortion numbers on the same
//! corners: error of exact matches after the best rigid placement, what was predicted of it, and the
//! share of errors inside their ellipsoids of 95 %, at the distances recorded, nearer and farther.
//!
//! `cargo bench -p calib-offline --bench weak -- [ROW ...] [--draws N] [--first SEED] [--detail]`.

#[allow(dead_code, reason = "other benches use the rest")]
mod common;
#[path = "common/weak_rigs.rs"]
mod weak_rigs;

use calib_estimate::pinhole::{RigSettings, calibrate_rig};
use calib_rays::geometry::best_placement;
use common::against_truth::{observations, run_scene};
use common::{Arguments, Result, print_table};
use nalgebra::{Matrix3, Vector3};
use std::process::ExitCode;
use weak_rigs::{Boards, Exact, USUAL, matches, scene};

/// Tilted within 3 degrees.
const SMALL_TILTS: Boards = Boards {
    tilt_deg: 3.0,
    ..USUAL
};
/// Frontal within 2 degrees, at one distance.
const ONE_DEPTH: Boards = Boards {
    tilt_deg: 2.0,
    depth: [1.0, 1.0],
    ..USUAL
};

const ROWS: [(&str, Boards); 6] = [
    ("usual", USUAL),
    ("tilt-3", SMALL_TILTS),
    ("frontal-1-depth", ONE_DEPTH),
    (
        "frontal-1-depth-15x13",
        Boards {
            corners: [15, 13],
            ..ONE_DEPTH
        },
    ),
    (
        "tilt-8",
        Boards {
            tilt_deg: 8.0,
            ..USUAL
        },
    ),
    (
        "tilt-3-6-boards",
        Boards {
            count: 6,
            ..SMALL_TILTS
        },
    ),
];

/// Of the matches, over the working distance.
const DEPTHS: [[f64; 2]; 3] = [[0.85, 1.15], [0.6, 0.8], [1.2, 1.4]];
const MATCHES: usize = 400;
/// Quantile of a chi-square variable of 3 degrees of freedom at 95 %.
const CHI_SQUARE_95: f64 = 7.8147;

/// A match, and where this calibration and the pinhole have it.
type Placed = (Exact, Vector3<f64>, Vector3<f64>);

fn main() -> ExitCode {
    print_table(table)
}

/// At some depths: RMS error, mm, what was predicted, share inside, and the pinhole's RMS error.
#[derive(Clone, Copy)]
struct AtDepth {
    error_mm: f64,
    predicted_mm: f64,
    inside: f64,
    pinhole_mm: f64,
}

fn table(arguments: &Arguments) -> Result<()> {
    println!(
        "{} draws each. RMS error, mm (predicted; share inside 95 %; pinhole's; ratio), at the working distance, \
         at 0.6 to 0.8 and at 1.2 to 1.4 of it\n",
        arguments.draws
    );
    for (name, boards) in ROWS {
        if !arguments.names.is_empty() && !arguments.names.iter().any(|n| n == name) {
            continue;
        }
        let drawn = arguments.drawn(name, |seed| draw(&boards, seed))?;
        if arguments.detail {
            for by_depth in &drawn {
                for depth in by_depth {
                    print!("  {}", words(*depth));
                }
                println!();
            }
        }
        print!("{name:<22}");
        for k in 0..DEPTHS.len() {
            print!(" | {}", words(together(&drawn, k)));
        }
        println!();
    }
    Ok(())
}

fn together(drawn: &[[AtDepth; 3]], k: usize) -> AtDepth {
    let mean =
        |of: fn(&AtDepth) -> f64| drawn.iter().map(|d| of(&d[k])).sum::<f64>() / drawn.len() as f64;
    AtDepth {
        error_mm: mean(|d| d.error_mm.powi(2)).sqrt(),
        predicted_mm: mean(|d| d.predicted_mm.powi(2)).sqrt(),
        inside: mean(|d| d.inside),
        pinhole_mm: mean(|d| d.pinhole_mm.powi(2)).sqrt(),
    }
}

fn words(of: AtDepth) -> String {
    format!(
        "{:.4} ({:.4}; {:.3}; {:.4}; {:.2})",
        of.error_mm,
        of.predicted_mm,
        of.inside,
        of.pinhole_mm,
        of.error_mm / of.pinhole_mm
    )
}

fn draw(boards: &Boards, seed: u64) -> Result<[AtDepth; 3]> {
    let scene = scene(boards, seed)?;
    let (mut estimate, _) = run_scene(&scene);
    let rig = estimate.rig(&["left", "right"].map(str::to_owned));
    let corners = observations(&scene, &scene.observe_corners());
    let pinhole = calibrate_rig(&corners, &RigSettings::default())?;
    let mut by_depth = Vec::new();
    for depth in DEPTHS {
        let mut exact: Vec<(Exact, Vector3<f64>, Vector3<f64>)> = Vec::new();
        for found in matches(&scene, depth, MATCHES) {
            let pair = [(0, found.1[0]), (1, found.1[1])];
            if let (Ok(ours), Ok(theirs)) = (rig.triangulate(&pair), pinhole.triangulate(&pair)) {
                exact.push((found, ours.point_mm, theirs.point_mm));
            }
        }
        let errors = |point: fn(&Placed) -> Vector3<f64>| {
            let (from, to): (Vec<_>, Vec<_>) = exact.iter().map(|e| (point(e), e.0.0)).unzip();
            let placement = best_placement(&from, &to)?;
            let errors = from
                .iter()
                .zip(&to)
                .map(|(p, t)| placement.point(p) - t)
                .collect::<Vec<_>>();
            Some(errors)
        };
        let ours = errors(|e| e.1).ok_or("no point was measured")?;
        let theirs = errors(|e| e.2).ok_or("no point was measured")?;
        let pairs: Vec<_> = exact
            .iter()
            .map(|((_, [a, b]), _, _)| [(0, *a), (1, *b)])
            .collect();
        let covariance = estimate
            .point_covariance(&rig, &pairs)?
            .ok_or("no covariance")?;
        // Errors are in the left camera's frame.
        let turn = rig.cameras[0].rig_from_camera.rotation;
        let is_inside = |(k, error): (usize, &Vector3<f64>)| {
            let own: Matrix3<f64> = covariance.fixed_view::<3, 3>(3 * k, 3 * k).into_owned();
            let inverse = (turn.transpose() * own * turn).try_inverse();
            inverse.is_some_and(|inverse| error.dot(&(inverse * error)) < CHI_SQUARE_95)
        };
        let count = ours.len() as f64;
        let rms_mm = |errors: &[Vector3<f64>]| {
            (errors.iter().map(Vector3::norm_squared).sum::<f64>() / count).sqrt()
        };
        by_depth.push(AtDepth {
            error_mm: rms_mm(&ours),
            predicted_mm: (covariance.trace() / count).sqrt(),
            inside: ours.iter().enumerate().filter(|e| is_inside(*e)).count() as f64 / count,
            pinhole_mm: rms_mm(&theirs),
        });
    }
    by_depth.try_into().map_err(|_| "a depth is missing".into())
}
