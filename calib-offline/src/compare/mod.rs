//! Methods side by side on one dataset: the same views, the same folds, and every figure from the
//! corners that all of them can answer.

pub mod boards;
pub mod bootstrap;
pub mod conclusion;
pub mod contender;
#[cfg(test)]
mod example;
mod figures;
pub mod record;
pub mod words;

pub use record::{Comparison, MethodFigures, SCHEMA};

use crate::error::Error;
use crate::evaluate::{Folds, estimate_folds};
use crate::pipeline::solution::folds_wanted;
use crate::pipeline::{Corners, Method, camera_names, explained, offered};
use calib_blob::matches::read_known;
use calib_estimate::adjust::Observations;
use calib_rays::progress::Progress;
use calib_recording::dataset::identity::input_sha256;
use calib_recording::dataset::{Dataset, stage};
use contender::{CONTENDERS, Contender, Failure, Fitted, Shared};
use figures::{add_held_out, add_training, add_truth, without_outliers, working_distance_mm};
use std::time::{Duration, Instant};

/// A method and what came of it.
struct Run<'a> {
    contender: &'a Contender,
    fitted: Result<Fitted, Failure>,
    folds: Folds,
    time: Duration,
}

/// Compares all methods on a dataset with so many folds; 0 leaves held-out boards out.
///
/// A method that fails has the reason in its place, and the others stand. Deterministic, the times
/// apart.
///
/// # Errors
/// Unusable input; the joint estimate's own error if no method has an answer.
pub fn compare(
    dataset: &Dataset,
    corners: &Corners,
    folds: usize,
    progress: &dyn Progress,
) -> Result<Comparison, Error> {
    compare_methods(&CONTENDERS, dataset, corners, folds, progress)
}

/// [`compare`] for other methods; the first is what the others are measured against.
///
/// # Errors
/// As [`compare`].
pub fn compare_methods(
    contenders: &[Contender],
    dataset: &Dataset,
    corners: &Corners,
    folds: usize,
    progress: &dyn Progress,
) -> Result<Comparison, Error> {
    let offered = offered(dataset, corners)?;
    let names = camera_names(dataset);
    // One camera measures no points.
    let known = if names.len() < 2 {
        Vec::new()
    } else {
        read_known(&dataset.folder, &names)?
    };
    progress.begin("screening", 0);
    let began = Instant::now();
    let shared = Shared::of(
        &offered.observations,
        stage::placements(dataset, &corners.views),
    );
    let joint_time = began.elapsed();
    progress.end();
    let observations = &shared.observations;
    let folds = folds_wanted(observations, folds).min(observations.poses.len());
    let runs: Vec<Run> = contenders
        .iter()
        .map(|contender| {
            progress.begin(contender.title, folds);
            let run = run(contender, &shared, &names, folds, progress);
            progress.end();
            run
        })
        .collect();
    if runs.iter().all(|run| run.fitted.is_err())
        && let Err(error) = shared.joint
    {
        return Err(explained(error, dataset, &offered.views));
    }
    let mut methods: Vec<MethodFigures> = runs.iter().map(empty_row).collect();
    for (run, figures) in runs.iter().zip(&mut methods) {
        // The screening is the joint estimate's own.
        let own_share = run.contender.name == Method::Joint.name();
        figures.time += if own_share {
            joint_time
        } else {
            Duration::ZERO
        };
    }
    add_training(&mut methods, &runs, observations);
    let judged = without_outliers(&runs, observations);
    let held_out = add_held_out(&mut methods, &runs, folds, &judged);
    add_truth(&mut methods, &runs, &known);
    let best = runs.iter().rev().find_map(|run| run.fitted.as_ref().ok());
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
        methods,
        conclusion: Vec::new(),
    };
    comparison.conclusion = conclusion::conclude(&comparison);
    Ok(comparison)
}

fn run<'a>(
    contender: &'a Contender,
    shared: &Shared,
    names: &[String],
    folds: usize,
    progress: &dyn Progress,
) -> Run<'a> {
    let began = Instant::now();
    let fitted = (contender.fit)(shared, names);
    let folds = if fitted.is_ok() { folds } else { 0 };
    let fold = |training: &Observations| (contender.fold)(shared, training);
    let folds = estimate_folds(&shared.observations, folds, &fold, progress);
    Run {
        contender,
        fitted,
        folds,
        time: began.elapsed(),
    }
}

fn empty_row(run: &Run) -> MethodFigures {
    let fitted = run.fitted.as_ref();
    MethodFigures {
        method: run.contender.name,
        title: run.contender.title,
        failure: fitted.err().map(ToString::to_string),
        training: None,
        conversion_error_px: fitted.ok().map(|fitted| fitted.conversion_error_px),
        failed_folds: run.folds.failed.clone(),
        held_out: None,
        against_first: None,
        truth: Vec::new(),
        time: run.time,
    }
}
