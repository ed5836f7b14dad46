//! Whether boards that the estimate never saw speak against what the evidence chose.
//!
//! The evidence takes a model at its word: that corners err as its noise says, and that boards are as it lets them be.
//! Boards that flex, mirror or shine in ways that no model has are explained by whatever is free, by offsets or
//! splines too. Views that no fold learned from are not. METHOD 2.7.

use super::held_out::{Fold, Folds};
use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::ObservedCorner;
use calib_estimate::adjust::robust::StudentT;
use calib_estimate::init::board_pose::residuals_with_one_pose;
use calib_estimate::joint::{Estimate, Simpler};
use calib_rays::board::BoardShape;
use calib_rays::field::Rig;
use calib_rays::observed::Corner;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Level of the test, one-sided: so often a model is dropped that is no worse on unseen boards.
pub const LEVEL: f64 = 0.01;
/// The standard normal quantile of that level.
const NORMAL_99: f64 = 2.326_347_9;
/// A mean difference of residuals below this share is nothing to act on, however regular it is.
const LEAST_LN_RATIO: f64 = 0.01;
/// Fewer unseen boards say nothing.
const FEWEST: usize = 5;
/// One fold in so many may say the opposite: boards of one fold share what its estimate errs by.
const FOLDS_PER_DISSENT: usize = 5;
/// Twice the log evidence by which a simpler model must be ahead for the estimate's own evidence to speak for it.
const OWN_GAIN: f64 = calib_estimate::joint::choice::NEEDED_GAIN;

/// The comparison with simpler models on boards that no fold learned from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ModelChoice {
    /// Unseen boards that were compared.
    pub boards: usize,
    /// RMS residual vector of their corners by the model that the evidence chose, px, one pose for all cameras.
    pub rms_px: f64,
    /// The simpler models.
    pub compared: Vec<Compared>,
}

/// A simpler model on the same boards.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Compared {
    /// What it does without.
    pub without: Simpler,
    /// RMS residual vector of the same corners, px.
    pub rms_px: f64,
    /// Mean over the boards of the logarithm of its RMS residual over that of the model chosen: below 0 if unseen
    /// boards are for the simpler one.
    pub ln_ratio: f64,
    /// The same in its own standard deviations.
    pub t: f64,
    /// Beyond this (either way) it is no chance.
    pub limit: f64,
    /// Twice the log evidence that the simpler model is ahead when all boards are fitted; `None` without an estimate.
    pub evidence_gain: Option<f64>,
    /// Whether it took the place of the model chosen.
    pub taken: bool,
}

impl Compared {
    /// Whether unseen boards, or the evidence itself without their objection, speak against what was chosen.
    fn speaks_against(&self, dissent: usize, folds: usize) -> bool {
        let unseen = self.t < -self.limit
            && self.ln_ratio < -LEAST_LN_RATIO
            && dissent * FOLDS_PER_DISSENT <= folds;
        let own = self.evidence_gain.is_some_and(|gain| gain > OWN_GAIN) && self.t <= self.limit;
        unseen || own
    }
}

/// What folds say to each simpler model; `None` where the model has nothing to do without, or there are too few
/// boards. If one takes the place of `whole`'s, the folds are made what it makes of them.
///
/// Cost: a few rounds for each simpler model, of the whole and of each fold.
pub fn model_choice(whole: &Estimate, folds: &mut Folds) -> Option<ModelChoice> {
    let simpler = Simpler::of(whole);
    if simpler.is_empty() {
        return None;
    }
    let found: Vec<FoldFound> = folds
        .estimated
        .par_iter()
        .map(|fold| FoldFound::of(fold, simpler, &whole.noise))
        .collect();
    let boards: usize = found.iter().map(|fold| fold.chosen.len()).sum();
    if boards < FEWEST {
        return None;
    }
    let gains: Vec<Option<f64>> = simpler
        .par_iter()
        .map(|simpler| Some(whole.without(*simpler).ok()?.evidence_gain))
        .collect();
    let mut best: Option<(f64, usize)> = None;
    let mut compared = Vec::new();
    for (k, without) in simpler.iter().enumerate() {
        let Some((one, dissent)) = compare(*without, k, &found, gains[k]) else {
            continue;
        };
        if one.speaks_against(dissent, found.len())
            && best.is_none_or(|(least, _)| one.ln_ratio < least)
        {
            best = Some((one.ln_ratio, compared.len()));
        }
        compared.push(one);
    }
    if let Some((_, at)) = best {
        compared[at].taken = true;
        let k = simpler.iter().position(|s| *s == compared[at].without);
        for (fold, found) in folds.estimated.iter_mut().zip(found.iter()) {
            let simpler = k.and_then(|k| found.simpler[k].as_ref());
            if let Some(Some((rig, board_shape))) = simpler.map(|s| &s.replaces) {
                fold.rig = rig.clone();
                fold.board_shape = board_shape.clone();
            }
        }
    }
    Some(ModelChoice {
        boards,
        rms_px: rms(found.iter().flat_map(|fold| &fold.chosen))?,
        compared,
    })
}

/// Corners of an unseen board that count, and the sum of their squared residuals.
#[derive(Debug, Clone, Copy)]
struct BoardError {
    corners: usize,
    sum_px2: f64,
}

/// A fold by the model chosen, and by each simpler one; boards in the same order.
struct FoldFound {
    chosen: Vec<BoardError>,
    /// `None` where it has no estimate.
    simpler: Vec<Option<SimplerFold>>,
}

struct SimplerFold {
    boards: Vec<BoardError>,
    /// What takes the place of the fold's own; `None` where that is as simple already.
    replaces: Option<(Rig, BoardShape)>,
}

impl FoldFound {
    fn of(fold: &Fold, simpler: &[Simpler], noise: &StudentT) -> Self {
        let chosen = residuals_px2(&fold.unseen, &fold.rig, &fold.rig, &fold.board_shape);
        let others: Vec<_> = simpler
            .iter()
            .map(|simpler| {
                let estimate = fold.joint.as_deref()?;
                if !simpler.changes(estimate) {
                    return Some((chosen.clone(), None));
                }
                let without = estimate.without(*simpler).ok()?.estimate;
                let rig = without.rig(&fold.unseen.numbered_cameras());
                let shape = without.model.board_shape.clone();
                let own = residuals_px2(&fold.unseen, &fold.rig, &rig, &shape);
                Some((own, Some((rig, shape))))
            })
            .collect();
        // A corner that is an outlier to every model says nothing of any.
        let is_outlier = |board: usize, corner: usize| {
            let all = others.iter().flatten().map(|(own, _)| own);
            let mut all = std::iter::once(&chosen).chain(all);
            all.all(|own| {
                let squared = own[board].as_ref().and_then(|b| b.get(corner));
                squared.is_none_or(|squared| noise.weight(*squared) == 0.0)
            })
        };
        // One that no pose fits for a model is no board for any.
        let is_board = |board: &usize| {
            let all = others.iter().flatten().map(|(own, _)| own);
            let mut all = std::iter::once(&chosen).chain(all);
            all.all(|own| own[*board].is_some())
        };
        let errors = |own: &[Option<Vec<f64>>]| -> Vec<BoardError> {
            let boards = (0..own.len()).filter(is_board);
            let errors = boards.map(|board| {
                let squared = own[board].iter().flatten().enumerate();
                let counted = squared.filter(|(corner, _)| !is_outlier(board, *corner));
                counted.fold(
                    BoardError {
                        corners: 0,
                        sum_px2: 0.0,
                    },
                    |sum, (_, squared)| BoardError {
                        corners: sum.corners + 1,
                        sum_px2: sum.sum_px2 + squared,
                    },
                )
            });
            errors.collect()
        };
        Self {
            chosen: errors(&chosen),
            simpler: others
                .iter()
                .map(|other| {
                    let (own, replaces) = other.as_ref()?;
                    Some(SimplerFold {
                        boards: errors(own),
                        replaces: replaces.clone(),
                    })
                })
                .collect(),
        }
    }
}

/// Squared residual vectors of each unseen board, px^2, with the best pose for all cameras together; `None` for one
/// without. Corners are those in the area that `covered` has calibrated.
fn residuals_px2(
    unseen: &Observations,
    covered: &Rig,
    rig: &Rig,
    shape: &BoardShape,
) -> Vec<Option<Vec<f64>>> {
    (0..unseen.poses.len())
        .map(|pose_idx| {
            let seen: Vec<(usize, Vec<Corner>)> = unseen
                .views
                .iter()
                .filter(|view| view.pose_idx == pose_idx)
                .map(|view| {
                    let coverage = &covered.cameras[view.camera_idx].coverage;
                    let corners = view.corners.iter();
                    let inside = corners.filter(|corner| coverage.contains(corner.pixel));
                    (
                        view.camera_idx,
                        inside.map(ObservedCorner::labelled).collect(),
                    )
                })
                .filter(|(_, corners): &(usize, Vec<Corner>)| {
                    corners.len() >= calib_estimate::init::MIN_CORNERS
                })
                .collect();
            let views: Vec<_> = seen
                .iter()
                .map(|(camera_idx, corners)| {
                    let camera = &rig.cameras[*camera_idx];
                    let camera_from_rig = camera.rig_from_camera.inverse();
                    (&camera.field, camera_from_rig, &corners[..])
                })
                .collect();
            let residuals = residuals_with_one_pose(&views, &unseen.board, shape)?;
            let all = residuals.into_iter().flatten();
            Some(all.map(|r| r.norm_squared()).collect())
        })
        .collect()
}

/// A simpler model against the one chosen, and how many folds are for the latter.
fn compare(
    without: Simpler,
    k: usize,
    found: &[FoldFound],
    evidence_gain: Option<f64>,
) -> Option<(Compared, usize)> {
    let mut ratios = Vec::new();
    let mut dissent = 0;
    for fold in found {
        let Some(simpler) = &fold.simpler[k] else {
            continue;
        };
        let boards = fold.chosen.iter().zip(&simpler.boards);
        let own: Vec<f64> = boards
            .filter(|(chosen, simpler)| chosen.sum_px2 > 0.0 && simpler.sum_px2 > 0.0)
            .map(|(chosen, simpler)| (simpler.sum_px2 / chosen.sum_px2).ln() / 2.0)
            .collect();
        dissent += usize::from(own.iter().sum::<f64>() > 0.0);
        ratios.extend(own);
    }
    if ratios.len() < FEWEST {
        return None;
    }
    let count = ratios.len() as f64;
    let ln_ratio = ratios.iter().sum::<f64>() / count;
    let squares: f64 = ratios.iter().map(|r| (r - ln_ratio).powi(2)).sum();
    let deviation = (squares / (count - 1.0) / count).sqrt();
    let compared = Compared {
        without,
        rms_px: rms(found
            .iter()
            .filter_map(|fold| fold.simpler[k].as_ref())
            .flat_map(|fold| &fold.boards))?,
        ln_ratio,
        t: if deviation > 0.0 {
            ln_ratio / deviation
        } else {
            0.0
        },
        limit: student_limit(count - 1.0),
        evidence_gain,
        taken: false,
    };
    Some((compared, dissent))
}

fn rms<'a>(boards: impl Iterator<Item = &'a BoardError>) -> Option<f64> {
    let (sum, corners) = boards.fold((0.0, 0), |(sum, corners), board| {
        (sum + board.sum_px2, corners + board.corners)
    });
    (corners > 0).then(|| (sum / corners as f64).sqrt())
}

/// The quantile of [`LEVEL`] of Student's t with so many degrees of freedom, by the expansion about the normal one
/// (Fisher 1941): to 1 % from four degrees of freedom on.
fn student_limit(freedom: f64) -> f64 {
    let z = NORMAL_99;
    let terms = [
        (z.powi(3) + z) / 4.0,
        (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0,
        (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0,
    ];
    let powers = terms.iter().zip(1..);
    z + powers
        .map(|(term, power)| term / freedom.powi(power))
        .sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_those_of_the_tables() {
        for (freedom, table) in [(4.0, 3.747), (9.0, 2.821), (23.0, 2.500), (1e6, 2.326)] {
            let found = student_limit(freedom);
            assert!((found / table - 1.0).abs() < 0.01, "{freedom}: {found}");
        }
    }

    fn folds(ratios: [[f64; 3]; 5]) -> Vec<FoldFound> {
        let board = |sum_px2: f64| BoardError {
            corners: 50,
            sum_px2,
        };
        let fold = |ratios: [f64; 3]| FoldFound {
            chosen: ratios.map(|_| board(1.0)).into(),
            simpler: vec![Some(SimplerFold {
                boards: ratios.map(|r| board((2.0 * r).exp())).into(),
                replaces: None,
            })],
        };
        ratios.map(fold).into()
    }

    fn speaks_against(ratios: [[f64; 3]; 5], gain: f64) -> bool {
        let found = folds(ratios);
        let (one, dissent) = compare(Simpler::NoOffsets, 0, &found, Some(gain)).unwrap();
        one.speaks_against(dissent, found.len())
    }

    #[test]
    fn what_unseen_boards_are_against_is_dropped_and_nothing_else() {
        let worse = [
            [-0.2, -0.1, -0.3],
            [-0.2, -0.3, -0.1],
            [-0.1, -0.2, -0.2],
            [-0.3, 0.0, -0.1],
            [-0.2, -0.1, -0.1],
        ];
        assert!(speaks_against(worse, -50.0));
        // Some boards for it, some against.
        let mixed = worse.map(|[a, b, c]| [a, -b, 0.5 * c]);
        assert!(!speaks_against(mixed, -50.0));
        // Two folds are for what was chosen.
        let mut dissenting = worse;
        dissenting[0] = [0.02; 3];
        dissenting[1] = [0.02; 3];
        assert!(!speaks_against(dissenting, -50.0));
        // Regular, and too small to matter.
        assert!(!speaks_against(worse.map(|f| f.map(|r| 0.01 * r)), -50.0));
        // The record's own evidence is for the simpler model, and unseen boards do not object; or they do.
        assert!(speaks_against([[0.001, -0.001, 0.0]; 5], 66.0));
        assert!(!speaks_against(worse.map(|f| f.map(|r| -r)), 66.0));
    }
}
