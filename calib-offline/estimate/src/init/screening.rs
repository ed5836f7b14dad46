//! Which views cannot be what they claim: looked for before everything is adjusted together,
//! because one wrong view pulls at all others, and once more when the fields are known well.
//!
//! Three kinds, each found by comparison with the other views, never by a limit in pixels:
//!
//! * A view whose board fits its own camera far worse than others do (moved during the exposure,
//!   bent, another board, a wrong grid): it is left out.
//! * A view that is numbered from the other end of the board. Alone it is perfect; the pair with
//!   another camera fits only after half a turn. Then it is renumbered.
//! * Views of one pose that show different places, each perfect by itself: not exposed at the same
//!   instant. The pose is split: every camera keeps its view, with a board of its own.
//!
//! Nothing is done silently: every change is a [`Finding`].

use super::InitError;
use super::board_pose::{ViewFit, fit_view};
use super::pair_consensus::{Consensus, Pair, Reading, consensus, half_turn};
use crate::adjust::Observations;
use crate::adjust::observations::ViewBlock;
use calib_rays::board::BoardShape;
use calib_rays::field::RayField;
use calib_rays::geometry::{RigidTransform, so3};
use calib_rays::numerics::median;
use rayon::prelude::*;

/// A view is left out if the logarithm of its misfit is this many robust standard deviations above
/// the middle, and the misfit itself ...
const MISFIT_SIGMA: f64 = 8.0;
/// ... this many times that of the middle view: blur alone can make the one threefold, and such
/// views still say something.
const MISFIT_FACTOR: f64 = 4.0;
/// A middle pair that misses by more than this share of the sensor's width says that the cameras
/// have no fixed place to each other, or that their images do not belong together.
const MOST_PAIR_MISFIT_PER_WIDTH: f64 = 0.01;

/// What was found wrong with a view or a pair, and what was done about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Number of the pose.
    pub pose: usize,
    /// Index of the camera whose view it is.
    pub camera_idx: usize,
    /// Corners of the view.
    pub corner_count: usize,
    /// What.
    pub kind: FindingKind,
}

/// Kinds of findings.
#[derive(Debug, Clone, PartialEq)]
pub enum FindingKind {
    /// The view fits its own camera far worse than others; it is left out.
    Misfit {
        /// Median length of its residual vectors, px.
        median_px: f64,
        /// That of the middle view of the camera.
        typical_px: f64,
    },
    /// The view was numbered from the other end of the board; it is renumbered and used.
    Renumbered {
        /// The camera that it was compared with.
        other_camera_idx: usize,
        /// What the pair misses by now, RMS px.
        misfit_px: f64,
    },
    /// The view and that of another camera show the board in different places; each is used for its
    /// own camera only.
    Unsynchronized {
        /// The camera that it was compared with.
        other_camera_idx: usize,
        /// What the pair misses by, RMS px.
        misfit_px: f64,
        /// The same for the middle pair.
        typical_px: f64,
    },
}

/// Observations that can be adjusted together, and how they came about.
#[derive(Debug, Clone)]
pub struct Screened {
    /// What is left, renumbered and split.
    pub observations: Observations,
    /// Per camera, from camera 0.
    pub camera_from_rig: Vec<RigidTransform>,
    /// Per pose index of `observations`; `None` where no camera could place the board.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// What was done, by pose and camera.
    pub findings: Vec<Finding>,
}

/// Screens all views through the fields given, and places the cameras by the pairs that agree:
/// those within `limit_sigma` standard deviations of the middle pair.
///
/// # Errors
/// [`InitError::NoCommonPose`] if a camera shares no pose with those before it,
/// [`InitError::CamerasDisagree`] if their common poses contradict each other.
pub fn screen(
    observations: &Observations,
    fields: &[&RayField],
    shape: &BoardShape,
    limit_sigma: f64,
) -> Result<Screened, InitError> {
    let mut fits: Vec<Option<ViewFit>> = observations
        .views
        .par_iter()
        .map(|view| fit_view(fields[view.camera_idx], &observations.board, shape, view))
        .collect();
    let mut views = observations.views.clone();
    let mut findings = Vec::new();
    leave_out_misfits(observations, &mut views, &mut fits, &mut findings);
    let mut work = Screening {
        observations,
        limit_sigma,
        views,
        fits,
        findings,
        camera_from_rig: vec![None; observations.sensors.len()],
        groups: Groups::new(observations),
    };
    work.camera_from_rig[0] = Some(RigidTransform::identity());
    for _ in 1..observations.sensors.len() {
        work.place_next_camera()?;
    }
    Ok(work.finish())
}

/// Whether the middle pair of two cameras' views agrees with one place of the second.
pub(super) fn check_agreed(
    found: &Consensus,
    observations: &Observations,
    [reference_idx, camera_idx]: [usize; 2],
    pairs: usize,
) -> Result<(), InitError> {
    let width_px = f64::from(observations.sensors[camera_idx].width);
    if found.typical_px <= MOST_PAIR_MISFIT_PER_WIDTH * width_px {
        return Ok(());
    }
    Err(InitError::CamerasDisagree {
        camera_idx,
        reference_idx,
        misfit_px: found.typical_px,
        pairs,
    })
}

/// Views far worse than the others of their camera lose their corners.
fn leave_out_misfits(
    observations: &Observations,
    views: &mut [ViewBlock],
    fits: &mut [Option<ViewFit>],
    findings: &mut Vec<Finding>,
) {
    for camera_idx in 0..observations.sensors.len() {
        let logs: Vec<(usize, f64)> = views
            .iter()
            .zip(fits.iter())
            .enumerate()
            .filter(|(_, (view, _))| view.camera_idx == camera_idx)
            .filter_map(|(k, (_, fit))| Some((k, fit.as_ref()?.variance_px2().ln() / 2.0)))
            .collect();
        let Some(middle) = median(logs.iter().map(|(_, log)| *log)) else {
            continue;
        };
        let deviations = logs.iter().map(|(_, log)| (log - middle).abs());
        let spread = 1.4826 * median(deviations).unwrap_or(0.0);
        let limit = middle + (MISFIT_SIGMA * spread).max(MISFIT_FACTOR.ln());
        let typical_px = middle.exp() * (2.0 * 2f64.ln()).sqrt();
        for (k, log) in logs {
            if let (true, Some(fit)) = (log > limit, fits[k].take_if(|_| log > limit)) {
                findings.push(Finding {
                    pose: observations.poses[views[k].pose_idx],
                    camera_idx,
                    corner_count: views[k].corners.len(),
                    kind: FindingKind::Misfit {
                        median_px: fit.median_px,
                        typical_px,
                    },
                });
                views[k].corners.clear();
            }
        }
    }
}

/// Which views of a pose show the board in the same place: a group per place.
struct Groups {
    /// Per view; `None` as long as its camera is not placed.
    of_view: Vec<Option<usize>>,
    /// Per pose index: where the board is for each of its groups.
    rig_from_board: Vec<Vec<RigidTransform>>,
    /// Per pose index and group: the view that founded the group.
    founder: Vec<Vec<usize>>,
}

impl Groups {
    fn new(observations: &Observations) -> Self {
        Self {
            of_view: vec![None; observations.views.len()],
            rig_from_board: vec![Vec::new(); observations.poses.len()],
            founder: vec![Vec::new(); observations.poses.len()],
        }
    }

    fn found(&mut self, pose_idx: usize, view_idx: usize, rig_from_board: RigidTransform) {
        self.of_view[view_idx] = Some(self.founder[pose_idx].len());
        self.rig_from_board[pose_idx].push(rig_from_board);
        self.founder[pose_idx].push(view_idx);
    }
}

struct Screening<'a> {
    observations: &'a Observations,
    limit_sigma: f64,
    views: Vec<ViewBlock>,
    fits: Vec<Option<ViewFit>>,
    findings: Vec<Finding>,
    camera_from_rig: Vec<Option<RigidTransform>>,
    groups: Groups,
}

/// A view of a camera to place with the view that it is compared with.
type Link = (usize, usize);

impl Screening<'_> {
    /// Views of a camera that is not placed, each with a view of `reference`.
    fn links(&self, camera_idx: usize, reference: usize) -> Vec<Link> {
        let view_of = |camera_idx: usize, pose_idx: usize| {
            (0..self.views.len()).find(|k| {
                self.views[*k].camera_idx == camera_idx
                    && self.views[*k].pose_idx == pose_idx
                    && self.fits[*k].is_some()
            })
        };
        (0..self.observations.poses.len())
            .filter_map(|pose_idx| {
                Some((
                    view_of(camera_idx, pose_idx)?,
                    view_of(reference, pose_idx)?,
                ))
            })
            .collect()
    }

    /// Places the camera that shares most poses with one that is placed.
    fn place_next_camera(&mut self) -> Result<(), InitError> {
        self.found_groups();
        let count = self.camera_from_rig.len();
        let open = || (0..count).filter(|k| self.camera_from_rig[*k].is_none());
        let placed = || (0..count).filter(|k| self.camera_from_rig[*k].is_some());
        let best = open()
            .flat_map(|camera_idx| placed().map(move |reference| (camera_idx, reference)))
            .map(|(camera_idx, reference)| {
                (self.links(camera_idx, reference), camera_idx, reference)
            })
            .max_by_key(|(links, camera_idx, reference)| {
                (links.len(), std::cmp::Reverse((*camera_idx, *reference)))
            });
        let Some((links, camera_idx, reference)) = best else {
            return Ok(());
        };
        let pairs: Vec<Pair> = links
            .iter()
            .filter_map(|(view, other)| {
                Some(Pair {
                    first: self.fits[*other].as_ref()?,
                    second: self.fits[*view].as_ref()?,
                })
            })
            .collect();
        let found = consensus(&self.observations.board, &pairs, self.limit_sigma)
            .ok_or(InitError::NoCommonPose { camera_idx })?;
        check_agreed(
            &found,
            self.observations,
            [reference, camera_idx],
            links.len(),
        )?;
        let rig_from_reference =
            self.camera_from_rig[reference].map_or_else(RigidTransform::identity, |t| t.inverse());
        self.camera_from_rig[camera_idx] =
            Some(found.second_from_first * rig_from_reference.inverse());
        self.sort_in(&links, camera_idx, reference, &found);
        Ok(())
    }

    /// Every view of a placed camera that no group has yet founds one, or joins the only one if it
    /// cannot place its board.
    fn found_groups(&mut self) {
        for k in 0..self.views.len() {
            let (pose_idx, camera_idx) = (self.views[k].pose_idx, self.views[k].camera_idx);
            if let (None, Some(camera_from_rig), Some(fit)) = (
                self.groups.of_view[k],
                self.camera_from_rig[camera_idx],
                &self.fits[k],
            ) {
                let rig_from_board = camera_from_rig.inverse() * fit.camera_from_board;
                self.groups.found(pose_idx, k, rig_from_board);
            }
        }
    }

    /// Gives the linked views of a camera that was just placed to their groups.
    fn sort_in(&mut self, links: &[Link], camera_idx: usize, reference: usize, found: &Consensus) {
        for ((view, other), reading) in links.iter().zip(&found.readings) {
            let pose_idx = self.views[*view].pose_idx;
            if reading.fits {
                self.groups.of_view[*view] = self.groups.of_view[*other];
                if reading.is_turned {
                    self.renumber(*view, *other, reading, camera_idx, reference);
                }
            } else {
                self.findings.push(Finding {
                    pose: self.observations.poses[pose_idx],
                    camera_idx,
                    corner_count: self.views[*view].corners.len(),
                    kind: FindingKind::Unsynchronized {
                        other_camera_idx: reference,
                        misfit_px: reading.misfit_px,
                        typical_px: found.typical_px,
                    },
                });
            }
        }
    }

    /// Renumbers that one of two views which stands out among its camera's neighboring poses.
    fn renumber(
        &mut self,
        view: usize,
        other: usize,
        reading: &Reading,
        camera_idx: usize,
        reference: usize,
    ) {
        let (turned, camera_idx, other_camera_idx) =
            if self.turn_from_neighbors(other) > self.turn_from_neighbors(view) {
                (other, reference, camera_idx)
            } else {
                (view, camera_idx, reference)
            };
        let board = &self.observations.board;
        let block = &mut self.views[turned];
        for corner in &mut block.corners {
            (corner.row, corner.col) = board.half_turned(corner.row, corner.col);
            corner.point_in_board = board.corner_in_board(corner.row, corner.col);
        }
        let pose_idx = block.pose_idx;
        self.findings.push(Finding {
            pose: self.observations.poses[pose_idx],
            camera_idx,
            corner_count: block.corners.len(),
            kind: FindingKind::Renumbered {
                other_camera_idx,
                misfit_px: reading.misfit_px,
            },
        });
        if let Some(fit) = &mut self.fits[turned] {
            fit.camera_from_board = fit.camera_from_board * half_turn(board);
        }
        let founded = self.groups.founder[pose_idx]
            .iter()
            .position(|founder| *founder == turned);
        if let Some(group) = founded {
            let place = &mut self.groups.rig_from_board[pose_idx][group];
            *place = *place * half_turn(board);
        }
    }

    /// Smallest turn from the same camera's neighboring poses, rad.
    fn turn_from_neighbors(&self, view: usize) -> f64 {
        let Some(fit) = &self.fits[view] else {
            return 0.0;
        };
        let of_camera = |k: &usize| {
            self.views[*k].camera_idx == self.views[view].camera_idx && self.fits[*k].is_some()
        };
        let before = (0..view).rev().find(of_camera);
        let after = (view + 1..self.views.len()).find(of_camera);
        [before, after]
            .into_iter()
            .flatten()
            .filter_map(|k| self.fits[k].as_ref())
            .map(|other| {
                let turn =
                    fit.camera_from_board.rotation.transpose() * other.camera_from_board.rotation;
                so3::angle_rad(&turn)
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Arranges what is left: one pose per group.
    fn finish(mut self) -> Screened {
        self.found_groups();
        let old = self.observations;
        let mut observations = Observations {
            board: old.board.clone(),
            board_shape_sd_mm: old.board_shape_sd_mm,
            known_poses: old.known_poses.clone(),
            declared_central: old.declared_central.clone(),
            sensors: old.sensors.clone(),
            poses: Vec::new(),
            views: Vec::new(),
        };
        let mut rig_from_board = Vec::new();
        for (pose_idx, places) in self.groups.rig_from_board.iter().enumerate() {
            // A pose that nobody can place stays, to be named by whoever leaves it out.
            for group in 0..places.len().max(1) {
                for (k, view) in self.views.iter().enumerate() {
                    // Too few corners to say where the board is: with the first that can.
                    let of_group = self.groups.of_view[k].unwrap_or(0) == group;
                    if view.pose_idx == pose_idx && of_group && !view.corners.is_empty() {
                        observations.views.push(ViewBlock {
                            pose_idx: observations.poses.len(),
                            ..view.clone()
                        });
                    }
                }
                observations.poses.push(old.poses[pose_idx]);
                rig_from_board.push(places.get(group).copied());
            }
        }
        observations
            .views
            .sort_by_key(|view| (view.camera_idx, view.pose_idx));
        self.findings
            .sort_by_key(|finding| (finding.pose, finding.camera_idx));
        Screened {
            observations,
            camera_from_rig: self
                .camera_from_rig
                .into_iter()
                .map(|t| t.unwrap_or_else(RigidTransform::identity))
                .collect(),
            rig_from_board,
            findings: self.findings,
        }
    }
}
