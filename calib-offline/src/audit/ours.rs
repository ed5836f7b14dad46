//! Our own estimate of the same recording, and its folds.

use super::candidate::{Candidate, Sees};
use crate::methods::{Joint, Method, Screened, fit_folds};
use crate::pipeline::{Corners, camera_names, explained, offered};
use calib_judge::Folds;
use calib_judge::held_out::folds_wanted;
use calib_rays::progress::Progress;
use calib_recording::dataset::{Dataset, stage};
use std::error::Error;

/// Our own estimate.
pub(super) struct Ours {
    pub candidate: Candidate,
    pub folds: Folds,
}

/// Estimates it, or says why not.
pub(super) fn estimate(
    dataset: &Dataset,
    corners: &Corners,
    folds: usize,
    progress: &dyn Progress,
) -> Result<Ours, String> {
    let offered = offered(dataset, corners).map_err(|error| chain(&error))?;
    let names = camera_names(dataset);
    let placements = stage::placements(dataset, &corners.views);
    progress.begin("our own estimate", 0);
    let screened = Screened::of(&offered.observations);
    let given = screened.given(&names, &placements);
    let solution = Joint.fit(&given, &calib_rays::progress::Silent);
    progress.end();
    let solution = solution.map_err(|error| chain(&explained(error, dataset, &offered.views)))?;
    let folds = folds_wanted(given.observations, folds);
    progress.begin("its held-out check", folds);
    let folds = fit_folds(&Joint, &given, given.observations, folds, None, progress);
    progress.end();
    let models = solution.rig.cameras.iter().map(|camera| {
        let kind = if camera.field.is_central() {
            "central ray field"
        } else {
            "ray field"
        };
        kind.to_owned()
    });
    Ok(Ours {
        candidate: Candidate {
            title: "our own estimate".to_owned(),
            files: Vec::new(),
            models: models.collect(),
            sees: Sees::Fields,
            has_places: true,
            saw_these: Some(true),
            board_shape: solution.board_shape.clone(),
            rig: solution.rig,
        },
        folds,
    })
}

/// An error with its causes, on a line.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut below = error.source();
    while let Some(cause) = below {
        text = format!("{text}: {cause}");
        below = cause.source();
    }
    text
}
