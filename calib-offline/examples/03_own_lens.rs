//! An own lens in the simulator: cameras whose true rays are known, calibrated, and judged against them.
//!
//! ```sh
//! cargo run --release -p calib-offline --example 03_own_lens
//! ```

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::estimate;
use calib_rays::geometry::PixelPoint;
use calib_simulate::optics::{CameraOptics, Distortion, FlatWindow, Lens, Media, PerspectiveLens};
use calib_simulate::{MatchSet, OpticsKind, Scene, SceneSettings};
use nalgebra::Vector3;
use std::error::Error;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let mut scene = Scene::new(SceneSettings::standard_noisy(OpticsKind::Brown, 1))?;
    let sensor = scene.settings.sensor;

    // A distorted lens behind a tilted pane of glass: its rays meet nowhere.
    let lens = Lens::Perspective(PerspectiveLens {
        focal_px: [2300.0, 2298.0],
        principal: PixelPoint::new(650.0, 505.0),
        distortion: Distortion::Brown {
            k1: -0.2,
            k2: 0.1,
            k3: 0.0,
            p1: 3e-4,
            p2: -2e-4,
        },
        bumps: Vec::new(),
    });
    let window = FlatWindow {
        distance_mm: 40.0,
        normal: Vector3::new(0.2, 0.05, 1.0).normalize(),
        thickness_mm: 8.0,
        index: 1.52,
        index_behind: 1.0,
    };
    scene.cameras[0] = CameraOptics::new(sensor, lens, Media::Flat(window));

    let views = scene.observe_corners();
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    let observations = Observations::new(scene.settings.board.clone(), sensors, &views);
    let start = start_rig(&observations)?;
    let rig = estimate(&start.observations, &start)?.rig(&["left".to_owned(), "right".to_owned()]);

    // Matched pixels with their noise, measured by the calibration and by the true rays.
    let matches = scene.matches(MatchSet::Points, 300);
    let (mut measured, mut truth) = (Vec::new(), Vec::new());
    for entry in &matches {
        let [left, right] = [entry.pixels[0], entry.pixels[1]];
        let Ok(found) = rig.triangulate(&[(0, left), (1, right)]) else {
            continue;
        };
        measured.push(found.point_mm);
        truth.push(entry.point_in_datum);
    }
    let rms_mm = rms_after_placement(&measured, &truth).ok_or("too few points")?;
    println!("{} points, {rms_mm:.4} mm RMS", measured.len());
    Ok(())
}

/// Root mean square distance after the best rigid placement: a calibration may choose its frame.
fn rms_after_placement(measured: &[Vector3<f64>], truth: &[Vector3<f64>]) -> Option<f64> {
    let placement = calib_rays::geometry::best_placement(measured, truth)?;
    let pairs = measured.iter().zip(truth);
    let distances: Vec<f64> = pairs
        .map(|(measured, truth)| (placement.point(measured) - truth).norm())
        .collect();
    calib_rays::numerics::rms(&distances)
}
