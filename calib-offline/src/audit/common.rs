//! All calibrations on the corners that every one of them can answer, beside folds of our own estimate that never saw them.

use super::candidate::Candidate;
use super::record::{AgainstOurs, CommonFigures, rms};
use crate::compare::boards::{BoardScore, FoldScores, score_fold};
use crate::compare::bootstrap::ratio;
use calib_judge::held_out::{BoardErrors, Fold, Folds};

/// What was found.
pub(super) struct Common {
    pub corners: usize,
    pub ours: Option<CommonFigures>,
    /// Per candidate; `None` of those that do not take part, as nobody says how their cameras stand.
    pub theirs: Vec<(Option<CommonFigures>, Option<AgainstOurs>)>,
}

/// Judges all of them board by board.
pub(super) fn judge(folds: &Folds, candidates: &[Candidate]) -> Common {
    let takes_part = |candidate: &&Candidate| candidate.has_places;
    let mut scores: Vec<FoldScores> = Vec::new();
    for own in &folds.estimated {
        let theirs: Vec<Fold> = candidates
            .iter()
            .filter(takes_part)
            .map(|candidate| Fold {
                rig: candidate.rig.clone(),
                board_shape: candidate.board_shape.clone(),
                unseen: own.unseen.clone(),
                joint: None,
            })
            .collect();
        let all: Vec<&Fold> = std::iter::once(own).chain(&theirs).collect();
        scores.push(score_fold(&all, &own.unseen));
    }
    let of = |place: usize| -> Vec<&BoardScore> {
        let boards = scores.iter().flat_map(|fold| &fold.boards);
        boards.filter_map(|board| board.get(place)).collect()
    };
    let square_mm = folds
        .estimated
        .first()
        .map_or(0.0, |fold| fold.unseen.board.square_mm);
    let ours = of(0);
    let mut place = 0;
    let theirs = candidates
        .iter()
        .map(|candidate| {
            if !takes_part(&candidate) {
                return (None, None);
            }
            place += 1;
            let own = of(place);
            (figures(&own, square_mm), Some(against(&own, &ours)))
        })
        .collect();
    Common {
        corners: scores.iter().map(|fold| fold.common_count).sum(),
        ours: figures(&ours, square_mm),
        theirs,
    }
}

fn figures(boards: &[&BoardScore], square_mm: f64) -> Option<CommonFigures> {
    let mut errors = BoardErrors::default();
    let mut residuals_px = Vec::new();
    for board in boards {
        errors.add(board.boards.clone());
        residuals_px.extend_from_slice(&board.residuals_px);
    }
    (!boards.is_empty()).then(|| CommonFigures {
        rms_px: rms(&residuals_px),
        neighbor_rms_mm: rms(&errors.neighbor_errors).map(|share| share * square_mm),
        rigid_rms_mm: rms(&errors.rigid_errors_mm),
    })
}

fn against(own: &[&BoardScore], ours: &[&BoardScore]) -> AgainstOurs {
    let of = |errors: fn(&BoardScore) -> &[f64]| {
        let [own, ours] =
            [own, ours].map(|boards| boards.iter().map(|board| errors(board)).collect::<Vec<_>>());
        ratio(&own, &ours)
    };
    AgainstOurs {
        residual: of(|board| &board.residuals_px),
        neighbor: of(|board| &board.boards.neighbor_errors),
        rigid: of(|board| &board.boards.rigid_errors_mm),
    }
}
