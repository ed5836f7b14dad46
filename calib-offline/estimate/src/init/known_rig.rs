//! The start where poses are known beforehand, all or some: each camera is placed by what it saw of those, a camera that
//! saw none through poses that it shares with others, and the other poses through the cameras. METHOD 2.10.

use super::InitError;
use super::board_pose::{ViewFit, fit_view};
use super::focal_scan::start_camera;
use super::pair_consensus::{COARSE_LIMIT_SIGMA, Pair, consensus};
use super::rig_start::RigStart;
use super::screening::check_agreed;
use crate::adjust::Observations;
use crate::adjust::observations::ViewBlock;
use calib_rays::board::BoardShape;
use calib_rays::field::RayField;
use calib_rays::geometry::{RigidTransform, Scatter};
use calib_rays::in_order;

/// What the known poses show as one target, and everything else, through the fields found.
struct Known {
    /// With the known poses as one.
    joined: Observations,
    /// Index of that one.
    joined_idx: usize,
    /// Per view of `joined`.
    fits: Vec<Option<ViewFit>>,
    /// Per camera, from the frame that the poses are known in.
    camera_from_rig: Vec<Option<RigidTransform>>,
}

/// Starts from all known poses as one target. The rig's frame is the one that they are known in, and views are not
/// screened: one of a known pose contradicts no other view, only what is known.
///
/// # Errors
/// As [`super::rig::start_rig`].
pub(super) fn start(observations: &Observations) -> Result<RigStart, InitError> {
    let joined = observations.with_known_as_one();
    let cameras = in_order::try_map(0..observations.sensors.len(), |idx| {
        start_camera(&joined.of_camera(idx), idx)
    })?;
    let median_px = cameras.iter().map(|camera| camera.median_px).collect();
    let fields: Vec<RayField> = cameras.into_iter().map(|camera| camera.field).collect();
    let mut known = Known::new(joined, &fields);
    known.place_by_solids();
    while let Some(camera_idx) = known.next_camera() {
        known.place(camera_idx)?;
    }
    let poses = observations.poses.iter();
    let rig_from_board = poses
        .map(|pose| match observations.known_poses.get(pose) {
            Some(known) => Some(known.rig_from_board),
            None => known.rig_from_board(*pose),
        })
        .collect();
    let placed = known.camera_from_rig.into_iter();
    Ok(RigStart {
        observations: observations.clone(),
        findings: Vec::new(),
        camera_from_rig: placed
            .map(|place| place.unwrap_or_else(RigidTransform::identity))
            .collect(),
        rig_from_board,
        fields,
        median_px,
    })
}

impl Known {
    fn new(joined: Observations, fields: &[RayField]) -> Self {
        let shape = BoardShape::default();
        let fit =
            |view: &ViewBlock| fit_view(&fields[view.camera_idx], &joined.board, &shape, view);
        let first = joined.known_poses.keys().next();
        let joined_idx = first.and_then(|pose| joined.poses.binary_search(pose).ok());
        Self {
            fits: joined.views.iter().map(fit).collect(),
            camera_from_rig: vec![None; joined.sensors.len()],
            joined_idx: joined_idx.unwrap_or(0),
            joined,
        }
    }

    /// A camera's view of a pose with its fit, if it places the target.
    fn seen(&self, camera_idx: usize, pose_idx: usize) -> Option<(&ViewBlock, &ViewFit)> {
        let views = self.joined.views.iter().zip(&self.fits);
        let mut own =
            views.filter(|(view, _)| (view.camera_idx, view.pose_idx) == (camera_idx, pose_idx));
        own.find_map(|(view, fit)| Some((view, fit.as_ref()?)))
    }

    /// Cameras that saw a solid of known points are where that puts them. If there is none, the one that saw most is.
    fn place_by_solids(&mut self) {
        let mut most: Option<(usize, usize)> = None;
        for camera_idx in 0..self.camera_from_rig.len() {
            let Some((view, fit)) = self.seen(camera_idx, self.joined_idx) else {
                continue;
            };
            let places: Vec<_> = view.corners.iter().map(|c| c.point_in_board).collect();
            let (count, pose) = (view.corners.len(), fit.camera_from_board);
            if Scatter::of(&places).is_solid() {
                self.camera_from_rig[camera_idx] = Some(pose);
            } else if most.is_none_or(|(_, best)| count > best) {
                most = Some((camera_idx, count));
            }
        }
        if self.camera_from_rig.iter().all(Option::is_none)
            && let Some((camera_idx, _)) = most
        {
            let seen = self.seen(camera_idx, self.joined_idx);
            self.camera_from_rig[camera_idx] = seen.map(|(_, fit)| fit.camera_from_board);
        }
    }

    /// The poses that two cameras share and place.
    fn pairs(&self, camera_idx: usize, reference: usize) -> Vec<Pair<'_>> {
        let poses = 0..self.joined.poses.len();
        poses
            .filter_map(|pose_idx| {
                Some(Pair {
                    first: self.seen(reference, pose_idx)?.1,
                    second: self.seen(camera_idx, pose_idx)?.1,
                })
            })
            .collect()
    }

    fn placed_cameras(&self) -> impl Iterator<Item = usize> {
        (0..self.camera_from_rig.len()).filter(|k| self.camera_from_rig[*k].is_some())
    }

    /// The camera that shares most poses with one that is placed; `None` if all are.
    fn next_camera(&self) -> Option<usize> {
        let open = (0..self.camera_from_rig.len()).filter(|k| self.camera_from_rig[*k].is_none());
        let shared = |camera_idx: usize| {
            let placed = self.placed_cameras();
            placed
                .map(|other| self.pairs(camera_idx, other).len())
                .max()
        };
        open.max_by_key(|camera_idx| (shared(*camera_idx), std::cmp::Reverse(*camera_idx)))
    }

    fn place(&mut self, camera_idx: usize) -> Result<(), InitError> {
        let placed = self.placed_cameras();
        let reference = placed.max_by_key(|other| {
            (
                self.pairs(camera_idx, *other).len(),
                std::cmp::Reverse(*other),
            )
        });
        let none = InitError::NoCommonPose { camera_idx };
        let Some((reference, reference_from_rig)) =
            reference.and_then(|idx| Some((idx, self.camera_from_rig[idx]?)))
        else {
            return Err(none);
        };
        let pairs = self.pairs(camera_idx, reference);
        let found = consensus(&self.joined.board, &pairs, COARSE_LIMIT_SIGMA).ok_or(none)?;
        check_agreed(&found, &self.joined, [reference, camera_idx], pairs.len())?;
        self.camera_from_rig[camera_idx] = Some(found.second_from_first * reference_from_rig);
        Ok(())
    }

    /// Where a board of an unknown pose was: by the view that knows best, most corners first.
    fn rig_from_board(&self, pose: usize) -> Option<RigidTransform> {
        let pose_idx = self.joined.poses.binary_search(&pose).ok()?;
        let cameras = self.placed_cameras();
        let views = cameras.filter_map(|camera_idx| {
            let (_, fit) = self.seen(camera_idx, pose_idx)?;
            let camera_from_rig = self.camera_from_rig[camera_idx]?;
            Some((fit, camera_from_rig.inverse() * fit.camera_from_board))
        });
        // A mean's standard deviation.
        let misfit = |fit: &ViewFit| fit.variance_px2() / fit.corner_count as f64;
        views
            .min_by(|a, b| misfit(a.0).total_cmp(&misfit(b.0)))
            .map(|(_, pose)| pose)
    }
}
