//! Scores and information of every effect of every view, with all that a fit moves eliminated: one
//! linearization judges any suspicion. Splines are held; what they would take on is seen when a
//! suspicion is fitted.

use super::effects::{COUNT, Shifts, shifts};
use super::suspicion::Suspicion;
use crate::adjust::Observations;
use crate::adjust::equations::elimination::Elimination;
use crate::adjust::model::Model;
use crate::adjust::objective::Weights;
use crate::adjust::observations::ViewBasis;
use crate::adjust::priors::Priors;
use nalgebra::{DMatrix, DVector, Vector2, Vector6};
use rayon::prelude::*;

/// The effects of one view, before anything is eliminated.
struct Own {
    pose_idx: usize,
    /// `B^T W r`.
    score: DVector<f64>,
    /// `B^T W B`.
    information: DMatrix<f64>,
    /// Effects by the pose's numbers, whitened: columns are effects.
    pose: DMatrix<f64>,
    /// Gradient by the pose's numbers, whitened.
    pose_gradient: Vector6<f64>,
}

/// What one linearization says of all effects.
pub struct Scores {
    views: Vec<Own>,
    /// All effects (columns) by the shared numbers, whitened.
    shared: DMatrix<f64>,
    /// Gradient by the shared numbers, whitened.
    shared_gradient: DVector<f64>,
}

impl Scores {
    /// Linearizes at a model with these weights (1/px^2).
    ///
    /// `None` if the data leave something of the model open.
    pub fn new(
        model: &Model,
        observations: &Observations,
        bases: &[ViewBasis],
        residuals: &[Vec<Option<Vector2<f64>>>],
        weights: &Weights,
        priors: &Priors,
    ) -> Option<Self> {
        let elimination = Elimination::new(model, observations, bases, weights, priors)?;
        let views: Vec<(Own, DMatrix<f64>)> = observations
            .views
            .par_iter()
            .enumerate()
            .map(|(view_idx, view)| {
                let basis = &bases[view_idx];
                let shifts: Vec<Option<Shifts>> = shifts(model, observations, view, basis);
                let columns = |corner: usize| shifts[corner];
                let (mut score, mut information) =
                    (DVector::zeros(COUNT), DMatrix::zeros(COUNT, COUNT));
                for (corner, weight) in weights[view_idx].iter().enumerate() {
                    let (Some(by), Some(residual)) = (shifts[corner], residuals[view_idx][corner])
                    else {
                        continue;
                    };
                    for a in 0..COUNT {
                        score[a] += weight * by[a].dot(&residual);
                        for b in 0..=a {
                            information[(a, b)] += weight * by[a].dot(&by[b]);
                        }
                    }
                }
                information.fill_upper_triangle_with_lower_triangle();
                let (pose, shared) = elimination.whitened(view_idx, COUNT, &columns);
                let own = Own {
                    pose_idx: view.pose_idx,
                    score,
                    information,
                    pose,
                    pose_gradient: elimination.pose_gradient(view.pose_idx),
                };
                (own, shared)
            })
            .collect();
        let mut shared = DMatrix::zeros(elimination.shared_len(), COUNT * views.len());
        for (view_idx, (_, own)) in views.iter().enumerate() {
            shared.columns_mut(COUNT * view_idx, COUNT).copy_from(own);
        }
        Some(Self {
            views: views.into_iter().map(|(own, _)| own).collect(),
            shared: elimination.whiten_shared(&shared),
            shared_gradient: elimination.shared_gradient(),
        })
    }

    /// Scores and information of a suspicion's numbers, in their units.
    pub fn of(&self, suspicion: &Suspicion) -> (DVector<f64>, DMatrix<f64>) {
        let count = suspicion.numbers.len();
        let mut score = DVector::zeros(count);
        let mut shared = DMatrix::zeros(self.shared.nrows(), count);
        // Per view that has a part: the number, and its share of each effect.
        let mut parts: Vec<Vec<(usize, DVector<f64>)>> = vec![Vec::new(); self.views.len()];
        for (k, (number, unit)) in suspicion.numbers.iter().zip(&suspicion.units).enumerate() {
            for (place, share) in number {
                let (view, effect) = (place / COUNT, place % COUNT);
                let share = share * unit;
                score[k] += share * self.views[view].score[effect];
                shared
                    .column_mut(k)
                    .axpy(share, &self.shared.column(*place), 1.0);
                match parts[view].last_mut() {
                    Some((number, shares)) if *number == k => shares[effect] += share,
                    _ => {
                        let mut shares = DVector::zeros(COUNT);
                        shares[effect] = share;
                        parts[view].push((k, shares));
                    }
                }
            }
        }
        // Where the fit is not at its minimum, the way there is taken off.
        score -= shared.tr_mul(&self.shared_gradient);
        let mut information = -shared.tr_mul(&shared);
        let poses = self.views.iter().map(|view| view.pose_idx).max();
        // What the numbers do to a pose, of all its views together.
        let mut by_pose: Vec<Vec<(usize, DVector<f64>)>> =
            vec![Vec::new(); poses.map_or(0, |last| last + 1)];
        for (own, parts) in self.views.iter().zip(&parts) {
            for (a, shares) in parts {
                let weighted = &own.information * shares;
                for (b, others) in parts {
                    information[(*a, *b)] += weighted.dot(others);
                }
                let pulled = &own.pose * shares;
                score[*a] -= pulled.dot(&own.pose_gradient);
                let of_pose = &mut by_pose[own.pose_idx];
                match of_pose.iter_mut().find(|(number, _)| number == a) {
                    Some((_, sum)) => *sum += pulled,
                    None => of_pose.push((*a, pulled)),
                }
            }
        }
        for of_pose in &by_pose {
            for (a, pulled) in of_pose {
                for (b, others) in of_pose {
                    information[(*a, *b)] -= pulled.dot(others);
                }
            }
        }
        (score, information)
    }
}
