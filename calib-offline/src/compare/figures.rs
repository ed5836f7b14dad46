//! The figures of each method from its rigs: each over what all methods have.

use super::answer::Answer;
use super::boards::{BoardScore, FoldScores, score_fold};
use super::bootstrap;
use super::record::{HeldOutFigures, MethodFigures, Ratios, Training, TruthFigures};
use super::run::Run;
use calib_blob::matches::KnownMatches;
use calib_estimate::adjust::Observations;
use calib_estimate::reprojection::residuals;
use calib_judge::Folds;
use calib_judge::held_out::{BoardErrors, Fold};
use calib_judge::known_points::{Points, beside_truth, compare_with_truth, measure};
use calib_rays::geometry::RigidTransform;
use calib_rays::measure::RigSource;
use calib_rays::numerics::rms;

/// Median distance of the boards' middles from the first camera, mm.
pub(super) fn working_distance_mm(answer: &Answer, observations: &Observations) -> Option<f64> {
    let camera = answer.rig.cameras.first()?;
    let middle = observations.board.center_in_board();
    let mut distances: Vec<f64> = answer
        .rig_from_board
        .iter()
        .flatten()
        .map(|pose| (pose.point(&middle) - camera.rig_from_camera.translation_mm).norm())
        .collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied()
}

/// Residuals of the corners that every method uses.
pub(super) fn add_training(
    methods: &mut [MethodFigures],
    runs: &[Run],
    observations: &Observations,
) {
    let standing = runs
        .iter()
        .filter_map(|run| run.answer.as_ref().ok())
        .map(|answer| used_residuals_px(answer, observations));
    let lengths: Vec<Vec<Option<f64>>> = standing.collect();
    let is_common = |k: usize| {
        lengths
            .iter()
            .all(|own| own.get(k).is_some_and(Option::is_some))
    };
    let mut of_standing = lengths.iter();
    for (figures, run) in methods.iter_mut().zip(runs) {
        if run.answer.is_err() {
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
fn used_residuals_px(answer: &Answer, observations: &Observations) -> Vec<Option<f64>> {
    let poses: Vec<RigidTransform> = answer
        .rig_from_board
        .iter()
        .map(|pose| pose.unwrap_or_else(RigidTransform::identity))
        .collect();
    let found = residuals(&answer.rig, &poses, &answer.board_shape, observations);
    let mut lengths = Vec::with_capacity(observations.corner_count());
    for ((view, residuals), is_used) in observations.views.iter().zip(found).zip(&answer.is_used) {
        let is_placed = answer.rig_from_board[view.pose_idx].is_some();
        for (residual, is_used) in residuals.iter().zip(is_used) {
            let residual = residual.filter(|_| *is_used && is_placed);
            lengths.push(residual.map(|residual| residual.norm()));
        }
    }
    lengths
}

/// The observations without the corners that every method rejects although it has seen them: a wrong
/// corner says nothing of a method. What one method alone cannot explain stays, so that none is
/// excused from the part of the image where it fails.
pub(super) fn without_outliers(runs: &[Run], observations: &Observations) -> Observations {
    let is_used: Vec<&Vec<Vec<bool>>> = runs
        .iter()
        .filter_map(|run| Some(&run.answer.as_ref().ok()?.is_used))
        .collect();
    let mut kept = observations.clone();
    for (view_idx, view) in kept.views.iter_mut().enumerate() {
        let mut corner_idx = 0;
        view.corners.retain(|_| {
            let somebody = is_used.iter().any(|used| used[view_idx][corner_idx]);
            corner_idx += 1;
            somebody
        });
    }
    kept
}

/// Held-out figures of the methods that answer at least half of the folds, from the folds that all
/// of these answer, over the corners of `judged`. Returns the scores, per fold.
pub(super) fn add_held_out(
    methods: &mut [MethodFigures],
    runs: &[Run],
    folds: usize,
    judged: &Observations,
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
        .map(|folds: Vec<&Fold>| {
            let is_unseen = |pose: usize| folds.iter().all(|f| f.unseen.poses.contains(&pose));
            score_fold(&folds, &judged.with_poses(is_unseen))
        })
        .collect();
    let mut first: Option<usize> = None;
    let mut place = 0;
    for (index, (figures, run)) in methods.iter_mut().zip(runs).enumerate() {
        if !takes_part(&run) {
            continue;
        }
        let own = of_method(&scores, place);
        let unanswered = scores.iter().map(|fold| fold.unanswered[place]).sum();
        figures.held_out =
            (!own.is_empty()).then(|| of_boards(&own, unanswered, judged.board.square_mm));
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

/// Points of matches whose truth is known, where every method has one.
pub(super) fn add_truth(methods: &mut [MethodFigures], runs: &[Run], known: &[KnownMatches<f64>]) {
    // Without a frame there is always a source.
    let sources: Vec<Option<RigSource>> = runs
        .iter()
        .map(|run| RigSource::new(&run.answer.as_ref().ok()?.rig, None))
        .collect();
    for known in known {
        let points: Vec<Option<Points>> = sources
            .iter()
            .map(|source| Some(measure(source.as_ref()?, &known.matches)))
            .collect();
        let is_common = |k: usize| points.iter().flatten().all(|own| own[k].is_some());
        for (figures, own) in methods.iter_mut().zip(&points) {
            let Some(own) = own else { continue };
            figures.truth.push(TruthFigures {
                file: known.file.clone(),
                unanswered: own.iter().filter(|point| point.is_none()).count(),
                errors: compare_with_truth(&beside_truth(own, &known.truth, is_common)),
            });
        }
    }
}
