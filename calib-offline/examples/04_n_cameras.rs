//! Three cameras: nothing stops at two. Each is joined to the others by the poses that they share.
//!
//! ```sh
//! cargo run --release -p calib-offline --example 04_n_cameras
//! ```

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::estimate;
use calib_rays::geometry::{RigidTransform, so3};
use calib_simulate::{CameraOptics, OpticsKind, Scene, SceneSettings};
use nalgebra::Vector3;
use std::error::Error;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let mut scene = Scene::new(SceneSettings::standard_noisy(OpticsKind::Brown, 1))?;
    // A third camera between the two, 60 mm higher and tipped down a little.
    let right = scene.left_from_camera[1];
    scene.cameras.push(scene.cameras[0].clone());
    scene.names.push("top");
    scene.left_from_camera.push(RigidTransform::new(
        so3::exp(&Vector3::new(-0.12, 0.0, 0.0)) * so3::exp(&(so3::log(&right.rotation) / 2.0)),
        right.translation_mm / 2.0 + Vector3::new(0.0, -60.0, 0.0),
    ));

    let views = scene.observe_corners();
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    let observations = Observations::new(scene.settings.board.clone(), sensors, &views);
    let start = start_rig(&observations)?;
    let names: Vec<String> = scene.names.iter().map(|name| (*name).to_owned()).collect();
    let rig = estimate(&start.observations, &start)?.rig(&names);

    // Row 7, column 6 of pose 8, where each camera sees it: the point nearest to all rays.
    let sightings: Vec<_> = (0..3)
        .filter_map(|camera_idx| Some((camera_idx, scene.true_corner(camera_idx, 8, 7, 6)?)))
        .collect();
    let found = rig.triangulate(&sightings)?;
    println!(
        "{} rays, {:.3?} mm, {:.4} mm apart",
        sightings.len(),
        found.point_mm,
        found.gap_mm
    );
    for camera in &rig.cameras {
        println!(
            "{}: at {:.2?} mm",
            camera.name, camera.rig_from_camera.translation_mm
        );
    }
    Ok(())
}
