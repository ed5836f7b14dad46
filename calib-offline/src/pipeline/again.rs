//! The estimate behind a calibration, made again from the corners that the file holds: with it comes all that
//! it leaves open, and not only what the file says of that.

use super::offered::declared_central;
use crate::methods::MethodError;
use crate::report::Calibration;
use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::{Estimate, Simpler, estimate_screened};
use calib_rays::field::Rig;
use calib_rays::observed::{Corner, View};
use std::collections::BTreeMap;

/// The joint estimate of a calibration's corners; `None` if it holds none.
///
/// # Errors
/// Corners that give no estimate.
pub fn estimate_again(calibration: &Calibration) -> Option<Result<Estimate, MethodError>> {
    if calibration.corners.is_empty() {
        return None;
    }
    let cameras = calibration.rig.cameras.iter();
    let sensors = cameras.map(|camera| camera.field.sensor).collect();
    let views = views(calibration);
    let observations = Observations::new(calibration.board.clone(), sensors, &views)
        .with_known_poses(calibration.known_poses.clone())
        .with_declared_central(declared_central(
            calibration.cameras.iter().map(|camera| camera.optics),
        ));
    let found = start_rig(&observations)
        .map_err(MethodError::from)
        .and_then(|start| Ok(estimate_screened(&observations, start)?.0))
        .and_then(|estimate| match taken(calibration) {
            Some(simpler) => Ok(estimate.made_simpler(simpler)?),
            None => Ok(estimate),
        });
    Some(found)
}

/// The simpler model that unseen boards spoke for.
fn taken(calibration: &Calibration) -> Option<Simpler> {
    let unseen = calibration.choices.as_ref()?.unseen.as_ref()?;
    let mut taken = unseen.compared.iter().filter(|one| one.taken);
    taken.next().map(|one| one.without)
}

/// Names of a rig's cameras.
pub fn names(rig: &Rig) -> Vec<String> {
    rig.cameras.iter().map(|c| c.name.clone()).collect()
}

/// The corners that the calibration was made from.
fn views(calibration: &Calibration) -> Vec<View> {
    let mut views: BTreeMap<(usize, usize), Vec<Corner>> = BTreeMap::new();
    for corner in &calibration.corners {
        let view = views.entry((corner.pose, corner.camera_idx)).or_default();
        view.push(Corner {
            row: corner.row,
            col: corner.col,
            pixel: corner.observed,
            sigma_px: None,
        });
    }
    views
        .into_iter()
        .map(|((pose, camera_idx), corners)| View {
            camera_idx,
            pose,
            corners,
        })
        .collect()
}
