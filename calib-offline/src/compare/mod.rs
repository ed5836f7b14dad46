//! Methods side by side on one dataset: the same views, the same folds, and every figure from the
//! corners that all of them can answer.

pub mod boards;
pub mod bootstrap;
pub mod conclusion;
pub mod contender;
pub mod record;
pub mod words;

pub use record::{Comparison, MethodFigures, SCHEMA};

use crate::adjust::Observations;
use crate::dataset::corners::poses;
use crate::dataset::identity::input_sha256;
use crate::dataset::{Dataset, View, stage};
use crate::error::Error;
use crate::evaluate::held_out::{BoardErrors, Fold};
use crate::evaluate::reprojection::residuals;
use crate::evaluate::truth::{PointWithTruth, compare_with_truth};
use crate::evaluate::{Folds, estimate_folds, rms};
use crate::field::Rig;
use crate::geometry::RigidTransform;
use crate::matches::source::{PointSource, RigSource};
use crate::matches::{KnownMatches, read_known};
use crate::pipeline::solution::folds_wanted;
use crate::pipeline::{Corners, camera_names, explained, offered};
use crate::progress::Progress;
use boards::{BoardScore, FoldScores, score_fold};
use contender::{CONTENDERS, Contender, Failure, Fitted, Shared};
use nalgebra::Vector3;
use record::{HeldOutFigures, Ratios, Training, TruthFigures};
use std::collections::BTreeMap;
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
    let shared = Shared::of(&offered.observations, placements(dataset, &corners.views));
    let joint_time = began.elapsed();
    progress.end();
    let observations = &shared.observations;
    let folds = folds_wanted(observations, folds).min(observations.poses.len());
    let runs: Vec<Run> = CONTENDERS
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
    let mut methods: Vec<MethodFigures> = runs.iter().map(figures).collect();
    for (run, figures) in runs.iter().zip(&mut methods) {
        // The screening is the joint estimate's own.
        let own_share = run.contender.name == crate::pipeline::Method::Joint.name();
        figures.time += if own_share {
            joint_time
        } else {
            Duration::ZERO
        };
    }
    add_training(&mut methods, &runs, observations);
    let held_out = add_held_out(&mut methods, &runs, folds, observations.board.square_mm);
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

fn figures(run: &Run) -> MethodFigures {
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

/// Median distance of the boards' middles from the first camera, mm.
fn working_distance_mm(fitted: &Fitted, observations: &Observations) -> Option<f64> {
    let camera = fitted.rig.cameras.first()?;
    let middle = observations.board.center_in_board();
    let mut distances: Vec<f64> = fitted
        .rig_from_board
        .iter()
        .flatten()
        .map(|pose| (pose.point(&middle) - camera.rig_from_camera.translation_mm).norm())
        .collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied()
}

/// Residuals of the corners that every method uses.
fn add_training(methods: &mut [MethodFigures], runs: &[Run], observations: &Observations) {
    let standing = runs
        .iter()
        .filter_map(|run| run.fitted.as_ref().ok())
        .map(|fitted| used_residuals_px(fitted, observations));
    let lengths: Vec<Vec<Option<f64>>> = standing.collect();
    let is_common = |k: usize| {
        lengths
            .iter()
            .all(|own| own.get(k).is_some_and(Option::is_some))
    };
    let mut of_standing = lengths.iter();
    for (figures, run) in methods.iter_mut().zip(runs) {
        if run.fitted.is_err() {
            continue;
        }
        let Some(own) = of_standing.next() else {
            return;
        };
        let common: Vec<f64> = own
            .iter()
            .enumerate()
            .filter(|(k, _)| is_common(*k))
            .filter_map(|(_, length)| *length)
            .collect();
        figures.training = rms(&common).map(|rms_px| Training {
            rms_px,
            corners: common.len(),
            rejected: own.iter().filter(|length| length.is_none()).count(),
        });
    }
}

/// Per corner, in the order of the observations: the length of its residual vector, px; `None` if
/// the method does not use it.
fn used_residuals_px(fitted: &Fitted, observations: &Observations) -> Vec<Option<f64>> {
    let poses: Vec<RigidTransform> = fitted
        .rig_from_board
        .iter()
        .map(|pose| pose.unwrap_or_else(RigidTransform::identity))
        .collect();
    let found = residuals(&fitted.rig, &poses, &fitted.board_shape, observations);
    let mut lengths = Vec::with_capacity(observations.corner_count());
    for ((view, residuals), is_used) in observations.views.iter().zip(found).zip(&fitted.is_used) {
        let is_placed = fitted.rig_from_board[view.pose_idx].is_some();
        for (residual, is_used) in residuals.iter().zip(is_used) {
            let residual = residual.filter(|_| *is_used && is_placed);
            lengths.push(residual.map(|residual| residual.norm()));
        }
    }
    lengths
}

/// Held-out figures of the methods that answer at least half of the folds, from the folds that all
/// of these answer. Returns the scores, per fold.
fn add_held_out(
    methods: &mut [MethodFigures],
    runs: &[Run],
    folds: usize,
    square_mm: f64,
) -> Vec<FoldScores> {
    let takes_part = |run: &&Run| folds > 0 && 2 * run.folds.estimated.len() >= folds;
    let by_number: Vec<Vec<Option<&Fold>>> = runs
        .iter()
        .filter(takes_part)
        .map(|run| by_number(&run.folds, folds))
        .collect();
    if by_number.is_empty() {
        return Vec::new();
    }
    let scores: Vec<FoldScores> = (0..folds)
        .filter_map(|number| by_number.iter().map(|of| of[number]).collect())
        .map(|folds: Vec<&Fold>| score_fold(&folds))
        .collect();
    let mut first: Option<usize> = None;
    let mut place = 0;
    for (index, (figures, run)) in methods.iter_mut().zip(runs).enumerate() {
        if !takes_part(&run) {
            continue;
        }
        let own = of_method(&scores, place);
        let unanswered = scores.iter().map(|fold| fold.unanswered[place]).sum();
        figures.held_out = (!own.is_empty()).then(|| of_boards(&own, unanswered, square_mm));
        if index == 0 {
            first = Some(place);
        } else if let Some(first) = first {
            figures.against_first = Some(ratios(&own, &of_method(&scores, first)));
        }
        place += 1;
    }
    scores
}

/// Per number of the fold; `None` where it gave no estimate.
fn by_number(folds: &Folds, count: usize) -> Vec<Option<&Fold>> {
    let mut estimated = folds.estimated.iter();
    (0..count)
        .map(|number| {
            let has_failed = folds.failed.iter().any(|failed| failed.fold == number);
            if has_failed { None } else { estimated.next() }
        })
        .collect()
}

/// The boards of all folds, as one method measures them.
fn of_method(scores: &[FoldScores], place: usize) -> Vec<&BoardScore> {
    let boards = scores.iter().flat_map(|fold| &fold.boards);
    boards.filter_map(|board| board.get(place)).collect()
}

fn of_boards(boards: &[&BoardScore], unanswered: usize, square_mm: f64) -> HeldOutFigures {
    let mut errors = BoardErrors::default();
    let mut residuals_px = Vec::new();
    for board in boards {
        errors.add(board.boards.clone());
        residuals_px.extend_from_slice(&board.residuals_px);
    }
    residuals_px.sort_by(f64::total_cmp);
    let neighbor = rms(&errors.neighbor_errors);
    HeldOutFigures {
        rms_px: rms(&residuals_px),
        median_px: residuals_px.get(residuals_px.len() / 2).copied(),
        neighbor_rms_percent: neighbor.map(|share| 100.0 * share),
        neighbor_rms_mm: neighbor.map(|share| share * square_mm),
        rigid_rms_mm: rms(&errors.rigid_errors_mm),
        points: errors.point_count,
        unanswered,
    }
}

fn ratios(own: &[&BoardScore], first: &[&BoardScore]) -> Ratios {
    let of = |errors: fn(&BoardScore) -> &[f64]| {
        let [own, first] = [own, first]
            .map(|boards| -> Vec<&[f64]> { boards.iter().map(|board| errors(board)).collect() });
        bootstrap::ratio(&own, &first)
    };
    Ratios {
        residual: of(|board| &board.residuals_px),
        neighbor: of(|board| &board.boards.neighbor_errors),
        rigid: of(|board| &board.boards.rigid_errors_mm),
    }
}

/// Stage placement of the poses that belong to one.
fn placements(dataset: &Dataset, views: &[View]) -> BTreeMap<usize, usize> {
    let all = poses(views);
    all.iter()
        .filter_map(|pose| Some((*pose, stage::entry(dataset, &all, *pose).placement?)))
        .collect()
}

/// Points of matches whose truth is known, where every method has one.
fn add_truth(methods: &mut [MethodFigures], runs: &[Run], known: &[KnownMatches<f64>]) {
    let rigs: Vec<Option<&Rig>> = runs
        .iter()
        .map(|run| run.fitted.as_ref().ok().map(|fitted| &fitted.rig))
        .collect();
    for known in known {
        let points: Vec<Option<Vec<Option<Vector3<f64>>>>> = rigs
            .iter()
            .map(|rig| {
                // Without a frame there is always a source.
                let source = RigSource::new((*rig)?, None)?;
                let point = |sightings: &Vec<_>| {
                    let found = source.point(sightings).ok()?;
                    Some(Vector3::from(found.point_mm))
                };
                Some(known.matches.iter().map(point).collect())
            })
            .collect();
        let is_common = |k: usize| points.iter().flatten().all(|own| own[k].is_some());
        for (figures, own) in methods.iter_mut().zip(&points) {
            let Some(own) = own else { continue };
            let common: Vec<PointWithTruth> = own
                .iter()
                .zip(&known.truth)
                .enumerate()
                .filter(|(k, _)| is_common(*k))
                .filter_map(|(_, (point, truth))| Some(truth.with((*point)?)))
                .collect();
            figures.truth.push(TruthFigures {
                file: known.file.clone(),
                unanswered: own.iter().filter(|point| point.is_none()).count(),
                errors: compare_with_truth(&common),
            });
        }
    }
}
