//! Where one camera stands against another, from the boards that both saw, and which of these
//! pairs of views say something else.
//!
//! Each view alone may look perfect and yet belong to another instant, or be numbered from the
//! other end of the board; only the pair shows it. A pair's misfit is what the best common board
//! costs both views over what each would like, px^2: `d^T (N_1^-1 + N_0^-1)^-1 d` with the
//! discrepancy d of the poses and their information N. For good pairs and perfect fields it is
//! the corner variance times a chi-square variable of 6 degrees of freedom; what fields lack at this
//! stage comes on top and is alike for all pairs. So the scale is that of the middle pair, and up
//! to half of all pairs may be wrong (least median of squares, a relative of RANSAC; METHOD section 3).

use super::board_pose::ViewFit;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{RigidTransform, so3};
use calib_rays::numerics::median;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// Median of a chi-square variable of 6 degrees of freedom.
const CHI_SQUARE_6_MEDIAN: f64 = 5.348;
/// A pair whose misfit is beyond so many standard deviations is none: far enough out that heavy
/// tails stay in, as for single corners.
pub const FINE_LIMIT_SIGMA: f64 = 8.0;
/// The same through cubic fields: what they lack has other tails than noise has (bumps, windows,
/// boards at the image's edge), and reaches 7 times the middle pair where there are few pairs. Only
/// pairs that would pull the estimate away must be found by then.
pub const COARSE_LIMIT_SIGMA: f64 = 20.0;
/// A misfit per corner below the corner noise itself (2 variances per axis: the length of a residual
/// vector) is none either: a bent board or uneven light does as much, and it harms no estimate.
const HARMLESS_VARIANCES: f64 = 2.0;
/// Pairs that propose a relative pose, and pairs that are asked about it, at most.
const MOST_PROPOSALS: usize = 40;
const MOST_ASKED: usize = 120;
/// Reading most pairs with the board turned is believed if it fits better by this factor (misfit
/// per corner: 9 in px^2 is 3 in px).
const TURNED_FACTOR: f64 = 9.0;
/// Degrees of freedom of the weights in the refinement, and its steps.
const FREEDOM: f64 = 4.0;
const STEPS: usize = 12;

/// Two views of one pose.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a> {
    /// By the camera that is placed already (frame `first`).
    pub first: &'a ViewFit,
    /// By the camera to place (frame `second`).
    pub second: &'a ViewFit,
}

/// What the pairs agree on.
#[derive(Debug, Clone)]
pub struct Consensus {
    /// Where the first camera is in the second's frame.
    pub second_from_first: RigidTransform,
    /// Variance per axis that explains the middle pair, px^2.
    pub variance_px2: f64,
    /// Per pair, in the order given.
    pub readings: Vec<Reading>,
    /// Root mean square over both views' corners of what the middle pair misses by, px.
    pub typical_px: f64,
}

/// How one pair fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Whether one of the two views is numbered from the other end of the board.
    pub is_turned: bool,
    /// Whether the pair fits, read so.
    pub fits: bool,
    /// Root mean square over both views' corners of what the pair misses by, px.
    pub misfit_px: f64,
}

/// The board turned by half a turn in its plane: from the frame of the labels that count from one
/// end to that of the labels that count from the other. Listed places have no other end: no turn.
pub fn half_turn(board: &BoardSpec) -> RigidTransform {
    if !board.layout.is_grid() {
        return RigidTransform::identity();
    }
    RigidTransform::new(
        Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0)),
        2.0 * board.center_in_board(),
    )
}

/// The relative pose that most pairs agree on, each read as numbered or half turned; `None`
/// without pairs. Pairs beyond `limit_sigma` do not fit.
pub fn consensus(board: &BoardSpec, pairs: &[Pair], limit_sigma: f64) -> Option<Consensus> {
    let turn = half_turn(board);
    let asked: Vec<Pair> = thinned(pairs, MOST_ASKED);
    let median_misfit = |second_from_first: &RigidTransform| {
        let mut turned_count = 0;
        let misfit_px2 = median(asked.iter().map(|pair| {
            let plain = pair.misfit_px2(second_from_first, None);
            let turned = pair.misfit_px2(second_from_first, Some(&turn));
            turned_count += usize::from(turned < plain);
            plain.min(turned)
        }));
        (misfit_px2.unwrap_or(0.0), 2 * turned_count > asked.len())
    };
    // The best proposal under which most pairs count as numbered, and as turned.
    let mut best: [Option<(f64, RigidTransform)>; 2] = [None, None];
    for pair in thinned(pairs, MOST_PROPOSALS) {
        let first_from_board = pair.first.camera_from_board;
        for board_turn in [RigidTransform::identity(), turn] {
            let proposal = pair.second.camera_from_board * board_turn * first_from_board.inverse();
            let (misfit, turned) = median_misfit(&proposal);
            let slot = &mut best[usize::from(turned)];
            if slot.as_ref().is_none_or(|(least, _)| misfit < *least) {
                *slot = Some((misfit, proposal));
            }
        }
    }
    let start = match best {
        [Some((plain, _)), Some((turned, proposal))] if TURNED_FACTOR * turned < plain => proposal,
        [Some((_, proposal)), _] | [None, Some((_, proposal))] => proposal,
        [None, None] => return None,
    };
    Some(refine(pairs, &turn, start, limit_sigma))
}

impl Pair<'_> {
    /// What the best common board costs both views, px^2. `board_turn`: the second view read as
    /// numbered from the other end.
    fn misfit_px2(
        &self,
        second_from_first: &RigidTransform,
        board_turn: Option<&RigidTransform>,
    ) -> f64 {
        self.discrepancy(second_from_first, board_turn)
            .map_or(f64::INFINITY, |(d, information)| d.dot(&(information * d)))
    }

    /// The second view's pose minus the one that the first view gives, in the second camera's
    /// frame, and the information on it (1/px^2 for corners of unit variance).
    fn discrepancy(
        &self,
        second_from_first: &RigidTransform,
        board_turn: Option<&RigidTransform>,
    ) -> Option<(Vector6<f64>, Matrix6<f64>)> {
        let expected = *second_from_first * self.first.camera_from_board;
        let mut found = self.second.camera_from_board;
        // The information refers to the origin of the labels; moved along when that moves.
        let mut moved = Matrix6::identity();
        if let Some(turn) = board_turn {
            let turned = found * *turn;
            let shift = turned.translation_mm - found.translation_mm;
            moved
                .fixed_view_mut::<3, 3>(3, 0)
                .copy_from(&-so3::skew(&shift));
            found = turned;
        }
        let mut d = Vector6::zeros();
        d.fixed_rows_mut::<3>(0)
            .copy_from(&so3::log(&(found.rotation * expected.rotation.transpose())));
        d.fixed_rows_mut::<3>(3)
            .copy_from(&(found.translation_mm - expected.translation_mm));
        let mut turned_axes = Matrix6::zeros();
        let rotation = &second_from_first.rotation;
        turned_axes.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
        turned_axes.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation);
        let first = self.first.information.try_inverse()?;
        let second = self.second.information.try_inverse()?;
        let covariance =
            moved * second * moved.transpose() + turned_axes * first * turned_axes.transpose();
        Some((d, covariance.try_inverse()?))
    }

    fn read(
        &self,
        second_from_first: &RigidTransform,
        turn: &RigidTransform,
        limit_px2: f64,
        harmless_px2: f64,
    ) -> Reading {
        let limit_px2 = limit_px2.max(harmless_px2 * self.corner_count() as f64);
        let plain = self.misfit_px2(second_from_first, None);
        let turned = self.misfit_px2(second_from_first, Some(turn));
        // As numbered if that fits at all; turned only if that fits.
        let is_turned = !(plain <= limit_px2) && turned <= limit_px2;
        let misfit = if is_turned { turned } else { plain };
        Reading {
            is_turned,
            fits: misfit <= limit_px2,
            misfit_px: self.per_corner_px(misfit),
        }
    }

    fn corner_count(&self) -> usize {
        self.first.corner_count + self.second.corner_count
    }

    fn per_corner_px(&self, misfit_px2: f64) -> f64 {
        (misfit_px2 / self.corner_count().max(1) as f64).sqrt()
    }

    fn corner_variance_px2(&self) -> f64 {
        self.first.variance_px2().max(self.second.variance_px2())
    }
}

/// Weighted least squares over all pairs, weights from the misfits.
fn refine(
    pairs: &[Pair],
    turn: &RigidTransform,
    start: RigidTransform,
    limit_sigma: f64,
) -> Consensus {
    let mut transform = start;
    // Corner noise alone makes pairs disagree by this much, though few pairs may not show it.
    let floor_px2 = median(pairs.iter().map(Pair::corner_variance_px2)).unwrap_or(0.0);
    let turn_of = |pair: &Pair, transform: &RigidTransform| {
        let plain = pair.misfit_px2(transform, None);
        (pair.misfit_px2(transform, Some(turn)) < plain).then_some(turn)
    };
    let scale = |transform: &RigidTransform| {
        let misfits_px2 = pairs
            .iter()
            .map(|pair| pair.misfit_px2(transform, turn_of(pair, transform)));
        (median(misfits_px2).unwrap_or(0.0) / CHI_SQUARE_6_MEDIAN).max(floor_px2)
    };
    for _ in 0..STEPS {
        let variance_px2 = scale(&transform);
        let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for pair in pairs {
            let Some((d, information)) = pair.discrepancy(&transform, turn_of(pair, &transform))
            else {
                continue;
            };
            let ratio = d.dot(&(information * d)) / variance_px2;
            let weight = if ratio > limit_sigma * limit_sigma {
                0.0
            } else {
                FREEDOM / (FREEDOM + ratio)
            };
            // A turn of the relative pose turns the expected pose and carries its origin along.
            let mut by_transform = Matrix6::identity();
            let arm = transform.direction(&pair.first.camera_from_board.translation_mm);
            by_transform
                .fixed_view_mut::<3, 3>(3, 0)
                .copy_from(&-so3::skew(&arm));
            normal += weight * by_transform.tr_mul(&(information * by_transform));
            right += weight * by_transform.tr_mul(&(information * d));
        }
        let Some(factor) = normal.cholesky() else {
            break;
        };
        let step = factor.solve(&right);
        transform = transform.stepped(&step).orthonormalized();
        if step.dot(&(normal * step)) < 1e-9 * variance_px2 {
            break;
        }
    }
    let variance_px2 = scale(&transform);
    let limit_px2 = limit_sigma * limit_sigma * variance_px2;
    let readings: Vec<Reading> = pairs
        .iter()
        .map(|pair| pair.read(&transform, turn, limit_px2, HARMLESS_VARIANCES * floor_px2))
        .collect();
    Consensus {
        second_from_first: transform,
        variance_px2,
        typical_px: median(readings.iter().map(|r| r.misfit_px)).unwrap_or(0.0),
        readings,
    }
}

/// At most so many, evenly spread.
fn thinned<'a>(pairs: &[Pair<'a>], most: usize) -> Vec<Pair<'a>> {
    let count = pairs.len().min(most);
    (0..count).map(|k| pairs[k * pairs.len() / count]).collect()
}
