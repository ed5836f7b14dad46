//! The publication's auxiliary markers: four on a square of 160 mm about the board's middle. A
//! recording has none; the truth of a simulated dataset says where cameras would see them.

use super::ExperimentError;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::PixelPoint;
use calib_recording::dataset::Dataset;
use calib_simulate::{CameraOptics, Scene, SceneSettings};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::Deserialize;
use std::path::PathBuf;

/// Side of the square, mm.
pub const SIDE_MM: f64 = 160.0;
/// A stream of random numbers that the simulation does not use.
const STREAM: u64 = 0xa0 << 48;

/// The markers on the board, in order around the square, mm.
pub fn markers_in_board(board: &BoardSpec) -> [Vector3<f64>; 4] {
    let half = SIDE_MM / 2.0;
    [[-half, -half], [half, -half], [half, half], [-half, half]]
        .map(|[x, y]| board.center_in_board() + Vector3::new(x, y, 0.0))
}

/// What `truth.json` holds of interest here.
#[derive(Debug, Deserialize)]
struct Truth {
    settings: SceneSettings,
}

/// The scene that a dataset was simulated from, from its `truth.json`; `None` if there is none.
///
/// # Errors
/// [`ExperimentError::Truth`] if it cannot be read, or belongs to another dataset.
pub fn scene(dataset: &Dataset) -> Result<Option<Scene>, ExperimentError> {
    let file: PathBuf = dataset.folder.join("truth.json");
    if !file.exists() {
        return Ok(None);
    }
    let wrong = |problem: String| ExperimentError::Truth {
        file: file.clone(),
        problem,
    };
    let text = std::fs::read_to_string(&file).map_err(|error| wrong(error.to_string()))?;
    let truth: Truth = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    let scene = Scene::new(truth.settings).map_err(|error| wrong(error.to_string()))?;
    let sensors = scene.cameras.iter().map(CameraOptics::sensor);
    if scene.settings.board != dataset.board {
        return Err(wrong("it has another board".to_owned()));
    }
    if !sensors.eq(dataset.cameras.iter().map(|camera| camera.sensor)) {
        return Err(wrong("it has other cameras".to_owned()));
    }
    Ok(Some(scene))
}

/// Where a camera sees the markers of a pose, with the noise of the corners; `None` for those beyond
/// its sensor, and all of them for a pose that the scene does not have.
pub fn seen_markers(scene: &Scene, camera_idx: usize, pose: usize) -> [Option<PixelPoint>; 4] {
    if pose >= scene.true_poses.len() {
        return [None; 4];
    }
    let left_from_board = scene.exposed_pose(camera_idx, pose);
    let mut rng = ChaCha8Rng::seed_from_u64(scene.settings.seed);
    rng.set_stream(STREAM | (camera_idx as u64) << 32 | pose as u64);
    markers_in_board(&scene.settings.board).map(|marker| {
        let mut noise = || {
            let normal: f64 = rng.sample(StandardNormal);
            scene.settings.noise_px * normal
        };
        let (du, dv) = (noise(), noise());
        let pixel = scene.true_project(camera_idx, &left_from_board.point(&marker))?;
        Some(PixelPoint::new(pixel.u + du, pixel.v + dv))
    })
}
