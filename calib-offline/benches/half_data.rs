//! Two calibrations from every other pose each: how far they differ over what is predicted.
//!
//! `cargo bench -p calib-offline --bench half_data -- [OPTICS ...] [--draws N]`; without optics one
//! camera alone comes last.

#[allow(dead_code, reason = "other benches use the rest")]
mod common;

use calib_judge::half_data::HalfData;
use calib_simulate::{OpticsKind, Scene, SceneSettings};
use common::halves::{halves_of, halves_of_one_camera};
use common::{Arguments, Result, print_table};
use std::process::ExitCode;

const OPTICS: [OpticsKind; 4] = [
    OpticsKind::Brown,
    OpticsKind::Port,
    OpticsKind::Paper,
    OpticsKind::Bumps,
];

fn main() -> ExitCode {
    print_table(table)
}

fn table(arguments: &Arguments) -> Result<()> {
    println!(
        "{} draws each: least to most, mean and RMS ratio of the difference to the predicted one\n",
        arguments.draws
    );
    for kind in arguments.optics(&OPTICS)? {
        let drawn = arguments.drawn(kind.name(), |seed| -> Result<HalfData> {
            let scene = Scene::new(SceneSettings::standard_noisy(kind, seed))?;
            Ok(halves_of(&scene, &scene.observe_corners()))
        })?;
        print(kind.name(), &drawn);
    }
    if arguments.names.is_empty() {
        let drawn = arguments.drawn("one camera", |seed| -> Result<HalfData> {
            Ok(halves_of_one_camera(seed))
        })?;
        print("brown, one camera", &drawn);
    }
    Ok(())
}

fn print(name: &str, drawn: &[HalfData]) {
    let ratios: Vec<f64> = drawn.iter().map(|halves| halves.ratio).collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    let rms = calib_rays::numerics::rms(&ratios).unwrap_or(f64::NAN);
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let most = ratios.iter().copied().fold(0.0, f64::max);
    println!("{name:<18} {least:.2} to {most:.2}  mean {mean:.3}  rms {rms:.3}");
}
