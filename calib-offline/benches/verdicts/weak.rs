//! Weak geometry: the program against a pinhole with five Brown-Conrady numbers a camera, adjusted
//! together on the same corners, as the usual libraries have it.

use crate::Result;
use crate::arguments::{Arguments, Case};
use crate::program::{self, Program, error_mm};
use calib_estimate::adjust::Observations;
use calib_estimate::pinhole::{RigSettings, calibrate_rig};
use calib_offline::methods::pinhole::PinholeRays;
use calib_rays::measure::PointSource;
use calib_simulate::faults::{self, Poses, Recording};
use rayon::prelude::*;

/// Faults of the geometry alone, and none.
const WEAK: [&str; 3] = ["none", "few-tilts", "frontal-one-depth"];

/// Prints a row per fault: RMS error over all draws, mm, of the pinhole and of every program.
pub fn print(arguments: &Arguments, programs: &[Program]) -> Result<()> {
    let asked = |name: &str| arguments.faults.iter().any(|fault| fault.name == name);
    if !arguments.is_weak_only && !asked(WEAK[1]) && !asked(WEAK[2]) {
        return Ok(());
    }
    let names: Vec<_> = programs.iter().map(|program| program.name).collect();
    println!(
        "\n| hand-held, {} draws, RMS mm | pinhole, 5 numbers | {} |",
        arguments.draws,
        names.join(" | ")
    );
    println!("| --- | --- |{}", " --- |".repeat(names.len()));
    for &rig in &arguments.rigs {
        for fault in WEAK.iter().filter_map(|name| faults::named(name)) {
            let draws = (1..=arguments.draws).into_par_iter();
            let squares = draws
                .map(|seed| {
                    let case = Case {
                        fault,
                        rig,
                        poses: Poses::HandHeld,
                        seed,
                    };
                    squares(&case.recorded()?, programs)
                })
                .collect::<Result<Vec<_>>>()?;
            let rms = |of: usize| {
                let found: Vec<f64> = squares.iter().filter_map(|draw| draw[of]).collect();
                (found.iter().sum::<f64>() / found.len() as f64).sqrt()
            };
            let pinhole = rms(0);
            let cells: Vec<_> = (1..=programs.len())
                .map(|k| format!("{:.4}, {:.2} times", rms(k), rms(k) / pinhole))
                .collect();
            println!(
                "| {}: {} | {pinhole:.4} | {} |",
                rig.name(),
                fault.name,
                cells.join(" | ")
            );
        }
    }
    Ok(())
}

/// Squared RMS error of the pinhole and of every program, mm2; `None` if there is no calibration.
fn squares(recording: &Recording, programs: &[Program]) -> Result<Vec<Option<f64>>> {
    let sensors = recording.sensors.clone();
    let observations = Observations::new(recording.board, sensors, &recording.views);
    let pinhole = calibrate_rig(&observations, &RigSettings::default())?;
    let rays = PinholeRays::new(pinhole);
    let points: Vec<_> = recording
        .matches
        .iter()
        .map(|exact| {
            let pixels = exact.pixels.iter().enumerate();
            let sightings: Vec<_> = pixels.map(|(k, p)| (k, [p.u, p.v])).collect();
            Some(rays.point(&sightings).ok()?.point_mm.into())
        })
        .collect();
    let mut errors = vec![error_mm(&points, &recording.matches)];
    for program in programs {
        errors.push(program::outcome(program, recording)?.error);
    }
    let errors = errors.into_iter();
    Ok(errors
        .map(|error| error.map(|error| error.rms * error.rms))
        .collect())
}
