//! An old calibration against new boards: what changed, what it costs, what was seen.

use super::amounts::{Amount, amounts, cannot_tell};
use super::boards::measured_boards;
use super::cost::Probes;
use super::residuals::Residuals;
use super::verdict::{Found, NOTICED_SD, Seen, Validity};
use crate::cause::{Cause, Code};
use crate::grade::Grade;
use crate::suspect_words::{Told, advice, told};
use crate::suspects::{COSTLY, left_open_mm};
use crate::working_volume::span;
use calib_estimate::adjust::Observations;
use calib_estimate::explain::change::{Change, Changes, Visible};
use calib_estimate::explain::explain_change;
use calib_estimate::joint::Estimate;
use calib_rays::field::{CoverageMask, Rig};

/// Judges whether an estimate still holds, by new views of the board it was made from. `rig` is the
/// estimate's.
///
/// `None` if no new board can be placed.
///
/// Cost: about that of the estimate.
pub fn validity(old: &Estimate, rig: &Rig, new: &Observations) -> Option<Validity> {
    let names: Vec<String> = rig.cameras.iter().map(|c| c.name.clone()).collect();
    let changes = explain_change(old, new)?;
    let distances_mm = span(&old.board_distances_mm(rig));
    let left_open_mm = left_open_mm(&mut old.clone(), rig, &distances_mm).unwrap_or(0.0);
    let limit_mm = COSTLY * left_open_mm;
    let probes = Probes::new(rig, &distances_mm)?;
    let baselines_mm: Vec<f64> = old
        .model
        .cameras
        .iter()
        .map(|camera| camera.camera_from_rig.translation_mm.norm())
        .collect();
    let judge = Judge {
        old,
        names: &names,
        baselines_mm: &baselines_mm,
        probes: &probes,
        limit_mm,
        since: changes.new_poses.first().copied(),
        distances_mm: &distances_mm,
    };
    let mut causes: Vec<Found> = changes.found.iter().map(|c| judge.found(c)).collect();
    // A board that became longer one way may have become longer both ways, and what less evidence says of
    // the rig is as well the board's doing.
    let board_at = causes.iter().position(|found| {
        found.cause.code == Code::SquareScaleAxis && found.cause.grade > Grade::Pass
    });
    let sure = board_at.unwrap_or(causes.len());
    for found in causes.iter_mut().skip(sure) {
        found.cause.grade = found.cause.grade.min(Grade::Doubtful);
    }
    let of_rig: Vec<&Change> = changes.found.iter().take(sure).collect();
    let cannot_tell = judge.cannot_tell(&changes, &causes);
    let worst = worst_unnoticed(&probes, &changes.visible);
    let unnoticed_mm = worst.as_ref().map(|(mm, _)| NOTICED_SD * mm);
    let sigma_px = old.noise.variance_px2.sqrt();
    let boards = measured_boards(rig, new, sigma_px, |_| true);
    let old_boards = measured_boards(rig, &old.observations, sigma_px, |_| true);
    let residuals = Residuals::of(&changes);
    let mut validity = Validity {
        verdict: Grade::Pass,
        reasons: Vec::new(),
        cause: None,
        cost_mm: judge.total_mm(&of_rig),
        limit_mm,
        left_open_mm,
        unnoticed_mm,
        cameras: seen(rig, new),
        causes,
        cannot_tell,
        poses: changes.new_poses.clone(),
        rms_px: residuals.new_px,
        old_rms_px: residuals.old_px,
        boards,
        old_boards,
        distances_mm: distances_mm.clone(),
    };
    let noise_mm = validity.old_boards.map_or_else(
        || point_noise_mm(rig, &distances_mm, sigma_px),
        |b| b.neighbor_noise_mm,
    );
    validity.judge(&residuals, noise_mm);
    Some(validity)
}

/// What one needs to judge a change.
struct Judge<'a> {
    old: &'a Estimate,
    names: &'a [String],
    baselines_mm: &'a [f64],
    probes: &'a Probes<'a>,
    limit_mm: f64,
    since: Option<usize>,
    distances_mm: &'a [f64],
}

impl Judge<'_> {
    fn found(&self, change: &Change) -> Found {
        let found = &change.explanation;
        let amounts = amounts(found, self.names, self.baselines_mm);
        let Told { code, size, what } = told(found, self.old, self.names);
        let size = in_words(&amounts, size);
        let is_of_rig = is_of_rig(code);
        let cost_mm = if is_of_rig {
            self.probes.cost_mm(&change.sizes).unwrap_or(f64::INFINITY)
        } else {
            self.of_board_mm(change, code)
        };
        let grade = match (cost_mm > self.limit_mm, is_of_rig) {
            (false, _) => Grade::Pass,
            (true, true) => Grade::Fail,
            (true, false) => Grade::Doubtful,
        };
        let advice = if grade == Grade::Pass {
            "that is within the limit"
        } else {
            advice(code)
        };
        let range = match (self.distances_mm.first(), self.distances_mm.last()) {
            (Some(near), Some(far)) => format!("at {near:.0} to {far:.0} mm"),
            _ => String::new(),
        };
        let text = if is_of_rig {
            format!(
                "{what} since the calibration: {size}; it moves measured points by {cost_mm:.3} mm RMS {range}; {advice}"
            )
        } else {
            format!(
                "{what} in the new recording: {size}; that may hide changes of the rig; {advice}"
            )
        };
        let cause = Cause {
            code,
            since_pose: self.since,
            size,
            cost_mm,
            text,
            grade,
        };
        Found {
            cause,
            evidence: found.gain,
            amounts,
        }
    }

    /// How far corners of the new boards are from where they ought to be by a fault of the new
    /// recording, mm.
    fn of_board_mm(&self, change: &Change, code: Code) -> f64 {
        let (width_mm, height_mm) = self.old.observations.board.extent_mm();
        let found = &change.explanation;
        let rms = calib_rays::numerics::rms(&found.values).unwrap_or(0.0);
        match code {
            Code::SquareScaleAxis => rms * width_mm.max(height_mm) / 4.0,
            Code::RollingShutter => {
                let per_px = self.probes.mm_per_px();
                rms * per_px
            }
            _ => rms,
        }
    }

    /// Cost of all changes of the rig together, mm.
    fn total_mm(&self, changes: &[&Change]) -> f64 {
        let mut sum = vec![[0.0; calib_estimate::explain::effects::OF_CAMERA]; self.names.len()];
        for change in changes {
            for (sum, own) in sum.iter_mut().zip(&change.sizes) {
                for (sum, own) in sum.iter_mut().zip(own) {
                    *sum += own;
                }
            }
        }
        self.probes.cost_mm(&sum).unwrap_or(f64::INFINITY)
    }

    fn cannot_tell(&self, changes: &Changes, causes: &[Found]) -> Vec<String> {
        let pairs = changes.found.iter().zip(causes);
        let mut said: Vec<String> = pairs
            .filter_map(|(change, found)| {
                cannot_tell(&change.explanation, self.names, &found.amounts)
            })
            .collect();
        said.extend(
            changes
                .found
                .iter()
                .flat_map(|change| &change.rivals)
                .map(|rival| {
                    let amounts = amounts(rival, self.names, self.baselines_mm);
                    let Told { size, what, .. } = told(rival, self.old, self.names);
                    let size = in_words(&amounts, size);
                    format!("it may as well be that {what}: {size}")
                }),
        );
        if self.names.len() == 1 {
            said.push(
                "one camera alone shows changes of its own lens and pixels, and none of where it stands"
                    .to_owned(),
            );
        }
        said.push(
            "a motion of the rig as a whole is not seen, and changes no measured shape".to_owned(),
        );
        said
    }
}

/// Amounts in words, or else a size.
fn in_words(amounts: &[Amount], size: String) -> String {
    if amounts.is_empty() {
        return size;
    }
    let words: Vec<String> = amounts.iter().map(Amount::words).collect();
    words.join(", ")
}

/// Whether a code is about the cameras, and not about the new recording.
fn is_of_rig(code: Code) -> bool {
    matches!(
        code,
        Code::CameraMoved
            | Code::BaselineChanged
            | Code::FocusChanged
            | Code::WindowShifted
            | Code::PixelOrigin
    )
}

/// The kind of change that may hide most, with its cost at one standard deviation, mm.
fn worst_unnoticed<'a>(probes: &Probes, visible: &'a [Visible]) -> Option<(f64, &'a Visible)> {
    let all = visible
        .iter()
        .filter_map(|visible| Some((probes.open_mm(visible)?, visible)));
    all.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// What the noise of a pixel is at the middle distance, mm: of a camera alone.
fn point_noise_mm(rig: &Rig, distances_mm: &[f64], sigma_px: f64) -> f64 {
    let probes = Probes::new(rig, distances_mm);
    sigma_px * probes.map_or(0.0, |probes| probes.mm_per_px())
}

/// What the new corners show of each camera.
fn seen(rig: &Rig, new: &Observations) -> Vec<Seen> {
    let cameras = rig.cameras.iter().enumerate();
    cameras
        .map(|(camera_idx, camera)| {
            let views = new.views.iter();
            let views = views.filter(|view| view.camera_idx == camera_idx);
            let pixels: Vec<_> = views
                .flat_map(|view| view.corners.iter().map(|corner| corner.pixel))
                .collect();
            let covered = CoverageMask::from_corners(camera.field.sensor, pixels.iter().copied());
            Seen {
                name: camera.name.clone(),
                corners: pixels.len(),
                share: covered.covered_share() / camera.coverage.covered_share(),
            }
        })
        .collect()
}
