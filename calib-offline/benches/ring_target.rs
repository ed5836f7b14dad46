//! How near the centers of the ring target come to the truth, with and without the correction for
//! the perspective: the table "Ring target" of `BENCHMARKS.md`.
//!
//! `cargo bench -p calib-offline --bench ring_target`. Rendered images of 1280 x 1024, the left
//! camera; every figure is over all markers found in the row's images.

#[path = "../recording/tests/it/ring_shots.rs"]
mod ring_shots;

use calib_simulate::OpticsKind;
use rayon::prelude::*;
use ring_shots::{Errors, Shot, located};
use std::time::Instant;

/// Turns (about x, y, z, degrees) that add up to a row of tilts.
const TURNS: [f64; 4] = [10.0, 100.0, 190.0, 280.0];

fn tilted(optics: OpticsKind, tilt_deg: f64) -> Vec<Shot> {
    TURNS
        .iter()
        .enumerate()
        .map(|(k, &turn)| {
            let (s, c) = (40.0 + 80.0 * k as f64).to_radians().sin_cos();
            Shot::turned(optics, [tilt_deg * c, tilt_deg * s, turn])
        })
        .collect()
}

fn row(name: &str, shots: &[Shot]) {
    let found: Vec<(Errors, usize, Option<String>)> = shots
        .par_iter()
        .map(|shot| {
            let truth = shot.truth();
            match located(&shot.image()) {
                Ok(located) => (Errors::of(&located, &truth), truth.len(), None),
                Err(refusal) => (Errors::default(), truth.len(), Some(refusal.to_string())),
            }
        })
        .collect();
    let errors = found.iter().fold(Errors::default(), |sum, f| sum.and(f.0));
    let seen: usize = found.iter().map(|f| f.1).sum();
    println!(
        "{name:28} {:4} of {seen:4}   {:8.4} {:8.4}   {:8.4} {:8.4}",
        errors.count,
        errors.rms_px(),
        errors.uncorrected_rms_px(),
        errors.predicted_px(),
        errors.worst_px
    );
    for refusal in found.into_iter().filter_map(|f| f.2) {
        println!("{:28} refused: {refusal}", "");
    }
}

fn main() {
    println!(
        "{:28} {:12}   {:>8} {:>8}   {:>8} {:>8}",
        "px per axis", "markers", "RMS", "uncorr.", "predict", "worst"
    );
    let kinds = [
        OpticsKind::Brown,
        OpticsKind::Paper,
        OpticsKind::Bumps,
        OpticsKind::Port,
        OpticsKind::Window,
        OpticsKind::Dome,
        OpticsKind::Wide,
        OpticsKind::Telephoto,
        OpticsKind::Fisheye,
    ];
    for optics in kinds {
        row(
            &format!("{}, simulate", optics.name()),
            &Shot::standard(optics),
        );
    }
    for optics in [OpticsKind::Brown, OpticsKind::Port, OpticsKind::Wide] {
        for tilt_deg in [0.0, 20.0, 40.0, 60.0] {
            let name = format!("{}, tilt {tilt_deg} degrees", optics.name());
            row(&name, &tilted(optics, tilt_deg));
        }
    }
    for (name, blur_px, noise_levels) in [
        ("no noise", 0.7, 0.0),
        ("noise 5 levels", 0.7, 5.0),
        ("blur 0.3 px", 0.3, 1.0),
        ("blur 2 px", 2.0, 1.0),
        ("blur 2 px, noise 5 levels", 2.0, 5.0),
    ] {
        let shots: Vec<Shot> = tilted(OpticsKind::Brown, 30.0)
            .into_iter()
            .map(|shot| {
                shot.with(|render| {
                    render.blur_px = blur_px;
                    render.noise_levels = noise_levels;
                })
            })
            .collect();
        row(&format!("brown 30, {name}"), &shots);
    }
    let image = Shot::turned(OpticsKind::Brown, [20.0, 20.0, 0.0]).image();
    let start = Instant::now();
    let found = located(&image).map_or(0, |located| located.markers.len());
    println!(
        "one image, one thread: {:.2} s, {found} markers",
        start.elapsed().as_secs_f64()
    );
}
