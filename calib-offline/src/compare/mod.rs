//! Methods side by side on one dataset: the same views, the same folds, and every figure from the
//! corners that all of them can answer.

mod answer;
pub mod boards;
pub mod bootstrap;
pub mod conclusion;
pub mod error;
#[cfg(test)]
mod example;
mod figures;
pub mod publication;
pub mod record;
mod run;
pub mod words;

pub use error::CompareError;
pub use record::{Comparison, MethodFigures, SCHEMA};

use crate::methods::{Joint, METHODS, Method, Screened};
use crate::pipeline::{Corners, camera_names, explained, offered};
use calib_blob::matches::read_known;
use calib_judge::held_out::folds_wanted;
use calib_rays::progress::Progress;
use calib_recording::dataset::identity::input_sha256;
use calib_recording::dataset::{Dataset, stage};
use figures::{add_held_out, add_training, add_truth, without_outliers, working_distance_mm};
use run::Run;
use std::time::Instant;

/// Compares all methods on a dataset with so many folds; 0 leaves held-out boards out.
///
/// A method that fails has the reason in its place, and the others stand. Deterministic, the times
/// apart.
///
/// # Errors
/// [`CompareError`]: unusable input; the joint estimate's own error if no method has an answer.
pub fn compare(
    dataset: &Dataset,
    corners: &Corners,
    folds: usize,
    progress: &dyn Progress,
) -> Result<Comparison, CompareError> {
    compare_methods(&METHODS, dataset, corners, folds, progress)
}

/// [`compare`] for other methods; the first is what the others are measured against.
///
/// # Errors
/// As [`compare`].
pub fn compare_methods(
    methods: &[&dyn Method],
    dataset: &Dataset,
    corners: &Corners,
    folds: usize,
    progress: &dyn Progress,
) -> Result<Comparison, CompareError> {
    let offered = offered(dataset, corners)?;
    let names = camera_names(dataset);
    // One camera measures no points.
    let known = if names.len() < 2 {
        Vec::new()
    } else {
        read_known(&dataset.folder, &names)?
    };
    let placements = stage::placements(dataset, &corners.views);
    progress.begin("screening", 0);
    let began = Instant::now();
    let screened = Screened::of(&offered.observations);
    let joint_time = began.elapsed();
    progress.end();
    let given = screened.given(&names, &placements);
    let observations = given.observations;
    let folds = folds_wanted(observations, folds);
    let runs: Vec<Run> = methods
        .iter()
        .map(|method| {
            progress.begin(method.title(), folds);
            let run = Run::new(*method, &given, folds, progress);
            progress.end();
            run
        })
        .collect();
    if runs.iter().all(|run| run.answer.is_err())
        && let Err(error) = &screened.joint
    {
        return Err(explained(error.clone(), dataset, &offered.views).into());
    }
    let mut rows: Vec<MethodFigures> = runs.iter().map(Run::empty_row).collect();
    for row in &mut rows {
        // The screening is the joint estimate's own.
        if row.method == Joint.name() {
            row.time += joint_time;
        }
    }
    add_training(&mut rows, &runs, observations);
    let judged = without_outliers(&runs, observations);
    let held_out = add_held_out(&mut rows, &runs, folds, &judged);
    add_truth(&mut rows, &runs, &known);
    let best = runs.iter().rev().find_map(|run| run.answer.as_ref().ok());
    let mut comparison = Comparison {
        schema: SCHEMA,
        tool_version: env!("CARGO_PKG_VERSION"),
        input_sha256: input_sha256(dataset, &corners.views),
        square_mm: observations.board.square_mm,
        working_distance_mm: best.and_then(|best| working_distance_mm(best, observations)),
        poses: observations.different_pose_count(),
        views: observations.views.len(),
        corners: observations.corner_count(),
        outliers: observations.corner_count() - judged.corner_count(),
        folds: held_out.len(),
        held_out_corners: held_out.iter().map(|fold| fold.corner_count).sum(),
        common_corners: held_out.iter().map(|fold| fold.common_count).sum(),
        boards: held_out.iter().map(|fold| fold.boards.len()).sum(),
        methods: rows,
        conclusion: Vec::new(),
    };
    comparison.conclusion = conclusion::conclude(&comparison);
    Ok(comparison)
}
