//! Whether the boards' tilts, distances and number hold the lens, and which two boards would help most.
//!
//! No limit on tilts or distances themselves: what counts is what the recording's own design leaves
//! uncertain in measured points, and by how much two more boards would lower it. Where boards are well
//! spread, two more of n lower it as the square root of (n + 2) over n does; where they lie alike, two
//! others lower it manifold.

use super::design::{Design, DesignCamera, Seen};
use super::finding::{cause, digits, length};
use super::look::Look;
use super::placed::Placed;
use crate::cause::{Cause, Code};
use crate::verdict::Grade;
use calib_rays::field::CoverageMask;
use calib_rays::geometry::{PixelPoint, RigidTransform, so3};
use calib_rays::numerics::median;
use nalgebra::Vector3;

/// The tilt of boards that are proposed, degrees: what anybody can hold.
const TILT_DEG: f64 = 20.0;
/// Proposed boards stand nearer and farther by this share of the distance.
const DEPTH_SHARE: f64 = 0.2;
/// Two more boards that halve the error, beyond what their number does, say that the recording lies too
/// much alike.
const TOO_ALIKE: f64 = 2.0;
/// Where that is so, and boards at other distances lower it by more than their number does and a fifth,
/// distances are alike besides.
const ONE_DEPTH: f64 = 1.2;
/// So they are if they differ by less than this share: boards across the view at one distance do.
const ONE_PLACE: f64 = 0.05;
/// Fewer different poses than this leave each half of them without one to spare.
const FEW_POSES: usize = 8;
/// Points are asked for at so many pixels.
const ASKED: usize = 40;

/// A recording as the design sees it.
pub struct Geometry {
    /// Different poses that are placed.
    pub poses: usize,
    /// Different poses that are not: no camera explains what it saw of them as well as the others.
    pub unplaced: usize,
    /// Angles between the boards' normals and the middle one: RMS, degrees.
    pub tilt_rms_deg: f64,
    /// Nearest, middle and farthest board's middle along the first camera's axis, mm.
    pub distance_mm: [f64; 3],
    /// RMS error that the calibration leaves in points, mm, for lenses of nine numbers.
    pub error_mm: f64,
    /// The same per px of corner noise.
    pub error_mm_per_px: f64,
    /// Proposals: what to record, by how much the error falls.
    pub proposals: Vec<(Proposal, f64)>,
}

/// Two boards to record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Proposal {
    /// One turned to either side about the image's vertical.
    AboutVertical,
    /// One turned to either side about the image's horizontal.
    AboutHorizontal,
    /// One nearer, one farther.
    OtherDistances,
}

impl Proposal {
    const ALL: [Self; 3] = [
        Self::AboutVertical,
        Self::AboutHorizontal,
        Self::OtherDistances,
    ];

    fn words(self, distance_mm: f64) -> String {
        match self {
            Self::AboutVertical => {
                format!(
                    "take two more boards, tilted by {TILT_DEG:.0} degrees to either side about the vertical"
                )
            }
            Self::AboutHorizontal => {
                format!(
                    "take two more boards, tilted by {TILT_DEG:.0} degrees to either side about the horizontal"
                )
            }
            Self::OtherDistances => format!(
                "take two more boards, one at {} and one at {}",
                length((1.0 - DEPTH_SHARE) * distance_mm),
                length((1.0 + DEPTH_SHARE) * distance_mm)
            ),
        }
    }
}

/// Different boards (first pose index of those that show the same), as the first camera's frame has them.
pub fn geometry(look: &Look<'_>, placed: &Placed, same_as: &[usize]) -> Option<Geometry> {
    let camera_from_rig = &placed.camera_from_rig;
    // Only cameras with a place; numbered anew.
    let used: Vec<usize> = (0..look.cameras.len())
        .filter(|idx| look.cameras[*idx].is_some() && camera_from_rig[*idx].is_some())
        .collect();
    if used.first() != Some(&0) {
        return None;
    }
    let cameras: Vec<DesignCamera<'_>> = used
        .iter()
        .filter_map(|idx| {
            Some(DesignCamera {
                field: &look.cameras[*idx].as_ref()?.field,
                camera_from_rig: camera_from_rig[*idx]?,
            })
        })
        .collect();
    let mut design = Design::new(cameras);
    let board = &look.dataset.board;
    let mut boards: Vec<RigidTransform> = Vec::new();
    let mut unplaced = 0;
    for (pose_idx, same) in same_as.iter().enumerate() {
        if *same != pose_idx {
            continue;
        }
        let Some(rig_from_board) = placed.rig_from_board[pose_idx] else {
            unplaced += 1;
            continue;
        };
        let views = look.observations.views.iter().zip(&look.fits);
        let seen: Vec<Seen> = views
            .filter(|(view, fit)| view.pose_idx == pose_idx && fit.is_some())
            .filter_map(|(view, _)| {
                let camera = used.iter().position(|idx| *idx == view.camera_idx)?;
                let corners = view.corners.iter().map(|c| (c.pixel, c.point_in_board));
                Some((camera, corners.collect()))
            })
            .collect();
        design.add(&rig_from_board, &seen);
        boards.push(rig_from_board);
    }
    let middle = board.center_in_board();
    let distances = || boards.iter().map(|b| b.point(&middle).z.abs());
    let distance_mm = [
        distances().fold(f64::INFINITY, f64::min),
        median(distances())?,
        distances().fold(0.0, f64::max),
    ];
    let points = asked(look, distance_mm);
    let error = design.error_mm_per_px(&points)?;
    let sigma_px = median(
        used.iter()
            .filter_map(|k| Some(look.cameras[*k].as_ref()?.sigma_px)),
    )?;
    let usual = usual_board(&boards, &middle)?;
    let proposals = Proposal::ALL
        .into_iter()
        .filter_map(|proposal| {
            let mut with = design.clone();
            for rig_from_board in proposed(proposal, &usual, &middle) {
                let seen = would_see(&design, board, &rig_from_board);
                with.add(&rig_from_board, &seen);
            }
            Some((proposal, error / with.error_mm_per_px(&points)?))
        })
        .collect();
    let normal = usual.rotation.column(2).into_owned();
    let tilts: Vec<f64> = boards
        .iter()
        .map(|b| b.rotation.column(2).angle(&normal).to_degrees())
        .collect();
    Some(Geometry {
        poses: boards.len(),
        unplaced,
        tilt_rms_deg: calib_rays::numerics::rms(&tilts)?,
        distance_mm,
        error_mm: error * sigma_px,
        error_mm_per_px: error,
        proposals,
    })
}

/// The middle of all boards: where they stand, and how they are turned.
fn usual_board(boards: &[RigidTransform], middle: &Vector3<f64>) -> Option<RigidTransform> {
    let count = boards.len() as f64;
    let rotations: Vec<_> = boards.iter().map(|b| b.rotation).collect();
    let rotation = so3::geodesic_median(&rotations)?;
    let place = boards.iter().map(|b| b.point(middle)).sum::<Vector3<f64>>() / count;
    Some(RigidTransform::new(rotation, place - rotation * middle))
}

fn proposed(
    proposal: Proposal,
    usual: &RigidTransform,
    middle: &Vector3<f64>,
) -> [RigidTransform; 2] {
    let place = usual.point(middle);
    [-1.0, 1.0].map(|side: f64| {
        let turn = side * TILT_DEG.to_radians();
        let (turn, share) = match proposal {
            Proposal::AboutVertical => (Vector3::new(0.0, turn, 0.0), 1.0),
            Proposal::AboutHorizontal => (Vector3::new(turn, 0.0, 0.0), 1.0),
            Proposal::OtherDistances => (Vector3::zeros(), 1.0 + side * DEPTH_SHARE),
        };
        let rotation = so3::exp(&turn) * usual.rotation;
        RigidTransform::new(rotation, place * share - rotation * middle)
    })
}

/// What the cameras would see of a board.
fn would_see(
    design: &Design<'_>,
    board: &calib_rays::board::BoardSpec,
    rig_from_board: &RigidTransform,
) -> Vec<Seen> {
    let cameras = design.cameras().iter().enumerate();
    cameras
        .map(|(idx, camera)| {
            let camera_from_board = camera.camera_from_rig * *rig_from_board;
            let labels = (0..board.rows).flat_map(|row| (0..board.cols).map(move |col| (row, col)));
            let corners = labels.filter_map(|(row, col)| {
                let point = board.corner_in_board(row, col);
                let pixel = camera.field.project(&camera_from_board.point(&point))?;
                camera
                    .field
                    .sensor
                    .contains(pixel)
                    .then_some((pixel, point))
            });
            (idx, corners.collect())
        })
        .collect()
}

/// Where points are measured: before the calibrated part of the first camera, over the depth of the
/// boards and half a board before and behind them.
fn asked(look: &Look<'_>, [nearest, middle, farthest]: [f64; 3]) -> Vec<Vector3<f64>> {
    let Some(camera) = &look.cameras[0] else {
        return Vec::new();
    };
    let views = look.observations.views.iter();
    let pixels = views
        .filter(|view| view.camera_idx == 0)
        .flat_map(|view| &view.corners)
        .map(|c| c.pixel);
    let covered: Vec<PixelPoint> =
        CoverageMask::from_corners(camera.field.sensor, pixels).covered_middles();
    let (width, height) = look.dataset.board.extent_mm();
    let half_mm = width.max(height) / 2.0;
    let depths = [
        (nearest - half_mm).max(nearest / 2.0),
        middle,
        farthest + half_mm,
    ];
    let count = covered.len().min(ASKED);
    (0..count)
        .map(|k| covered[k * covered.len() / count])
        .flat_map(|pixel| {
            let ray = camera.field.ray(pixel);
            let direction = ray.direction.normalize();
            depths.map(|depth| ray.origin_mm + direction * depth)
        })
        .collect()
}

/// What the geometry says.
pub fn causes(found: &Geometry) -> Vec<Cause> {
    let mut causes = Vec::new();
    let by_number = ((found.poses + 2) as f64 / found.poses as f64).sqrt();
    let [nearest, middle, farthest] = found.distance_mm;
    if found.poses < FEW_POSES {
        causes.push(cause(
            Code::FewPoses,
            Grade::Doubtful,
            format!("{} poses", found.poses),
            found.error_mm,
            format!(
                "{} different poses are few{}: half of them give hardly a calibration to compare with; record \
                 {FEW_POSES} or more, at other tilts and distances",
                found.poses,
                match found.unplaced {
                    0 => String::new(),
                    count => format!(
                        " ({count} more do not count: no camera explains its view of them as well as of the others)"
                    ),
                }
            ),
        ));
    }
    let best = found
        .proposals
        .iter()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .filter(|(_, gain)| *gain > TOO_ALIKE * by_number);
    // Boards that are tilted more than what is proposed lack something else.
    let Some((proposal, gain)) = best.filter(|_| found.tilt_rms_deg < TILT_DEG) else {
        return causes;
    };
    let text = |what: String| {
        format!(
            "{what}: they leave {} mm RMS in points (for lenses of nine numbers); {}: {} mm then",
            digits(found.error_mm),
            proposal.words(middle),
            digits(found.error_mm / gain)
        )
    };
    let would_help = found.proposals.iter().any(|(proposal, gain)| {
        *proposal == Proposal::OtherDistances && *gain > ONE_DEPTH * by_number
    });
    if would_help || farthest - nearest < ONE_PLACE * middle {
        causes.push(cause(
            Code::OneDepth,
            Grade::Doubtful,
            format!("{} to {}", length(nearest), length(farthest)),
            found.error_mm,
            text(format!(
                "all boards stand at one distance, {} to {}, and face the camera alike",
                length(nearest),
                length(farthest)
            )),
        ));
    }
    causes.push(cause(
        Code::FewTilts,
        Grade::Doubtful,
        format!("{:.1} degrees RMS", found.tilt_rms_deg),
        found.error_mm,
        text(format!(
            "the {} boards are tilted against each other by {:.1} degrees RMS",
            found.poses, found.tilt_rms_deg
        )),
    ));
    causes
}
