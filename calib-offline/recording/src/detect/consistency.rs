//! The same corner gets the same label in every image of every camera.
//!
//! One image often leaves a choice: a board that looks the same turned by 180 degrees, a part of a
//! board that fits in several places. What decides, in this order: the colors of the squares; the
//! neighboring poses, between which the board turns only a little in the image; the other cameras,
//! towards which the board's turn is the same in all poses and which must share one epipolar
//! geometry. What nothing decides is refused or an error, never guessed.

mod parts;

use super::epipolar::{FundamentalMatrix, Match};
use super::grid::FittedGrid;
use super::labelling::{Placement, fixed_color};
use crate::dataset::StageSpec;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector2;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// A grid in an image with the places on the board that it may have.
#[derive(Debug, Clone)]
pub struct UnsettledView {
    /// Index into the dataset's cameras.
    pub camera_idx: usize,
    /// Number of the pose.
    pub pose: usize,
    /// The corners.
    pub grid: FittedGrid,
    /// Where they may lie on the board.
    pub placements: Vec<Placement>,
}

/// Why images cannot be numbered alike.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConsistencyError {
    /// The board turned too far between two poses of one stage placement.
    #[error(
        "the board looks the same after a turn of {period_deg:.0} degrees, and between poses \
         {earlier_pose} and {pose} of camera {camera} it turned by about {turn_deg:.0}, so \
         that its numbering cannot be carried over; record poses between them, leave one of them \
         out (exclude), use a board with one odd and one even count of inner corners, or give \
         labelled corners in corners.csv"
    )]
    TurnBetweenPoses {
        /// Name of the camera.
        camera: String,
        /// The pose whose numbering is known.
        earlier_pose: usize,
        /// The pose that cannot be decided.
        pose: usize,
        /// Smallest turn between them that one of the numberings allows, degrees.
        turn_deg: f64,
        /// Turn after which the board looks the same, degrees.
        period_deg: f64,
    },
    /// The turn of a grid of circles from one camera to another cannot be told.
    #[error(
        "the grid looks the same after a turn of {period_deg:.0} degrees, and from camera {first_camera} to camera \
         {second_camera} it is turned by about {turn_deg:.0}, so that it is unclear which circles belong together; \
         mark some of them (direction), or add poses that tilt the grid in different directions"
    )]
    CirclesBetweenCameras {
        /// Name of the camera whose numbering is known.
        first_camera: String,
        /// The camera that cannot be decided.
        second_camera: String,
        /// Smallest turn between the cameras that one of the numberings allows, degrees.
        turn_deg: f64,
        /// Turn after which the grid looks the same, degrees.
        period_deg: f64,
    },
    /// The turn from one camera to another cannot be told.
    #[error(
        "the board looks the same after a turn of {period_deg:.0} degrees, and from camera \
         {first_camera} to camera {second_camera} it is turned by about {turn_deg:.0} \
         (pose {pose}), so that it is unclear which corners belong together; add poses that tilt \
         the board in different directions, use a board with one odd and one even count of inner \
         corners, or give labelled corners in corners.csv"
    )]
    TurnBetweenCameras {
        /// The camera whose numbering is known.
        first_camera: String,
        /// The camera that cannot be decided.
        second_camera: String,
        /// A pose that shows it.
        pose: usize,
        /// Smallest turn between the cameras that one of the numberings allows, degrees.
        turn_deg: f64,
        /// Turn after which the board looks the same, degrees.
        period_deg: f64,
    },
}

impl ConsistencyError {
    /// Epipolar geometry decides between turns of a camera if the best of the distances (px) is clearly the
    /// least; `step_px` from one point to the next.
    pub(super) fn is_clear(best_px: f64, second_px: f64, step_px: f64) -> bool {
        best_px <= EPIPOLAR_SQUARES * step_px
            && second_px >= (EPIPOLAR_FACTOR * best_px).max(EPIPOLAR_FLOOR_PX)
    }
}

/// A choice between turns counts as clear if the second best fits worse by this, rad.
const CLEAR_MARGIN_RAD: f64 = 30.0 * TAU / 360.0;
/// Epipolar geometry decides if the second best fits worse by this factor, and ...
const EPIPOLAR_FACTOR: f64 = 3.0;
/// ... the best stays within this part of a square.
const EPIPOLAR_SQUARES: f64 = 0.25;
/// ... and the second best exceeds what corner noise alone can do (boards that turn about a fixed
/// middle, far away, nearly fit after a half turn too).
const EPIPOLAR_FLOOR_PX: f64 = 0.5;
/// Epipolar geometry needs boards in at least this many planes.
const EPIPOLAR_POSES: usize = 2;
/// Fewest corners two views must share to be compared.
const MIN_SHARED: usize = 4;

/// Settles every view: its placement, or `None` if nothing decides between several or none has
/// the right colors.
///
/// # Errors
/// [`ConsistencyError`] if the numbering of a board that looks the same after a turn cannot be
/// carried through the poses of a stage or from one camera to another.
pub fn settle(
    board: &BoardSpec,
    stage: Option<&StageSpec>,
    camera_names: &[&str],
    mut views: Vec<UnsettledView>,
) -> Result<Vec<(UnsettledView, Option<Placement>)>, ConsistencyError> {
    keep_right_colors(board, &mut views);
    let mut work = Settling {
        board,
        stage,
        camera_names,
        chosen: vec![None; views.len()],
        views,
    };
    let camera_count = work
        .views
        .iter()
        .map(|v| v.camera_idx + 1)
        .max()
        .unwrap_or(0);
    for camera_idx in 0..camera_count {
        match work.best_reference(camera_idx) {
            Some(reference) => work.follow_camera(camera_idx, reference)?,
            None => work.follow_poses(camera_idx)?,
        }
    }
    work.place_parts();
    Ok(work.views.into_iter().zip(work.chosen).collect())
}

/// The color that the square before the first corner must have: fixed by convention, or what most
/// views with one possible color say.
fn keep_right_colors(board: &BoardSpec, views: &mut [UnsettledView]) {
    let required = fixed_color(board).or_else(|| {
        let mut balance = 0i64;
        for view in views.iter() {
            let dark = |p: &Placement| p.dark_before_first_corner(&view.grid);
            let dark_count = view.placements.iter().filter(|p| dark(p)).count();
            if dark_count == view.placements.len() {
                balance += i64::from(dark_count > 0);
            } else if dark_count == 0 {
                balance -= 1;
            }
        }
        (balance != 0).then_some(balance > 0)
    });
    if let Some(required) = required {
        for view in views {
            let grid = &view.grid;
            view.placements
                .retain(|p| p.dark_before_first_corner(grid) == required);
        }
    }
}

struct Settling<'a> {
    board: &'a BoardSpec,
    camera_names: &'a [&'a str],
    stage: Option<&'a StageSpec>,
    views: Vec<UnsettledView>,
    chosen: Vec<Option<Placement>>,
}

impl Settling<'_> {
    /// Views of a camera in which only the numbering is open: their placements are turns of one another.
    fn only_turn_open(&self, camera_idx: usize) -> Vec<usize> {
        let mut found: Vec<usize> = (0..self.views.len())
            .filter(|&k| {
                let view = &self.views[k];
                let is_one_place = view.placements.first().is_some_and(|first| {
                    let mut all = view.placements.iter();
                    all.all(|p| p.is_turn_of(first, self.board))
                });
                view.camera_idx == camera_idx && is_one_place
            })
            .collect();
        found.sort_unstable_by_key(|&k| self.views[k].pose);
        found
    }

    fn name(&self, camera_idx: usize) -> String {
        self.camera_names
            .get(camera_idx)
            .map_or_else(|| camera_idx.to_string(), |name| (*name).to_string())
    }

    fn view_at(&self, camera_idx: usize, pose: usize) -> Option<usize> {
        (0..self.views.len()).find(|&k| {
            self.views[k].camera_idx == camera_idx
                && self.views[k].pose == pose
                && self.chosen[k].is_some()
        })
    }

    fn chosen_angle(&self, k: usize) -> Option<f64> {
        self.chosen[k].map(|p| x_angle_rad(&self.views[k].grid, &p))
    }

    /// The earlier camera that shares most settled poses with this one.
    fn best_reference(&self, camera_idx: usize) -> Option<usize> {
        let open = self.only_turn_open(camera_idx);
        let shared = |other: usize| {
            let seen = |&&k: &&usize| self.view_at(other, self.views[k].pose).is_some();
            open.iter().filter(seen).count()
        };
        (0..camera_idx)
            .filter(|&other| shared(other) > 0)
            .max_by_key(|&other| (shared(other), std::cmp::Reverse(other)))
    }

    /// Carries the numbering from pose to pose within one camera. The first pose is numbered with
    /// its rows as nearly from left to right as can be.
    fn follow_poses(&mut self, camera_idx: usize) -> Result<(), ConsistencyError> {
        for k in self.only_turn_open(camera_idx) {
            self.follow_nearest_pose(k, 0.0)?;
        }
        Ok(())
    }

    /// Settles a view by the nearest settled pose of its camera. Free poses that are turned too
    /// far, and the first pose, get the numbering nearest to `upright_rad`: the label of a free
    /// pose matters only between cameras.
    fn follow_nearest_pose(&mut self, k: usize, upright_rad: f64) -> Result<(), ConsistencyError> {
        let (camera_idx, pose) = (self.views[k].camera_idx, self.views[k].pose);
        let neighbor = self.nearest_settled(camera_idx, pose);
        let reference = neighbor.and_then(|n| self.chosen_angle(n));
        let choice = nearest_turn(&self.views[k], reference.unwrap_or(upright_rad));
        let clear = choice.is_some_and(|c| c.margin_rad >= CLEAR_MARGIN_RAD);
        if let (Some(neighbor), Some(choice), false) = (neighbor, choice, clear)
            && self.same_stage_placement(self.views[neighbor].pose, pose)
        {
            return Err(ConsistencyError::TurnBetweenPoses {
                camera: self.name(camera_idx),
                earlier_pose: self.views[neighbor].pose,
                pose,
                turn_deg: choice.off_rad.to_degrees(),
                period_deg: self.period_deg(k),
            });
        }
        let settled = if clear {
            choice
        } else {
            nearest_turn(&self.views[k], upright_rad)
        };
        self.chosen[k] = settled.map(|c| c.placement);
        Ok(())
    }

    /// Settles a camera so that its turn against an earlier camera is the same in all poses.
    fn follow_camera(
        &mut self,
        camera_idx: usize,
        reference: usize,
    ) -> Result<(), ConsistencyError> {
        let open = self.only_turn_open(camera_idx);
        let shared: Vec<(usize, usize)> = open
            .iter()
            .filter_map(|&k| Some((k, self.view_at(reference, self.views[k].pose)?)))
            .collect();
        let order = shared
            .iter()
            .map(|&(k, _)| self.views[k].placements.len())
            .max()
            .unwrap_or(1);
        let turn_rad = self.turn_between(&shared, order);
        let hypotheses: Vec<f64> = (0..order)
            .map(|m| wrap(turn_rad + TAU * m as f64 / order as f64))
            .collect();
        let turn_rad = self
            .epipolar_choice(&shared, &hypotheses)
            .or_else(|| upright_choice(&hypotheses))
            .ok_or_else(|| self.undecided(&shared, reference, turn_rad))?;
        for &(k, other) in &shared {
            let Some(target) = self.chosen_angle(other).map(|a| a + turn_rad) else {
                continue;
            };
            let choice = nearest_turn(&self.views[k], target);
            match choice {
                Some(choice) if choice.margin_rad >= CLEAR_MARGIN_RAD => {
                    self.chosen[k] = Some(choice.placement);
                }
                _ => {
                    let off_rad = choice.map_or(0.0, |c| c.off_rad);
                    return Err(self.undecided(&[(k, other)], reference, off_rad));
                }
            }
        }
        for k in open {
            if self.chosen[k].is_none() {
                self.follow_nearest_pose(k, turn_rad)?;
            }
        }
        Ok(())
    }

    fn undecided(
        &self,
        shared: &[(usize, usize)],
        reference: usize,
        turn_rad: f64,
    ) -> ConsistencyError {
        let k = shared.first().map_or(0, |s| s.0);
        ConsistencyError::TurnBetweenCameras {
            first_camera: self.name(reference),
            second_camera: self.name(self.views[k].camera_idx),
            pose: self.views[k].pose,
            turn_deg: turn_rad.to_degrees(),
            period_deg: self.period_deg(k),
        }
    }

    /// Mean turn from the other view to this one, up to the board's symmetry of this order.
    fn turn_between(&self, shared: &[(usize, usize)], order: usize) -> f64 {
        let order = order as f64;
        let mut sum = Vector2::zeros();
        for &(k, other) in shared {
            let first = self.views[k].placements.first();
            if let (Some(placement), Some(other_rad)) = (first, self.chosen_angle(other)) {
                let turn = x_angle_rad(&self.views[k].grid, placement) - other_rad;
                sum += Vector2::new((order * turn).cos(), (order * turn).sin());
            }
        }
        sum.y.atan2(sum.x) / order
    }

    /// The turn between cameras under which all poses share one epipolar geometry, if only one
    /// does.
    fn epipolar_choice(&self, shared: &[(usize, usize)], hypotheses: &[f64]) -> Option<f64> {
        if hypotheses.len() < 2 || shared.len() < EPIPOLAR_POSES {
            return None;
        }
        let mut square_px = f64::INFINITY;
        let mut scored = Vec::new();
        for &turn_rad in hypotheses {
            let mut matches = Vec::new();
            for &(k, other) in shared {
                let placement =
                    nearest_turn(&self.views[k], self.chosen_angle(other)? + turn_rad)?.placement;
                matches.extend(self.matches(other, k, &placement));
                square_px = square_px.min(self.views[k].grid.square_px()?);
            }
            let fit = FundamentalMatrix::from_matches(&matches)?;
            scored.push((fit.median_distance_px(&matches)?, turn_rad));
        }
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (best, second) = (scored.first()?, scored.get(1)?);
        ConsistencyError::is_clear(best.0, second.0, square_px).then_some(best.1)
    }

    /// Corners that a settled view and a view under a placement have in common.
    fn matches(&self, settled: usize, k: usize, placement: &Placement) -> Vec<Match> {
        let known = self.chosen[settled]
            .map(|p| labelled(&self.views[settled].grid, &p))
            .unwrap_or_default();
        labelled(&self.views[k].grid, placement)
            .into_iter()
            .filter_map(|(label, pixel)| Some((*known.get(&label)?, pixel)))
            .collect()
    }

    fn nearest_settled(&self, camera_idx: usize, pose: usize) -> Option<usize> {
        (0..self.views.len())
            .filter(|&k| self.views[k].camera_idx == camera_idx && self.chosen[k].is_some())
            .min_by_key(|&k| (self.views[k].pose.abs_diff(pose), self.views[k].pose))
    }

    fn same_stage_placement(&self, a: usize, b: usize) -> bool {
        self.stage.is_some_and(|stage| match &stage.placement {
            Some(placement) => placement.get(a) == placement.get(b),
            None => true,
        })
    }

    fn period_deg(&self, k: usize) -> f64 {
        360.0 / self.views[k].placements.len().max(1) as f64
    }
}

/// Placements by label, for comparing views.
fn labelled(grid: &FittedGrid, placement: &Placement) -> BTreeMap<(usize, usize), PixelPoint> {
    grid.corners
        .iter()
        .map(|(&node, corner)| (placement.row_col(node), corner.pixel))
        .collect()
}

/// A choice between turns.
#[derive(Debug, Clone, Copy)]
struct Choice {
    placement: Placement,
    /// From the direction asked for, rad.
    off_rad: f64,
    /// By how much the next turn is worse, rad; infinite if there is no other.
    margin_rad: f64,
}

/// The placement whose x axis points nearest to a direction in the image.
fn nearest_turn(view: &UnsettledView, direction_rad: f64) -> Option<Choice> {
    let off = |p: &Placement| wrap(x_angle_rad(&view.grid, p) - direction_rad).abs();
    let best = view
        .placements
        .iter()
        .min_by(|a, b| off(a).total_cmp(&off(b)))?;
    let others = view
        .placements
        .iter()
        .filter(|p| p.quarter_turns != best.quarter_turns);
    let next = others.map(off).fold(f64::INFINITY, f64::min);
    Some(Choice {
        placement: *best,
        off_rad: off(best),
        margin_rad: next - off(best),
    })
}

/// The turn between cameras that both mounted upright have, if that is clear.
fn upright_choice(hypotheses: &[f64]) -> Option<f64> {
    let mut by_size = hypotheses.to_vec();
    by_size.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let best = *by_size.first()?;
    let next = by_size.get(1).map_or(f64::INFINITY, |t| t.abs());
    (next - best.abs() >= CLEAR_MARGIN_RAD).then_some(best)
}

/// Direction of the board's x axis in the image under a placement, rad, from u towards v.
pub fn x_angle_rad(grid: &FittedGrid, placement: &Placement) -> f64 {
    let (mut first, mut second) = (Vector2::zeros(), Vector2::zeros());
    for &node in grid.corners.keys() {
        if let Some(px_from_square) = grid.px_from_square(node) {
            first += px_from_square.column(0).normalize();
            second += px_from_square.column(1).normalize();
        }
    }
    let x = match placement.quarter_turns % 4 {
        0 => first,
        1 => second,
        2 => -first,
        _ => -second,
    };
    x.y.atan2(x.x)
}

/// The angle between -pi and pi.
fn wrap(angle_rad: f64) -> f64 {
    angle_rad - TAU * (angle_rad / TAU).round()
}
