//! Weak geometry: the program against a pinhole with five Brown-Conrady numbers a camera, adjusted
//! together on the same corners, as the usual libraries have it.

use crate::Result;
use crate::arguments::{Case, WEAK};
use crate::program::{ErrorMm, Outcome, Program, error_mm};
use calib_estimate::adjust::Observations;
use calib_estimate::pinhole::{RigSettings, calibrate_rig};
use calib_offline::methods::pinhole::PinholeRays;
use calib_rays::measure::PointSource;
use calib_simulate::faults::{Poses, Rig};

/// Prints a row per rig and fault of [`WEAK`] that was shown by hand, if there are others than none: RMS
/// error over all draws, mm, of the pinhole and of every program.
pub fn print(programs: &[Program], cases: &[Case], all: &[Vec<Outcome>]) -> Result<()> {
    let is_row = |case: &Case| WEAK.contains(&case.fault.name) && case.poses == Poses::HandHeld;
    if !cases
        .iter()
        .any(|case| is_row(case) && case.fault.name != WEAK[0])
    {
        return Ok(());
    }
    let names: Vec<_> = programs.iter().map(|program| program.name).collect();
    println!(
        "\n| hand-held, RMS mm | pinhole, 5 numbers | {} |",
        names.join(" | ")
    );
    println!("| --- | --- |{}", " --- |".repeat(names.len()));
    for rig in Rig::ALL {
        for name in WEAK {
            let draws: Vec<usize> = (0..cases.len())
                .filter(|&k| {
                    is_row(&cases[k]) && cases[k].rig == rig && cases[k].fault.name == name
                })
                .collect();
            if draws.is_empty() {
                continue;
            }
            let pinhole = draws.iter().map(|&k| pinhole(&cases[k]));
            let pinhole = rms(&pinhole.collect::<Result<Vec<_>>>()?);
            let cells = (0..programs.len()).map(|program| {
                let errors: Vec<_> = draws.iter().map(|&k| all[k][program].error).collect();
                let error = rms(&errors);
                format!(" {error:.4}, {:.2} times |", error / pinhole)
            });
            let cells: String = cells.collect();
            println!("| {}: {name} | {pinhole:.4} |{cells}", rig.name());
        }
    }
    Ok(())
}

fn rms(errors: &[Option<ErrorMm>]) -> f64 {
    let squares: Vec<f64> = errors
        .iter()
        .flatten()
        .map(|error| error.rms.powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Error of the pinhole on a recording; `None` if it does not measure.
fn pinhole(case: &Case) -> Result<Option<ErrorMm>> {
    let recording = case.recorded()?;
    let sensors = recording.sensors.clone();
    let observations = Observations::new(recording.board, sensors, &recording.views);
    let rays = PinholeRays::new(calibrate_rig(&observations, &RigSettings::default())?);
    let points: Vec<_> = recording
        .matches
        .iter()
        .map(|exact| {
            let pixels = exact.pixels.iter().enumerate();
            let sightings: Vec<_> = pixels.map(|(k, p)| (k, [p.u, p.v])).collect();
            Some(rays.point(&sightings).ok()?.point_mm.into())
        })
        .collect();
    Ok(error_mm(&points, &recording.matches))
}
