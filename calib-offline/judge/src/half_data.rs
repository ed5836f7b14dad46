//! Two calibrations from two halves of the poses: do they differ as much as they say they may?
//!
//! Both halves triangulate the same exact pixels, so noise of the pixels has no part in it, and the
//! rigid motion between the two rigs is taken out. A camera alone measures no points; its rays are
//! compared where they pass at the working distance. What remains has a predicted covariance, the
//! sum of both halves' own. A ratio above what chance allows means that the estimate does not know
//! how uncertain it is: errors that go together, a model that does not fit, a board or camera that
//! moved. What both halves have in common cancels and is **not** seen: a wrong square size, a
//! board that bends the same way in every pose, a camera that moved once between two placements.
//!
//! The prediction counts what smoothness holds as uncertain in each half, but both halves hold it
//! alike: where the lens has detail that the data hardly determine, the ratio falls below 1. On
//! simulated rigs (8 draws each, BENCHMARKS.md) its RMS is 0.98 for a plain lens, 1.02 behind flat
//! ports, 0.72 with weak and 0.60 with strong local distortion.

use super::agreement::BY_CHANCE_SD;
use super::held_out::Dealt;
use super::working_volume::{Match, compare, lattice, matches_at};
use calib_estimate::adjust::Observations;
use calib_estimate::joint::Estimate;
use calib_estimate::joint::point_covariance::{across_motions, without_motions};
use calib_rays::field::{RayField, Rig, transport};
use calib_rays::geometry::PixelPoint;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Fewer poses are not halved: five hold no flexible field.
pub const MIN_POSES: usize = 10;

/// A check that only finds errors of so many times what is predicted is none.
const SHOWS_NOTHING: f64 = 3.0;

/// How the poses are divided in two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    /// Every other one: what changes with time is in both halves.
    InTurn,
    /// The first half of the recording and the second.
    ByTime,
    /// By placement of the stage.
    ByPlacement,
}

impl Split {
    /// In words.
    pub const fn word(self) -> &'static str {
        match self {
            Self::InTurn => "halves dealt in turn",
            Self::ByTime => "first and second half",
            Self::ByPlacement => "halves by placement",
        }
    }
}

/// The check, or why there is none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HalfDataCheck {
    /// It was made.
    Compared(HalfData),
    /// It was not.
    Skipped(Skipped),
}

/// Why the halves were not compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Skipped {
    /// Nobody asked for it.
    NotWanted,
    /// Fewer poses than [`MIN_POSES`].
    TooFewPoses {
        /// How many there are.
        have: usize,
        /// How many it takes.
        need: usize,
    },
    /// A half of the poses leaves a parameter open.
    NoEstimate,
    /// The halves have no calibrated pixels in common that see the same points.
    NoCommonPoints,
}

/// What two halves of the poses say of each other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HalfData {
    /// Poses of each half.
    pub poses: [usize; 2],
    /// Points compared, at the working distance; of a camera alone, rays where they pass there.
    pub points: usize,
    /// RMS distance between the two halves' points (or rays), mm.
    pub difference_rms_mm: f64,
    /// What it was to be by both halves' covariances, mm.
    pub predicted_rms_mm: f64,
    /// The first over the second.
    pub ratio: f64,
    /// Number of independent ways in which the difference can vary, to judge the ratio by: few, as
    /// a field errs smoothly.
    pub modes: f64,
    /// Where the ratio falls by chance in 999 of 1000 cases if the covariances are right.
    pub ratio_by_chance: [f64; 2],
}

impl HalfData {
    /// Whether the halves differ by more than chance explains.
    pub fn is_larger(&self) -> bool {
        self.ratio > self.ratio_by_chance[1]
    }

    /// Whether even a difference of so many times the prediction would be chance: then the check shows
    /// nothing.
    pub fn shows_nothing(&self) -> bool {
        self.ratio_by_chance[1] > SHOWS_NOTHING
    }

    /// Whether they differ by less.
    pub fn is_smaller(&self) -> bool {
        self.ratio < self.ratio_by_chance[0]
    }
}

/// Number of points or rays, RMS of their difference (mm) and its predicted covariance (mm^2).
type Differing = (usize, f64, DMatrix<f64>);

/// What the first half has; the second has the rest.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FirstHalf {
    /// These poses, by number.
    Poses(BTreeSet<usize>),
    /// Every other point of the target: where too few poses leave none to spare.
    EveryOtherPoint,
}

/// The two halves of some poses.
#[derive(Debug)]
pub struct Halves {
    /// Their estimates.
    pub estimates: [Estimate; 2],
    /// The rigs that these gave.
    pub rigs: [Rig; 2],
}

/// The ways to divide some poses (by number), each with the poses of its first half. In turn means every
/// other one of each placement, in the order of their numbers, so that both halves have all angles and
/// all placements; poses without a placement count as one. Placements that follow each other in time
/// divide as time does, and count once.
pub fn splits(
    poses: impl IntoIterator<Item = usize>,
    placement: impl Fn(usize) -> Option<usize>,
) -> Vec<(Split, BTreeSet<usize>)> {
    let poses: BTreeSet<usize> = poses.into_iter().collect();
    let half = poses.len().div_ceil(2);
    let by_time: BTreeSet<usize> = poses.iter().copied().take(half).collect();
    let mut by_placement: Vec<usize> = poses.into_iter().collect();
    by_placement.sort_by_key(|pose| (placement(*pose), *pose));
    let in_turn = by_placement.iter().copied().step_by(2).collect();
    let mut splits = vec![(Split::InTurn, in_turn), (Split::ByTime, by_time.clone())];
    // Whole placements, as many as make up half.
    let of = |at: usize| by_placement.get(at).map(|pose| placement(*pose));
    let last = of(half.saturating_sub(1));
    let first: BTreeSet<usize> = (0..by_placement.len())
        .filter(|at| of(*at) <= last)
        .map(|at| by_placement[at])
        .collect();
    if first.len() < by_placement.len() && first != by_time {
        splits.push((Split::ByPlacement, first));
    }
    splits
}

/// The ways to divide what an estimate used: its poses ([`splits`]), or its points where a pose may stand alone.
pub fn first_halves(
    used: &Observations,
    placement: impl Fn(usize) -> Option<usize>,
) -> Vec<(Split, FirstHalf)> {
    if Dealt::of(used) == Some(Dealt::Points) {
        return vec![(Split::InTurn, FirstHalf::EveryOtherPoint)];
    }
    let splits = splits(used.poses.iter().copied(), placement).into_iter();
    splits
        .map(|(split, first)| (split, FirstHalf::Poses(first)))
        .collect()
}

/// Estimates both halves, as `Estimate::of_poses` does.
///
/// Cost: less than one estimate, the two in parallel.
///
/// # Errors
/// Why there are none.
pub fn estimate_halves(estimate: &Estimate, first: &FirstHalf) -> Result<Halves, Skipped> {
    if matches!(first, FirstHalf::Poses(_))
        && estimate.observations.different_pose_count() < MIN_POSES
    {
        return Err(Skipped::TooFewPoses {
            have: estimate.observations.different_pose_count(),
            need: MIN_POSES,
        });
    }
    let mut estimates: Vec<Estimate> = [true, false]
        .into_par_iter()
        .map(|half| {
            let part = match first {
                FirstHalf::Poses(first) => estimate.of_poses(|pose| first.contains(&pose) == half),
                FirstHalf::EveryOtherPoint => {
                    estimate.of_points(|row, col| (row + col).is_multiple_of(2) == half)
                }
            };
            part.ok()
        })
        .collect::<Option<_>>()
        .ok_or(Skipped::NoEstimate)?;
    let (Some(b), Some(a)) = (estimates.pop(), estimates.pop()) else {
        return Err(Skipped::NoEstimate);
    };
    let names: Vec<String> = (0..a.model.cameras.len()).map(|k| k.to_string()).collect();
    let rigs = [a.rig(&names), b.rig(&names)];
    Ok(Halves {
        estimates: [a, b],
        rigs,
    })
}

impl Halves {
    /// Compares the points of both halves at some distances of the whole estimate's first camera; of a
    /// camera alone, its rays at the middle one.
    ///
    /// # Errors
    /// Why there is nothing to compare.
    pub fn compared(&mut self, whole: &Rig, distances_mm: &[f64]) -> Result<HalfData, Skipped> {
        let (points, difference_rms_mm, covariance) = if whole.cameras.len() > 1 {
            self.points(whole, distances_mm)?
        } else {
            let middle = distances_mm.get(distances_mm.len() / 2);
            self.rays(whole, *middle.ok_or(Skipped::NoCommonPoints)?)?
        };
        let total = covariance.trace();
        let modes = total * total / covariance.norm_squared();
        let predicted_rms_mm = (total / points as f64).sqrt();
        let ratio = difference_rms_mm / predicted_rms_mm;
        if !ratio.is_finite() {
            return Err(Skipped::NoCommonPoints);
        }
        Ok(HalfData {
            poses: [0, 1].map(|k| self.estimates[k].observations.different_pose_count()),
            points,
            difference_rms_mm,
            predicted_rms_mm,
            ratio,
            modes,
            ratio_by_chance: [-BY_CHANCE_SD, BY_CHANCE_SD].map(|z| ratio_quantile(modes, z)),
        })
    }

    /// Number of points compared, RMS of their difference, and its covariance.
    fn points(&mut self, whole: &Rig, distances_mm: &[f64]) -> Result<Differing, Skipped> {
        let matches = matches_at(whole, distances_mm);
        let [rig_a, rig_b] = &self.rigs;
        let compared = compare(rig_a, rig_b, &matches).ok_or(Skipped::NoCommonPoints)?;
        let covariance = self
            .predicted(&compared.matches, &compared.first_from_second.rotation)
            .ok_or(Skipped::NoEstimate)?;
        let difference = compared.difference;
        Ok((difference.points, difference.rms_mm, covariance))
    }

    /// The same of the first camera's rays.
    fn rays(&mut self, whole: &Rig, distance_mm: f64) -> Result<Differing, Skipped> {
        let [rig_a, rig_b] = &self.rigs;
        let cameras = (
            whole.cameras.first(),
            rig_a.cameras.first(),
            rig_b.cameras.first(),
        );
        let (Some(camera), Some(a), Some(b)) = cameras else {
            return Err(Skipped::NoCommonPoints);
        };
        let both = |pixel: &PixelPoint| a.coverage.contains(*pixel) && b.coverage.contains(*pixel);
        let mut pixels = lattice(&camera.coverage, 1.0);
        pixels.retain(both);
        let apart = rays_apart(&a.field, &b.field, &pixels, distance_mm);
        let apart = apart.ok_or(Skipped::NoCommonPoints)?;
        let [estimate_a, estimate_b] = &mut self.estimates;
        // Both covariances are along the axes across the same rays, whatever the rigs' frames.
        let own = estimate_a.ray_covariance(rig_a, 0, &pixels, distance_mm);
        let other = estimate_b.ray_covariance(rig_b, 0, &pixels, distance_mm);
        let (Ok(Some(own)), Ok(Some(other))) = (own, other) else {
            return Err(Skipped::NoEstimate);
        };
        let rms_mm = (apart.norm_squared() / pixels.len() as f64).sqrt();
        Ok((pixels.len(), rms_mm, own + other))
    }

    /// Covariance of the difference, in the first half's frame.
    fn predicted(
        &mut self,
        matches: &[Match],
        first_from_second: &nalgebra::Matrix3<f64>,
    ) -> Option<DMatrix<f64>> {
        let [a, b] = &mut self.estimates;
        let [rig_a, rig_b] = &self.rigs;
        let mut sum = a.point_covariance(rig_a, matches).ok()??;
        let other = b.point_covariance(rig_b, matches).ok()??;
        for row in (0..sum.nrows()).step_by(3) {
            for column in (0..sum.ncols()).step_by(3) {
                let own = other.fixed_view::<3, 3>(row, column);
                let mut target = sum.fixed_view_mut::<3, 3>(row, column);
                target += first_from_second * own * first_from_second.transpose();
            }
        }
        Some(sum)
    }
}

/// How far the second field's rays pass from points on the first's, along the axes across the
/// rays, the best rigid motion of the camera taken out, mm; `None` of too few pixels.
pub fn rays_apart(
    first: &RayField,
    second: &RayField,
    pixels: &[PixelPoint],
    distance_mm: f64,
) -> Option<DVector<f64>> {
    let mut apart = DVector::zeros(2 * pixels.len());
    let mut motions = DMatrix::zeros(2 * pixels.len(), 6);
    for (k, pixel) in pixels.iter().enumerate() {
        let ray = first.ray(*pixel);
        let point = ray.origin_mm + ray.direction.normalize() * distance_mm;
        let sample = second.sample(*pixel);
        let axes = transport::across(&sample.s);
        apart
            .fixed_rows_mut::<2>(2 * k)
            .copy_from(&(axes.tr_mul(&point) - sample.m_mm));
        let across = across_motions(&axes, &point);
        motions.view_mut((2 * k, 0), (2, 6)).copy_from(&across);
    }
    Some(without_motions(&motions)? * apart)
}

/// Quantile of the ratio of an RMS to its expectation at `z` standard deviations, for a sum of
/// squares with so many independent modes (Wilson and Hilferty's form of chi-square).
fn ratio_quantile(modes: f64, z: f64) -> f64 {
    let spread = 2.0 / (9.0 * modes);
    (1.0 - spread + z * spread.sqrt()).max(0.0).powf(1.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_alternate_within_placements_and_are_even() {
        // Two placements of five, recorded in turn.
        let found = splits(0..10, |pose| Some(pose % 2));
        assert_eq!(
            found,
            [
                (Split::InTurn, BTreeSet::from([0, 4, 8, 3, 7])),
                (Split::ByTime, BTreeSet::from([0, 1, 2, 3, 4])),
                (Split::ByPlacement, BTreeSet::from([0, 2, 4, 6, 8])),
            ]
        );
        // Placements in time's order, and none.
        assert_eq!(splits(0..10, |pose| Some(pose / 5)).len(), 2);
        let free = splits([9, 3, 5, 3], |_| None);
        assert_eq!(free[0], (Split::InTurn, BTreeSet::from([3, 9])));
        assert_eq!(free[1], (Split::ByTime, BTreeSet::from([3, 5])));
        assert_eq!(free.len(), 2);
    }

    #[test]
    fn chance_is_that_of_chi_square() {
        // Chi-square of 10: 2.5 % lie below 3.247 and 2.5 % above 20.483.
        const NORMAL_95: f64 = 1.96;
        assert!((ratio_quantile(10.0, -NORMAL_95) - 0.3247_f64.sqrt()).abs() < 3e-3);
        assert!((ratio_quantile(10.0, NORMAL_95) - 2.0483_f64.sqrt()).abs() < 3e-3);
        // One mode: a normal variable's size, 2.241 (the formula gives 2.22).
        assert!((ratio_quantile(1.0, NORMAL_95) - 2.241).abs() < 0.03);
        assert!(ratio_quantile(1.0, -NORMAL_95) < 0.04);
    }
}
