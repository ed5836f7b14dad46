//! The cameras of a rig in the frame of the first: from the poses that they have in common.

use super::PinholeError;
use super::adjustment::{Free, Settings, State, minimize};
use super::brown::BrownCamera;
use super::calibrate_camera::{CameraFit, calibrate_camera};
use super::rig::PinholeRig;
use crate::adjust::Observations;
use crate::adjust::observations::ViewBlock;
use crate::init::InitError;
use calib_rays::geometry::{RigidTransform, so3};
use calib_rays::in_order;
use calib_rays::numerics::median;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// What the adjustment of all cameras together may move besides the poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Refine {
    /// The extrinsics; the intrinsics stay as each camera alone has them. `OpenCV`'s `stereoCalibrate`
    /// as it comes (`CALIB_FIX_INTRINSIC`).
    Extrinsics,
    /// The intrinsics as well, from where each camera alone has them (`OpenCV`'s
    /// `CALIB_USE_INTRINSIC_GUESS`). The default, by the bench `pinhole`: better where the model holds
    /// (1.0005 of the oracle's error against 1.0030), by a tenth on paper and port; neither way on
    /// bumps and window; worse by 5 to 8 percent on dome.
    #[default]
    Everything,
}

/// How to calibrate a rig.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RigSettings {
    /// Of each camera and of all together.
    pub adjustment: Settings,
    /// What moves in the end.
    pub refine: Refine,
}

/// Calibrates every camera by itself, then places them by their common poses and adjusts all
/// together.
///
/// Poses that one camera saw alone take part too: they tell nothing of the extrinsics but, where
/// intrinsics move, of these. (`OpenCV`'s `stereoCalibrate` takes common poses only.)
///
/// # Errors
/// What [`calibrate_camera`] says of any camera; [`InitError::NoCommonPose`];
/// [`PinholeError::BehindCamera`] if views contradict each other so much that a common board would
/// lie behind a camera.
pub fn calibrate_rig(
    observations: &Observations,
    settings: &RigSettings,
) -> Result<PinholeRig, PinholeError> {
    let fits = in_order::try_map(0..observations.sensors.len(), |camera_idx| {
        calibrate_camera(observations, camera_idx, &settings.adjustment)
    })?;
    join(observations, fits, settings)
}

/// The second half of [`calibrate_rig`], from cameras that are calibrated already.
///
/// # Errors
/// As [`calibrate_rig`].
pub fn join(
    observations: &Observations,
    fits: Vec<CameraFit>,
    settings: &RigSettings,
) -> Result<PinholeRig, PinholeError> {
    let cameras: Vec<BrownCamera> = fits.iter().map(|fit| fit.camera).collect();
    let placed = place(&fits)?;
    let state = State {
        cameras,
        camera_from_first: placed.camera_from_first,
        first_from_board: placed.first_from_board,
    };
    let used = usable_views(observations, &fits);
    let free = match settings.refine {
        Refine::Extrinsics => Free::Extrinsics,
        Refine::Everything => Free::Everything,
    };
    let outcome = minimize(state, &used, free, &settings.adjustment)?;
    let mut of_used = outcome.is_used.into_iter();
    let is_used = observations
        .views
        .iter()
        .map(|view| {
            let own = is_usable(&fits, view).then(|| of_used.next()).flatten();
            own.unwrap_or_else(|| vec![false; view.corners.len()])
        })
        .collect();
    Ok(PinholeRig {
        cameras: outcome.state.cameras,
        camera_from_first: outcome.state.camera_from_first,
        first_from_board: outcome.state.first_from_board,
        fits,
        cost_px2: outcome.cost_px2,
        rms_px: outcome.rms_px,
        corner_count: outcome.corner_count,
        is_used,
        iterations: outcome.iterations,
        stop: outcome.stop,
        deviations: outcome.deviations,
    })
}

/// The views that placed their board; the others could not have in the rig either.
fn usable_views(observations: &Observations, fits: &[CameraFit]) -> Observations {
    let mut used = observations.clone();
    used.views.retain(|view| is_usable(fits, view));
    used
}

fn is_usable(fits: &[CameraFit], view: &ViewBlock) -> bool {
    fits[view.camera_idx].camera_from_board[view.pose_idx].is_some()
}

struct Placed {
    camera_from_first: Vec<RigidTransform>,
    first_from_board: Vec<Option<RigidTransform>>,
}

/// Camera by camera, the one with most poses in common with those placed before it next: rotation
/// by the geodesic median over the common poses, translation by the median of its components. A
/// minority of wrong pairs has no say.
fn place(fits: &[CameraFit]) -> Result<Placed, PinholeError> {
    let mut camera_from_first: Vec<Option<RigidTransform>> = vec![None; fits.len()];
    let mut first_from_board: Vec<Option<RigidTransform>> = fits
        .first()
        .map_or_else(Vec::new, |fit| fit.camera_from_board.clone());
    if let Some(first) = camera_from_first.first_mut() {
        *first = Some(RigidTransform::identity());
    }
    for _ in 1..fits.len() {
        let next = (0..fits.len())
            .filter(|idx| camera_from_first[*idx].is_none())
            .map(|idx| (idx, relative_poses(&fits[idx], &first_from_board)))
            // Of equals, the first.
            .max_by_key(|(idx, relative)| (relative.len(), usize::MAX - idx));
        let Some((camera_idx, relative)) = next else {
            break;
        };
        let Some(found) = middle(&relative) else {
            return Err(InitError::NoCommonPose { camera_idx }.into());
        };
        camera_from_first[camera_idx] = Some(found);
        let first_from_camera = found.inverse();
        for (known, own) in first_from_board
            .iter_mut()
            .zip(&fits[camera_idx].camera_from_board)
        {
            if known.is_none() {
                *known = own.map(|camera_from_board| first_from_camera * camera_from_board);
            }
        }
    }
    Ok(Placed {
        camera_from_first: camera_from_first.into_iter().flatten().collect(),
        first_from_board,
    })
}

/// `camera_from_first` by each pose that the camera has in common with those placed.
fn relative_poses(
    fit: &CameraFit,
    first_from_board: &[Option<RigidTransform>],
) -> Vec<RigidTransform> {
    fit.camera_from_board
        .iter()
        .zip(first_from_board)
        .filter_map(|(camera_from_board, first_from_board)| {
            Some((*camera_from_board)? * (*first_from_board)?.inverse())
        })
        .collect()
}

/// Geodesic median of the rotations, component-wise median of the translations.
fn middle(relative: &[RigidTransform]) -> Option<RigidTransform> {
    let rotations: Vec<_> = relative.iter().map(|pose| pose.rotation).collect();
    let rotation = so3::geodesic_median(&rotations)?;
    let translation_mm = Vector3::from_fn(|axis, _| {
        // There is one, as there is a median of the rotations.
        median(relative.iter().map(|p| p.translation_mm[axis])).unwrap_or(0.0)
    });
    Some(RigidTransform::new(rotation, translation_mm))
}
