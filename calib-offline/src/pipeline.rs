//! The procedure from top to bottom, one call per step: the file to read first.
//!
//! A dataset's corners become observations; initialization finds lenses and poses, and the views
//! that cannot be what they claim; the joint estimate adjusts everything and looks at the views
//! once more; held-out boards and the calibration itself judge it; the record says all of it.

mod again;
mod corners;
pub mod error;
mod left_out;
mod offered;
mod parts;
mod summary;
mod verify;
pub mod verify_error;

pub use again::{estimate_again, names};
pub use corners::{Corners, corners};
pub use error::{CalibrateError, NoSuchPose};
pub use offered::{Offered, camera_names, explained, offered};
pub use verify::{Verified, verify};
pub use verify_error::VerifyError;

use crate::methods::{Given, Joint, Method, Own, Solution, fit_folds};
use crate::report::Calibration;
use calib_estimate::adjust::Observations;
use calib_judge::agreement::{Whole, agreement};
use calib_judge::half_data::first_halves;
use calib_judge::held_out::folds_wanted;
use calib_judge::plausibility::{Sheet, units_of_places};
use calib_judge::screened::screened;
use calib_judge::unexpected_optics::unexpected_optics;
use calib_judge::verdict::Thresholds;
use calib_judge::{Declared, Folds, Task, held_out};
use calib_rays::field::RayTable;
use calib_rays::progress::Progress;
use calib_recording::dataset::Dataset;
use calib_recording::dataset::stage::placements;
use calib_recording::detect::DetectSettings;
use parts::Parts;

/// How to calibrate. Nothing here needs to be chosen by the user. Poses are left out by the
/// dataset's own list.
#[derive(Debug, Clone)]
pub struct CalibrateSettings {
    /// Which method.
    pub method: &'static dyn Method,
    /// Folds of the held-out check; 0 leaves it out, and the comparison of two halves with it.
    pub folds: usize,
    /// What counts as good.
    pub thresholds: Thresholds,
    /// How images are searched, if the dataset has no corners.
    pub detect: DetectSettings,
    /// Whether a table with one ray per pixel is made of every camera.
    pub ray_tables: bool,
    /// How noisy the pixels of matches will be, px, if somebody knows: for predictions only.
    pub match_noise_px: Option<f64>,
    /// The measurement whose error is to be predicted.
    pub task: Option<Task>,
    /// What the program was asked for, for the record.
    pub command: Option<String>,
}

impl Default for CalibrateSettings {
    fn default() -> Self {
        Self {
            method: &Joint,
            folds: 5,
            thresholds: Thresholds::default(),
            detect: DetectSettings::default(),
            ray_tables: false,
            match_noise_px: None,
            task: None,
            command: None,
        }
    }
}

/// A calibration, and what its held-out check was made from.
#[derive(Debug)]
pub struct Checked {
    /// The calibration.
    pub calibration: Calibration,
    /// What was offered to it, as recorded: no view left out, no pair taken apart.
    pub offered: Observations,
    /// The estimates of the held-out check, for whoever wants to measure with them.
    pub folds: Folds,
    /// What the method has beside the calibration.
    pub own: Box<dyn Own>,
}

/// A calibration, and what else was asked for.
#[derive(Debug)]
pub struct Calibrated {
    /// The calibration.
    pub calibration: Calibration,
    /// One ray per pixel of each camera, in the rig's order; empty unless asked for. Those of the
    /// published procedure are its own, before they are smoothed into the calibration's field.
    pub ray_tables: Vec<RayTable>,
}

impl From<Calibration> for Calibrated {
    fn from(calibration: Calibration) -> Self {
        Self {
            calibration,
            ray_tables: Vec::new(),
        }
    }
}

/// Calibrates a dataset.
///
/// Deterministic: the same input gives the same result on the same build, whatever the number of
/// threads.
///
/// # Errors
/// The stage's own error: unusable input, or data that cannot determine the answer.
pub fn calibrate(
    dataset: &Dataset,
    settings: &CalibrateSettings,
    progress: &dyn Progress,
) -> Result<Calibrated, CalibrateError> {
    let corners = corners(dataset, &settings.detect, progress)?;
    let checked = calibrate_corners(dataset, &corners, settings, progress)?;
    let mut calibrated = Calibrated::from(checked.calibration);
    calibrated.calibration.rig.match_noise_px = settings.match_noise_px;
    calibrated.calibration.command.clone_from(&settings.command);
    if settings.ray_tables {
        let cameras = &calibrated.calibration.rig.cameras;
        progress.begin("ray tables", cameras.len());
        calibrated.ray_tables = cameras
            .iter()
            .enumerate()
            .map(|(camera_idx, camera)| {
                let own = checked.own.ray_table(camera_idx, camera.field.sensor);
                let table = own.unwrap_or_else(|| RayTable::of_camera(camera));
                progress.advance();
                table
            })
            .collect();
        progress.end();
    }
    Ok(calibrated)
}

/// What the board's certificate and the settings say of a measurement's errors.
fn declared(dataset: &Dataset, settings: &CalibrateSettings) -> Declared {
    let certificate = dataset.certificate;
    Declared {
        scale_ppm_sd: certificate.and_then(|c| c.scale_ppm_sd),
        temperature_ppm_sd: certificate.and_then(|c| c.expansion_ppm_sd()),
        match_noise_px: settings.match_noise_px,
    }
}

/// [`calibrate`] from corners that are there already; keeps what the check was made from.
///
/// # Errors
/// Data that cannot determine the answer.
pub fn calibrate_corners(
    dataset: &Dataset,
    corners: &Corners,
    settings: &CalibrateSettings,
    progress: &dyn Progress,
) -> Result<Checked, CalibrateError> {
    let Offered {
        views,
        observations,
    } = offered(dataset, corners)?;
    let given = Given {
        observations: &observations,
        names: &camera_names(dataset),
        placements: &placements(dataset, &corners.views),
        joint: None,
    };
    let solution = settings
        .method
        .fit(&given, progress)
        .map_err(|error| explained(error, dataset, &views))?;

    offered::check_known_fits(dataset, &views, solution.sigma_px)?;

    // Before all that takes long: it may be that it cannot be answered.
    let task = settings.task.map(|task| {
        let declared = declared(dataset, settings);
        solution.own.expected_error(&solution.rig, &task, &declared)
    });
    let task = task.transpose()?;

    let wanted = folds_wanted(&solution.observations, settings.folds);
    progress.begin("cross-checks", wanted);
    let fit_folds = |solution: &Solution| {
        let used = &solution.observations;
        let own = Some(&*solution.own);
        fit_folds(settings.method, &given, used, wanted, own, progress)
    };
    let check = |solution: &Solution| {
        let halves = first_halves(&solution.observations, |pose| {
            given.placements.get(&pose).copied()
        });
        let halves: &[_] = if settings.folds > 0 { &halves } else { &[] };
        rayon::join(
            || solution.own.check(&solution.rig, halves),
            || solution.own.suspects(&solution.rig),
        )
    };
    let (solution, folds, (checks, causes)) = if solution.own.may_be_simpler() && wanted > 0 {
        let mut folds = fit_folds(&solution);
        let names = camera_names(dataset);
        let solution = solution.held_against(&mut folds, &names)?;
        let checked = check(&solution);
        (solution, folds, checked)
    } else {
        let (folds, checked) = rayon::join(|| fit_folds(&solution), || check(&solution));
        (solution, folds, checked)
    };
    progress.end();
    let sheet = Sheet::of(dataset, &views);
    let mut causes = sheet.with_suspects(causes);
    for left_out in screened(&solution.findings, &sheet.explained) {
        if causes.iter().all(|cause| cause.code != left_out.code) {
            causes.push(left_out);
        }
    }
    let mm_per_px = solution.mm_per_px();
    let distance_mm = solution.distance_mm();
    // Data that were taken for others than they are come first.
    let misread = units_of_places(dataset, &solution.rig, distance_mm, mm_per_px);
    causes.splice(0..0, misread);
    let central = checks.as_ref().map(|checks| &checks.central_model);
    causes.extend(central.and_then(|c| unexpected_optics(dataset, c)));
    let whole = Whole {
        rig: &solution.rig,
        board_shape: &solution.board_shape,
        observations: &solution.observations,
        is_used: &solution.is_used,
        freedom: solution.own.freedom(),
    };
    let calibration = summary::record(&Parts {
        dataset,
        corners,
        observations: &observations,
        solution: &solution,
        held_out: &held_out(&folds),
        agreement: agreement(&whole, &folds),
        mm_per_px,
        left_open_mm: solution.own.left_open_mm(&solution.rig),
        checks: checks.as_ref(),
        causes: &causes,
        explained: &sheet.explained,
        task: task.as_ref(),
        thresholds: &settings.thresholds,
    });
    Ok(Checked {
        calibration,
        folds,
        own: solution.own,
        offered: observations,
    })
}
