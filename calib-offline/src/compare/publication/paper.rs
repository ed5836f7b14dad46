//! A simulated copy of the publication's set-up: 1280 x 1024, 210 mm between the cameras, a board of
//! 15 x 13 corners, the target of 63 ring markers at distances about 350 mm. Corners carry 0.05 px of
//! noise; the target's markers are found in rendered images.

use super::{Evaluation, ExperimentError, ExperimentSettings, evaluate};
use calib_rays::progress::Progress;
use calib_recording::dataset::Dataset;
use calib_simulate::{
    ImageFiles, OpticsKind, OutputSettings, Scene, SceneSettings, SimulateError, write_dataset,
};

/// Of all that is random.
const SEED: u64 = 1;
/// Points with known truth inside the volume that the board swept, and of boards never recorded.
const POINTS: usize = 2000;

/// A recording of the set-up.
struct Recording {
    name: &'static str,
    settings: SceneSettings,
}

fn recordings() -> [Recording; 2] {
    let standard = SceneSettings::standard_noisy(OpticsKind::Paper, SEED);
    [
        // As published: ten poses, from -25 to 20 degrees.
        Recording {
            name: "ten-poses",
            settings: SceneSettings {
                placements: 1,
                angles_deg: (-5..=4).map(|k| 5.0 * f64::from(k)).collect(),
                ..standard.clone()
            },
        },
        // What this project recommends: two placements of 17 poses.
        Recording {
            name: "two-placements",
            settings: standard,
        },
    ]
}

/// Simulates and evaluates; the recordings themselves are temporary.
///
/// # Errors
/// A temporary folder that cannot be written.
pub fn evaluate_set_up(
    settings: &ExperimentSettings,
    progress: &dyn Progress,
) -> Result<Vec<Evaluation>, ExperimentError> {
    let scratch = tempfile::tempdir().map_err(|source| SimulateError::Io {
        path: std::env::temp_dir(),
        source,
    })?;
    recordings()
        .into_iter()
        .map(|recording| {
            let folder = scratch.path().join(recording.name);
            progress.begin("simulate and render the set-up", 0);
            let scene = Scene::new(recording.settings).map_err(SimulateError::from);
            let written = scene.and_then(|scene| {
                let output = OutputSettings {
                    ring_target: true,
                    image_files: ImageFiles::Quick,
                    point_count: POINTS,
                    holdout_count: POINTS,
                    ..OutputSettings::default()
                };
                write_dataset(&scene, &output, &folder, false)
            });
            progress.end();
            written?;
            let mut evaluation = evaluate(&Dataset::load(&folder)?, settings, progress)?;
            recording.name.clone_into(&mut evaluation.name);
            evaluation.dataset = None;
            Ok(evaluation)
        })
        .collect()
}
