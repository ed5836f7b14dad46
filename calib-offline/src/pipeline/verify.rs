//! An old calibration against a few new poses of its board.

use super::again::{estimate_again, names};
use super::corners::Corners;
use super::verify_error::VerifyError;
use crate::report::Calibration;
use calib_estimate::adjust::Observations;
use calib_judge::suspects::difference_mm;
use calib_judge::validity::{Validity, validity};
use calib_rays::observed::View;
use calib_rays::progress::Progress;
use calib_recording::dataset::Dataset;
use calib_recording::dataset::split::without_excluded;

/// What was found, and whether the calibration in the file is the one that it was found with.
#[derive(Debug)]
pub struct Verified {
    /// What was found.
    pub validity: Validity,
    /// How far the estimate from the old corners, which the new ones are held against, is from the
    /// calibration in the file, RMS of points, mm.
    pub from_file_mm: Option<f64>,
}

/// Whether a calibration still holds for a rig that recorded a dataset.
///
/// The estimate is made again from the corners in the calibration, with all that it leaves open.
///
/// Cost: that of two to four estimates.
///
/// # Errors
/// Another board, other cameras; corners that place no board.
pub fn verify(
    calibration: &Calibration,
    dataset: &Dataset,
    corners: &Corners,
    progress: &dyn Progress,
) -> Result<Verified, VerifyError> {
    if calibration.imported.is_some() {
        return Err(VerifyError::Imported);
    }
    let cameras = cameras(calibration, dataset)?;
    let sensors: Vec<_> = calibration
        .rig
        .cameras
        .iter()
        .map(|camera| camera.field.sensor)
        .collect();
    let views = without_excluded(corners.views.clone(), &dataset.excluded_poses).used;
    let views: Vec<View> = views
        .into_iter()
        .map(|view| View {
            camera_idx: cameras[view.camera_idx],
            ..view
        })
        .collect();
    let new = Observations::new(calibration.board.clone(), sensors, &views);
    progress.begin("old estimate", 0);
    let found = estimate_again(calibration);
    progress.end();
    let estimate = found.ok_or(VerifyError::NoOldCorners)??;
    let rig = estimate.rig(&names(&calibration.rig));
    progress.begin("what changed", 0);
    let found = validity(&estimate, &rig, &new);
    progress.end();
    let validity = found.ok_or(VerifyError::NoBoard {
        corners: new.corner_count(),
    })?;
    Ok(Verified {
        from_file_mm: difference_mm(&calibration.rig, &rig, &validity.distances_mm),
        validity,
    })
}

/// Per camera of the dataset: which of the calibration's it is.
fn cameras(calibration: &Calibration, dataset: &Dataset) -> Result<Vec<usize>, VerifyError> {
    let known = &calibration.rig.cameras;
    let mut found = Vec::new();
    for camera in &dataset.cameras {
        let Some(idx) = calibration.rig.camera_idx(&camera.name) else {
            return Err(VerifyError::UnknownCamera {
                name: camera.name.clone(),
                known: names(&calibration.rig),
            });
        };
        let sensor = known[idx].field.sensor;
        if sensor != camera.sensor {
            return Err(VerifyError::OtherSensor {
                name: camera.name.clone(),
                old: [sensor.width, sensor.height],
                new: [camera.sensor.width, camera.sensor.height],
            });
        }
        found.push(idx);
    }
    if let Some(missing) = (0..known.len()).find(|idx| !found.contains(idx)) {
        return Err(VerifyError::MissingCamera {
            name: known[missing].name.clone(),
        });
    }
    if dataset.board != calibration.board {
        return Err(VerifyError::OtherBoard {
            old: calibration.board.clone(),
            new: dataset.board.clone(),
        });
    }
    Ok(found)
}
