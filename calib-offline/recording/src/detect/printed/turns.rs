//! The same numbering in every image of a target that looks the same after a turn.
//!
//! Each image has its columns counting to the right as nearly as can be. Where a board turns on from
//! pose to pose the numbering follows the pose before. A camera that shares poses with an earlier one is turned
//! against it by the same in all of them: of the turns that the target allows, the one under which all poses
//! share one epipolar geometry; where that decides nothing, cameras stand the same way up, if that is clear.

use super::found::{Found, PrintedTarget, quarter_turns};
use crate::dataset::Dataset;
use crate::dataset::target::turned;
use crate::detect::consistency::ConsistencyError;
use crate::detect::epipolar::FundamentalMatrix;
use crate::detect::job::Job;
use crate::detect::verdict::Refusal;
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::Corner;
use nalgebra::{Rotation2, Vector2};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// A choice between turns counts as clear if the second best is larger by this, rad.
const CLEAR_MARGIN_RAD: f64 = 30.0 * TAU / 360.0;
/// Epipolar geometry needs grids in so many planes.
const MIN_POSES: usize = 2;

/// Turns the labels of every image to the numbering of the others.
///
/// # Errors
/// [`ConsistencyError`] where nothing tells the turn from one camera to another.
pub(super) fn settle(
    target: &dyn PrintedTarget,
    dataset: &Dataset,
    jobs: &[Job<'_>],
    found: &mut [Result<Found, Refusal>],
) -> Result<(), ConsistencyError> {
    let numberings = target.numberings();
    if numberings == 1 {
        return Ok(());
    }
    let mut work = Turns {
        size: (dataset.board.rows, dataset.board.cols),
        step: 4 / numberings,
        jobs,
        found,
    };
    for camera_idx in 0..dataset.cameras.len() {
        let mut views: Vec<usize> = (0..jobs.len())
            .filter(|&k| jobs[k].camera_idx == camera_idx && work.found[k].is_ok())
            .collect();
        views.sort_by_key(|&k| jobs[k].pose);
        let shared = |other: usize| -> Vec<(usize, usize)> {
            let same = |k: usize, n: usize| {
                jobs[n].camera_idx == other && jobs[n].pose == jobs[k].pose && work.found[n].is_ok()
            };
            let at = |&k: &usize| Some((k, (0..jobs.len()).find(|&n| same(k, n))?));
            views.iter().filter_map(at).collect()
        };
        let pairs = (0..camera_idx)
            .map(|other| (other, shared(other)))
            .max_by_key(|(other, pairs)| (pairs.len(), std::cmp::Reverse(*other)))
            .filter(|(_, pairs)| !pairs.is_empty());
        let mut along = Vector2::x();
        if let Some((other, pairs)) = pairs {
            let turn = work.between(&pairs).map_err(|turn_rad| {
                let name = |camera: usize| dataset.cameras[camera].name.clone();
                ConsistencyError::CirclesBetweenCameras {
                    first_camera: name(other),
                    second_camera: name(camera_idx),
                    turn_deg: turn_rad.to_degrees(),
                    period_deg: 360.0 / f64::from(numberings),
                }
            })?;
            for &(k, n) in &pairs {
                let wanted = turned_by(work.along(n), turn);
                along = work.number(k, &wanted).unwrap_or(along);
            }
            views.retain(|k| !pairs.iter().any(|(paired, _)| paired == k));
        }
        for k in views {
            along = work.number(k, &along).unwrap_or(along);
        }
    }
    Ok(())
}

fn turned_by(along: Vector2<f64>, turn_rad: f64) -> Vector2<f64> {
    Rotation2::new(turn_rad) * along
}

struct Turns<'a, 'b> {
    size: (usize, usize),
    /// Quarter turns from one numbering to the next.
    step: u8,
    jobs: &'a [Job<'b>],
    found: &'a mut [Result<Found, Refusal>],
}

impl Turns<'_, '_> {
    /// Where a view's columns point: of length 1, or zero.
    fn along(&self, k: usize) -> Vector2<f64> {
        let found = self.found[k].as_ref();
        found.map_or_else(|_| Vector2::zeros(), |view| along_after(view, 0))
    }

    /// The quarter turns that number a view nearest to a direction.
    fn nearest(&self, k: usize, wanted: &Vector2<f64>) -> Option<(u8, Vector2<f64>)> {
        let view = self.found[k].as_ref().ok()?;
        (0..4 / self.step)
            .map(|turn| (turn * self.step, along_after(view, turn * self.step)))
            .max_by(|a, b| a.1.dot(wanted).total_cmp(&b.1.dot(wanted)))
    }

    /// Numbers a view with its columns nearest to a direction; where they point then.
    fn number(&mut self, k: usize, wanted: &Vector2<f64>) -> Option<Vector2<f64>> {
        let (quarters, along) = self.nearest(k, wanted)?;
        let view = self.found[k].as_mut().ok()?;
        relabel(&mut view.corners, self.size, quarters);
        view.quarter_turns = quarter_turns(&along);
        Some(along)
    }

    /// The turn from an earlier camera's images to this one's, rad, given views of the same poses.
    ///
    /// # Errors
    /// The smallest turn, if nothing decides.
    fn between(&self, pairs: &[(usize, usize)]) -> Result<f64, f64> {
        let numberings = 4 / self.step;
        // The mean turn up to one of the target's: its multiple is the same for all of them.
        let order = f64::from(numberings);
        let mut sum = Vector2::zeros();
        for &(k, n) in pairs {
            let (a, b) = (self.along(n), self.along(k));
            let turn = a.perp(&b).atan2(a.dot(&b)) * order;
            sum += Vector2::new(turn.cos(), turn.sin());
        }
        let first = sum.y.atan2(sum.x) / order;
        let mut turns: Vec<f64> = (0..numberings)
            .map(|k| {
                let turn = first + f64::from(k) * TAU / order;
                turn - TAU * (turn / TAU).round()
            })
            .collect();
        turns.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        if let Some(turn) = self.epipolar_choice(pairs, &turns) {
            return Ok(turn);
        }
        let (least, next) = (
            turns[0],
            turns.get(1).map_or(f64::INFINITY, |turn| turn.abs()),
        );
        if next - least.abs() >= CLEAR_MARGIN_RAD {
            Ok(least)
        } else {
            Err(least)
        }
    }

    /// The turn under which all poses share one epipolar geometry, if only one does.
    fn epipolar_choice(&self, pairs: &[(usize, usize)], turns: &[f64]) -> Option<f64> {
        let poses: std::collections::BTreeSet<usize> =
            pairs.iter().map(|&(k, _)| self.jobs[k].pose).collect();
        if turns.len() < 2 || poses.len() < MIN_POSES {
            return None;
        }
        let mut scored = Vec::new();
        let mut step_px = f64::INFINITY;
        for &turn in turns {
            let mut matches = Vec::new();
            for &(k, n) in pairs {
                let (quarters, _) = self.nearest(k, &turned_by(self.along(n), turn))?;
                let (view, other) = (self.found[k].as_ref().ok()?, self.found[n].as_ref().ok()?);
                step_px = step_px.min(view.figures.square_px);
                let known: BTreeMap<(usize, usize), PixelPoint> = other
                    .corners
                    .iter()
                    .map(|c| ((c.row, c.col), c.pixel))
                    .collect();
                matches.extend(view.corners.iter().filter_map(|c| {
                    let label = turned((c.row, c.col), self.size, quarters);
                    Some((*known.get(&label)?, c.pixel))
                }));
            }
            let fit = FundamentalMatrix::from_matches(&matches)?;
            scored.push((fit.median_distance_px(&matches)?, turn));
        }
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (best, second) = (scored.first()?, scored.get(1)?);
        ConsistencyError::is_clear(best.0, second.0, step_px).then_some(best.1)
    }
}

/// Where the columns point after so many quarter turns of the labels: of length 1, or zero.
fn along_after(view: &Found, quarters: u8) -> Vector2<f64> {
    let (along_col, along_row) = directions(&view.corners);
    // What was row 0 becomes the last column: the new columns count against the old rows.
    let along = match quarters % 4 {
        0 => along_col,
        1 => -along_row,
        2 => -along_col,
        _ => along_row,
    };
    along.try_normalize(0.0).unwrap_or_default()
}

/// Mean steps between neighbors along the columns and along the rows, px.
fn directions(corners: &[Corner]) -> (Vector2<f64>, Vector2<f64>) {
    let by_label: BTreeMap<(usize, usize), Vector2<f64>> = corners
        .iter()
        .map(|c| ((c.row, c.col), Vector2::new(c.pixel.u, c.pixel.v)))
        .collect();
    let step = |row: usize, col: usize| -> Vector2<f64> {
        by_label
            .iter()
            .filter_map(|(&(r, c), at)| Some(by_label.get(&(r + row, c + col))? - at))
            .sum()
    };
    (step(0, 1), step(1, 0))
}

fn relabel(corners: &mut [Corner], size: (usize, usize), quarters: u8) {
    for corner in corners.iter_mut() {
        (corner.row, corner.col) = turned((corner.row, corner.col), size, quarters);
    }
    corners.sort_unstable_by_key(|corner| (corner.row, corner.col));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relabelled_columns_point_where_it_was_said() {
        for quarters in [0, 2] {
            let mut corners: Vec<Corner> = (0..12)
                .map(|k| Corner {
                    row: k / 4,
                    col: k % 4,
                    pixel: PixelPoint::new(10.0 * (k % 4) as f64, 8.0 * (k / 4) as f64),
                    sigma_px: None,
                })
                .collect();
            let (along, _) = directions(&corners);
            let expected = if quarters == 0 { along } else { -along };
            relabel(&mut corners, (3, 4), quarters);
            assert_eq!(directions(&corners).0, expected);
        }
        // A quarter turn of a square grid.
        let mut corners: Vec<Corner> = (0..9)
            .map(|k| Corner {
                row: k / 3,
                col: k % 3,
                pixel: PixelPoint::new(10.0 * (k % 3) as f64, 10.0 * (k / 3) as f64),
                sigma_px: None,
            })
            .collect();
        let (_, along_row) = directions(&corners);
        relabel(&mut corners, (3, 3), 1);
        assert_eq!(directions(&corners).0, -along_row);
    }
}
