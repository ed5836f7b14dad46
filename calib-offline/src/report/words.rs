//! Choices and checks of the record in plain words, for the terminal and the page alike.

use super::nearest_pinhole::NearestPinhole;
use super::record::{Calibration, ChoicesRecord};
use crate::present::numbers::short;
use calib_estimate::joint::{Alternative, Choice, Family, Simpler};
use calib_judge::central_model::CentralModel;
use calib_judge::centrality::Centrality;
use calib_judge::half_data::{HalfData, HalfDataCheck, Skipped};
use calib_judge::model_choice::{Compared, ModelChoice};
use calib_rays::field::structured::{OFFSET_CORE_DEGREE, PLAIN_DEGREE, TILT_DEGREE};

/// How many numbers of a kind there are, and how many of them the data determine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NumbersUsed {
    /// Determined by the data, out of `all`.
    pub effective: f64,
    /// In the model.
    pub all: usize,
}

impl ChoicesRecord {
    /// Numbers of some families of one camera; `None` if it has none of them.
    pub fn numbers(&self, camera_idx: usize, of: impl Fn(Family) -> bool) -> Option<NumbersUsed> {
        let families = self
            .smoothness
            .iter()
            .filter(|found| found.camera_idx == camera_idx && of(found.family));
        let sum = families.fold((0.0, 0), |(effective, all), found| {
            (effective + found.effective, all + found.parameters)
        });
        (sum.1 > 0).then_some(NumbersUsed {
            effective: sum.0,
            all: sum.1,
        })
    }
}

/// The offset numbers of a camera.
pub fn offset_numbers(choices: &ChoicesRecord, camera_idx: usize) -> Option<NumbersUsed> {
    choices.numbers(camera_idx, |family| {
        matches!(family, Family::Offset(_) | Family::Pupil)
    })
}

/// Whether a camera is central, and how it follows its lens.
pub fn camera_model(calibration: &Calibration, camera_idx: usize) -> Option<String> {
    let choices = calibration.choices.as_ref()?;
    let checks = calibration.checks.as_ref()?;
    let offset = offset_numbers(choices, camera_idx);
    let found = checks.centrality.get(camera_idx)?;
    let rays = match offset {
        Some(numbers) if !found.central => format!(
            "non-central, {:.0} of {} offset numbers used, {}",
            numbers.effective,
            numbers.all,
            centrality(found)
        ),
        _ => "central (0 mm by choice)".to_owned(),
    };
    let spline = choices.numbers(camera_idx, |family| family == Family::Spline);
    let spline = spline.map_or(String::new(), |numbers| {
        format!(
            "; spline, {:.0} of {} numbers used",
            numbers.effective, numbers.all
        )
    });
    Some(rays + &spline)
}

fn centrality(found: &Centrality) -> String {
    let halves = found.halves_rms_mm.map_or(String::new(), |[a, b]| {
        format!("; by halves of the poses {} and {}", short(a), short(b))
    });
    format!(
        "rays {} mm RMS from one point (most {}{halves})",
        short(found.rms_mm),
        short(found.max_mm)
    )
}

/// What a central model would cost.
pub fn central_model(found: &CentralModel) -> String {
    match found {
        CentralModel::IsCentral { offsets_gain } => {
            let evidence = offsets_gain.map_or_else(
                || "the data leave offsets open".to_owned(),
                |gain| match gain {
                    // Such a model is given up before it settles.
                    far if far < -100.0 => {
                        "offsets would lower the evidence by over 100".to_owned()
                    }
                    near => format!("offsets would change the evidence by {}", change(near)),
                },
            );
            format!("costs nothing, the rig is central ({evidence})")
        }
        CentralModel::Costs {
            evidence_loss,
            points,
        } => {
            let points = points.map_or(String::new(), |difference| {
                format!(
                    "move points by {} mm RMS (most {}) and ",
                    short(difference.rms_mm),
                    short(difference.max_mm)
                )
            });
            format!(
                "would {points}change the evidence by {}",
                change(-evidence_loss)
            )
        }
        CentralModel::Declared {
            offsets_gain,
            points,
        } => {
            let points = points.map_or(String::new(), |difference| {
                format!(
                    " and move points by {} mm RMS (most {})",
                    short(difference.rms_mm),
                    short(difference.max_mm)
                )
            });
            format!(
                "declared (optics = \"plain\"); offsets would change the evidence by {}{points}",
                change(*offsets_gain)
            )
        }
        CentralModel::NoEstimate => "not known: without offsets there is no estimate".to_owned(),
    }
}

/// A camera as a pinhole.
pub fn nearest_pinhole(pinhole: &NearestPinhole) -> String {
    let [fx, fy] = pinhole.focal_px;
    let [cx, cy] = pinhole.principal_point_px;
    format!(
        "nearest pinhole: focal lengths {fx:.2} and {fy:.2} px, principal point ({cx:.2}, {cy:.2}), {} px RMS from the rays (most {})",
        short(pinhole.rms_px),
        short(pinhole.max_px)
    )
}

/// What unseen boards say to what the evidence chose.
pub fn model_choice(found: &ModelChoice) -> String {
    let compared: Vec<String> = found.compared.iter().map(simpler).collect();
    format!(
        "{} unseen boards: {} px RMS by what the evidence chose; {}",
        found.boards,
        short(found.rms_px),
        compared.join("; ")
    )
}

fn simpler(found: &Compared) -> String {
    let without = match found.without {
        Simpler::NoOffsets => "without offsets",
        Simpler::NoSpline => "without splines",
        Simpler::Neither => "without offsets and splines",
        Simpler::Plain => "by plain lenses",
    };
    let judged = match (found.taken, found.t) {
        (true, t) if t < -found.limit => "taken, as unseen boards are for it",
        (true, _) => "taken, as its evidence is larger and unseen boards do not object",
        (false, t) if t > found.limit => "worse",
        (false, _) => "no better",
    };
    let evidence = found
        .evidence_gain
        .map_or(String::new(), |gain| format!(", evidence {}", change(gain)));
    format!(
        "{without} {} px, t = {:+.1} of {:.1}{evidence}: {judged}",
        short(found.rms_px),
        found.t,
        found.limit
    )
}

/// A change of the evidence, without the sign of a negative zero.
fn change(gain: f64) -> String {
    format!("{:+.0}", gain.round() + 0.0)
}

/// What two halves of the poses say of each other.
pub fn half_data(check: &HalfDataCheck) -> String {
    match check {
        HalfDataCheck::Compared(halves) => format!(
            "two halves of the poses differ by {} mm RMS, {} predicted: ratio {:.2}, {}",
            short(halves.difference_rms_mm),
            short(halves.predicted_rms_mm),
            halves.ratio,
            judged(halves)
        ),
        HalfDataCheck::Skipped(reason) => format!("not compared: {}", skipped(*reason)),
    }
}

fn judged(halves: &HalfData) -> String {
    let [low, high] = halves.ratio_by_chance;
    let chance = format!("{low:.1} to {high:.1} by chance");
    if halves.is_larger() {
        format!("more than chance explains ({chance})")
    } else if halves.is_smaller() {
        format!("less than predicted ({chance}): a careful prediction, or both err alike")
    } else {
        format!("as predicted ({chance})")
    }
}

fn skipped(reason: Skipped) -> String {
    match reason {
        Skipped::NotWanted => "not asked for".to_owned(),
        Skipped::TooFewPoses { have, need } => {
            format!("{have} poses, {need} or more are needed to halve them")
        }
        Skipped::NoEstimate => "half of the poses does not determine the rig".to_owned(),
        Skipped::NoCommonPoints => "the halves see no points in common".to_owned(),
    }
}

/// An alternative that was tried.
pub fn alternative(choice: &Choice, calibration: &Calibration) -> String {
    match choice.tried {
        Alternative::Offsets => "offsets: rays that need not meet in one point".to_owned(),
        Alternative::OffsetsFirst => "offsets before penalized polynomials".to_owned(),
        Alternative::OffsetsAfresh => "offsets before any lens was fitted".to_owned(),
        Alternative::OffsetsForSpline => "offsets in place of the spline".to_owned(),
        Alternative::AllCentral => "all cameras central".to_owned(),
        Alternative::Lenses => "base lenses fitted anew".to_owned(),
        Alternative::Spline { cells } => {
            format!("spline of {cells} cells along the longer side of the sensor")
        }
        Alternative::Central { camera_idx } => {
            let camera = calibration.rig.cameras.get(camera_idx);
            format!("{} central", camera.map_or("camera", |c| c.name.as_str()))
        }
        Alternative::NoSpline => "no spline".to_owned(),
        Alternative::Pinhole => "pinholes with five numbers of distortion".to_owned(),
        Alternative::Plain { degree: None } => "plain lenses".to_owned(),
        Alternative::Plain {
            degree: Some(TILT_DEGREE),
        } => "lenses without skew and tilt".to_owned(),
        Alternative::Plain {
            degree: Some(degree),
        } => format!("directions without degree {degree}"),
    }
}

/// Its gain.
pub fn gain(choice: &Choice) -> String {
    choice.gain.map_or_else(
        || "open: the data do not determine it".to_owned(),
        |gain| format!("{gain:+.1}"),
    )
}

/// A family of numbers.
pub fn family(family: Family) -> String {
    match family {
        Family::Direction(PLAIN_DEGREE) => "direction, aspect and decentering".to_owned(),
        Family::Direction(TILT_DEGREE) => "direction, skew and tilt".to_owned(),
        Family::Direction(degree) => format!("direction, degree {degree}"),
        Family::Spline => "direction, spline".to_owned(),
        Family::Offset(OFFSET_CORE_DEGREE) => format!("offset, up to degree {OFFSET_CORE_DEGREE}"),
        Family::Offset(degree) => format!("offset, degree {degree}"),
        Family::Pupil => "offset, radial terms beyond".to_owned(),
    }
}

/// How bent the board was found to be.
pub fn board(choices: &ChoicesRecord) -> String {
    format!(
        "{} mm from its highest to its lowest corner, standard deviation {} mm",
        short(choices.board_peak_to_valley_mm),
        short(choices.board_peak_to_valley_sd_mm)
    )
}

/// How the residuals are distributed, and how many corners count.
pub fn noise(choices: &ChoicesRecord) -> String {
    let tails = if choices.noise_freedom >= 100.0 {
        "Gaussian".to_owned()
    } else {
        format!(
            "heavy-tailed (Student-t of {} degrees of freedom)",
            choices.noise_freedom
        )
    };
    format!(
        "{tails}; neighboring corners correlate by {:.2}, so {:.0} % of the corners count",
        choices.neighbor_correlation,
        100.0 * choices.effective_share
    )
}
