//! The publication's experiments (its section 3) on any dataset: what each of three methods is worth
//! on the same screened corners.
//!
//! | file | experiment | publication |
//! | --- | --- | --- |
//! | [`spread`] | error of the networks against their spread, [`auxiliary`] markers included | Fig. 7 |
//! | [`stage`] | angles of the poses about the stage's axis against the dial | Fig. 8 |
//! | [`target`] | the measurement target: point cloud, error against distance | Fig. 10, 11 |
//! | [`known`] | points with known truth: absolute error against distance | |
//!
//! [`runs`] has all methods calibrate; [`paper`] simulates a copy of the publication's set-up; [`figures`],
//! [`tables`] and [`words`] say what was found.

pub mod auxiliary;
pub mod error;
pub mod figures;
pub mod known;
pub mod paper;
pub mod runs;
pub mod spread;
pub mod stage;
pub mod statistics;
pub mod tables;
pub mod target;
pub mod words;

pub use error::ExperimentError;
pub use runs::MethodOutcome;
pub use spread::ExperimentSettings;

use crate::methods::Screened;
use crate::pipeline::{self, camera_names, explained, offered};
use calib_rays::observed::poses;
use calib_rays::progress::Progress;
use calib_recording::dataset::Dataset;
use calib_recording::dataset::stage::{entry, placements};
use calib_recording::detect::DetectSettings;
use runs::MethodRun;
use serde::Serialize;
use std::path::PathBuf;

/// What was found on a dataset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Its name in tables.
    pub name: String,
    /// Its folder; `None` for a simulated one that is gone.
    pub dataset: Option<PathBuf>,
    /// Cameras.
    pub cameras: Vec<String>,
    /// Poses that the methods were given.
    pub poses: usize,
    /// Corners that the methods were given.
    pub corners: usize,
    /// What came of each method.
    pub methods: Vec<MethodOutcome>,
    /// Fig. 7.
    pub spread: Option<spread::SpreadExperiment>,
    /// Fig. 8.
    pub stage_angles: Option<stage::StageExperiment>,
    /// Fig. 10 and 11.
    pub target: Option<target::TargetExperiment>,
    /// Points with known truth.
    pub known_points: Option<known::KnownExperiment>,
    /// What could not be done.
    pub left_out: Vec<LeftOut>,
}

/// A part of the experiments that could not be done.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Which.
    pub part: &'static str,
    /// Why.
    pub reason: String,
}

/// Runs all experiments that a dataset allows.
///
/// # Errors
/// [`ExperimentError`]: unusable input; the joint estimate's own error if no method has an answer.
pub fn evaluate(
    dataset: &Dataset,
    settings: &ExperimentSettings,
    progress: &dyn Progress,
) -> Result<Evaluation, ExperimentError> {
    let corners = pipeline::corners(dataset, &DetectSettings::default(), progress)?;
    let offered = offered(dataset, &corners)?;
    let names = camera_names(dataset);
    let scene = auxiliary::scene(dataset)?;
    let mut left_out = Vec::new();

    progress.begin("calibrate with three methods", 0);
    let placements = placements(dataset, &corners.views);
    let screened = Screened::of(&offered.observations);
    let runs = runs::run_all(&screened.given(&names, &placements));
    progress.end();
    let observations = &screened.observations;
    if runs.iter().all(|run| run.outcome.is_err())
        && let Err(error) = &screened.joint
    {
        return Err(explained(error.clone(), dataset, &offered.views).into());
    }

    progress.begin("networks of many spreads", 0);
    let chosen_px = runs::solved(&runs).find_map(|(_, found)| found.spread_px());
    let spread = spread::run(observations, scene.as_ref(), chosen_px, settings);
    progress.end();
    let spread = noted(&mut left_out, "error against spread", spread);
    if scene.is_none() {
        left_out.push(LeftOut {
            part: "auxiliary markers against spread",
            reason: "the dataset has no truth.json that says where they are".to_owned(),
        });
    }
    let all_poses = poses(&corners.views);
    let stage = stage::run(&runs, &|pose| entry(dataset, &all_poses, pose));
    let stage_angles = noted(&mut left_out, "stage angles", stage);
    let one_camera = "one camera cannot triangulate".to_owned();
    let (target, known_points) = if names.len() < 2 {
        (Err(one_camera.clone()), Err(one_camera))
    } else {
        progress.begin("measuring", 0);
        let target = target::run(dataset, &runs, progress);
        let known = known::run(dataset, &runs);
        progress.end();
        (target?, known?)
    };
    Ok(Evaluation {
        name: dataset_name(dataset),
        dataset: Some(dataset.folder.clone()),
        cameras: names,
        poses: observations.poses.len(),
        corners: observations.corner_count(),
        methods: runs.iter().map(MethodRun::outcome).collect(),
        spread,
        stage_angles,
        target: noted(&mut left_out, "measurement target", target),
        known_points: noted(&mut left_out, "points with known truth", known_points),
        left_out,
    })
}

fn noted<T>(
    left_out: &mut Vec<LeftOut>,
    part: &'static str,
    result: Result<T, String>,
) -> Option<T> {
    result
        .map_err(|reason| left_out.push(LeftOut { part, reason }))
        .ok()
}

fn dataset_name(dataset: &Dataset) -> String {
    let folder = dataset.folder.canonicalize();
    let folder = folder.as_deref().unwrap_or(&dataset.folder);
    folder.file_name().map_or_else(
        || dataset.folder.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}
