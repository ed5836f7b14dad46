//! What changed between an old recording and a few new poses.
//!
//! The old corners stay in the equations, so that the old rig is held as well as they held it and no
//! better; the new boards join them. What may have changed in between competes for the residuals, as in
//! [`search`](super::search) but with this one change point, and from numbers that the new boards alone
//! give through the old rig: a knock of many pixels is found as well as one of a tenth.

use super::effects::Effect::{BoardScale, Focus, SkewU, SkewV};
use super::effects::{Effect, OF_CAMERA};
use super::explained::{Explained, Explanation, fitted_from, scores, settled_anew};
use super::held::{Held, held, placed};
use super::search::{
    LEFT_BY_LINEARITY, MOVE, NEEDED, SHAPE, SHIFT, TURN, TURN_AND_MOVE, detrended_share,
};
use super::suspicion::{Since, Suspect, Suspicion};
use crate::adjust::robust::LN_OUTLIER_DENSITY;
use crate::adjust::{Model, Observations};
use crate::joint::Estimate;
use crate::joint::fit::Fit;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Changes at most.
const MOST: usize = 3;
/// What origins and regions of pixels move by is a multiple of it, px.
const HALF_PX: f64 = 0.5;

/// Sizes of the effects that each camera has by itself, in the units of
/// [`Effect::unit`](super::effects::Effect::unit)'s quantity (px, shares, rad, mm).
pub type CameraSizes = Vec<[f64; OF_CAMERA]>;

/// Something that changed.
#[derive(Debug, Clone)]
pub struct Change {
    /// What: its numbers are those after it minus those before.
    pub explanation: Explanation,
    /// What it does to each camera.
    pub sizes: CameraSizes,
    /// What explains the new boards as well, within the evidence's error.
    pub rivals: Vec<Explanation>,
}

/// How well a change would show.
#[derive(Debug, Clone)]
pub struct Visible {
    /// What.
    pub suspect: Suspect,
    /// What a unit of each of its numbers does to each camera.
    pub sizes: Vec<CameraSizes>,
    /// Covariance of the numbers, in units, by what is seen and nothing else.
    pub covariance: DMatrix<f64>,
}

/// What old corners and new boards say together.
#[derive(Debug, Clone)]
pub struct Changes {
    /// What changed, most important first.
    pub found: Vec<Change>,
    /// How well each kind of change would show beside those.
    pub visible: Vec<Visible>,
    /// Everything together, the new corners without what was found: the rig as it was.
    pub together: Estimate,
    /// New poses that could be placed, by their numbers.
    pub new_poses: Vec<usize>,
    /// Index of the first new pose in `together`.
    pub first_new: usize,
}

/// What changed between an estimate and new views of its board by its cameras.
///
/// `None` if no camera can place a new board, or if no change brings the new boards and the old rig together.
///
/// Cost: ten to twenty times that of the last rounds of an estimate, in parallel.
pub fn explain_change(old: &Estimate, new: &Observations) -> Option<Changes> {
    let places = placed(&old.model, new);
    let mut new = new.with_pose_indices(|pose| places[pose].is_some());
    let start: Vec<_> = places.into_iter().flatten().collect();
    if start.is_empty() {
        return None;
    }
    let first_new = old.observations.poses.len();
    let mut fit = old.fit.clone();
    fit.share = fit.share.max(detrended_share(old));
    let together = |held: &Held| -> (Fit, Observations) {
        let observations = joined(&old.observations, &held.observations);
        let mut fit = fit.clone();
        let poses = &mut fit.model.rig_from_board;
        poses.extend(&held.rig_from_board);
        (fit.on(&observations), observations)
    };
    let unchanged = |new: &Observations| -> Option<Explained> {
        let nothing = Suspicion::common(new, Suspect::BoardScale, Since::Always, None, &[]);
        let (fit, observations) = together(&held(&old.model, new, start.clone(), &nothing)?);
        let candidate = settled_anew(fit, &observations)?;
        Some(Explained {
            candidate,
            observations,
        })
    };
    // Where the new boards contradict the old rig so much that all their corners are outliers, nothing
    // holds them.
    let outliers = || -> Option<f64> {
        let alone = settled_anew(fit.clone(), &old.observations)?;
        let corners = new.corner_count() as f64;
        Some(alone.evidence + 2.0 * fit.share * corners * LN_OUTLIER_DENSITY)
    };
    let mut base = unchanged(&new);
    let mut rival = match &base {
        Some(base) => base.candidate.evidence,
        None => outliers()?,
    };
    let mut found = Vec::new();
    let mut needed = NEEDED;
    while found.len() < MOST {
        let alone = suspicions(&old.model, &new, &Since::Always);
        let since = Since::From(first_new);
        let beside = suspicions(&old.model, &joined(&old.observations, &new), &since);
        let all: Vec<_> = alone
            .into_par_iter()
            .zip(beside)
            .filter_map(|(alone, beside)| {
                let held = held(&old.model, &new, start.clone(), &alone)?;
                let (fit, observations) = together(&held);
                let numbers = held.numbers.clone();
                let fitted = fitted_from(rival, fit, observations, &beside, numbers)?;
                Some((fitted.0, (fitted.1, beside)))
            })
            .collect();
        let Some(ahead) = ahead(all, needed) else {
            break;
        };
        let (explanation, (explained, suspicion)) = ahead.best;
        needed = needed.max(LEFT_BY_LINEARITY * explanation.gain);
        let units = suspicion.units.iter().zip(&explanation.values);
        let numbers: Vec<f64> = units.map(|(unit, value)| value / unit).collect();
        found.push(Change {
            sizes: camera_sizes(&suspicion, &explained.observations, first_new, &numbers),
            explanation,
            rivals: ahead.rivals,
        });
        new = new_part(&explained.observations, &new, first_new);
        let rest = unchanged(&new)?;
        rival = rest.candidate.evidence;
        base = Some(rest);
    }
    let mut base = base?;
    let visible = visible(&mut base, &old.model, first_new);
    Some(Changes {
        found,
        visible,
        new_poses: new.poses.clone(),
        first_new,
        together: old.remade(base.candidate.fit, base.observations),
    })
}

/// The best of some explanations, and those that are as good.
struct Ahead<T> {
    best: (Explanation, T),
    rivals: Vec<Explanation>,
}

/// `None` if none gains enough.
fn ahead<T>(mut all: Vec<(Explanation, T)>, needed: f64) -> Option<Ahead<T>> {
    all.sort_by(|(a, _), (b, _)| weighed(b).total_cmp(&weighed(a)));
    let mut all = all.into_iter();
    let best = all.next().filter(|(best, _)| best.gain > needed)?;
    let least = weighed(&best.0) - NEEDED;
    let rivals = all
        .map(|(found, _)| found)
        .filter(|found| found.is_likely() && weighed(found) > least)
        .filter(|found| !has_more_of(found.suspect, best.0.suspect))
        .collect();
    Some(Ahead { best, rivals })
}

/// The gain of an explanation with what is known of such changes. Pixel origins and regions move by whole
/// or half pixels: a shift by such has no free number, and any other is rather a turn.
fn weighed(found: &Explanation) -> f64 {
    let Some(rounded) = found.half_pixels() else {
        return if found.is_likely() {
            found.gain
        } else {
            found.gain - NEEDED
        };
    };
    let numbers = found.values.iter().zip(&found.sd).zip(rounded);
    let largest = numbers.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let fixed = largest.map_or(0.0, |((value, sd), rounded)| {
        // Density there, over that of numbers anywhere within half a pixel.
        let density = (HALF_PX / (2.0 * std::f64::consts::PI).sqrt() / sd).ln();
        2.0 * density - ((value - rounded) / sd).powi(2)
    });
    found.gain + fixed
}

/// Whether what a suspect may do holds all that another one may.
fn has_more_of(more: Suspect, less: Suspect) -> bool {
    match (more, less) {
        (
            Suspect::Moved { camera_idx },
            Suspect::Turned { camera_idx: k } | Suspect::Baseline { camera_idx: k },
        ) => camera_idx == k,
        (Suspect::Shift { camera_idx: None }, Suspect::Shift { .. }) => true,
        _ => false,
    }
}

/// How well changes of the cameras would show.
fn visible(base: &mut Explained, model: &Model, first_new: usize) -> Vec<Visible> {
    let observations = &base.observations;
    let Some(scores) = scores(&mut base.candidate.fit, observations) else {
        return Vec::new();
    };
    let seen = |suspicion: Suspicion| {
        let (_, information) = scores.of(&suspicion);
        let count = suspicion.numbers.len();
        let unit = |k: usize| {
            let mut one = vec![0.0; count];
            one[k] = 1.0;
            camera_sizes(&suspicion, observations, first_new, &one)
        };
        Some(Visible {
            suspect: suspicion.suspect,
            sizes: (0..count).map(unit).collect(),
            covariance: information.cholesky()?.inverse(),
        })
    };
    let is_of_rig = |suspicion: &Suspicion| {
        matches!(
            suspicion.suspect,
            Suspect::Turned { .. } | Suspect::Baseline { .. } | Suspect::Focus { .. }
        )
    };
    suspicions(model, observations, &Since::From(first_new))
        .into_iter()
        .filter(is_of_rig)
        .filter_map(seen)
        .collect()
}

/// What numbers (in units) do to each camera that saw a new pose.
fn camera_sizes(
    suspicion: &Suspicion,
    observations: &Observations,
    first_new: usize,
    numbers: &[f64],
) -> CameraSizes {
    let cameras = 0..observations.sensors.len();
    cameras
        .map(|camera_idx| {
            let views = observations.views.iter();
            let view = views
                .clone()
                .position(|view| view.camera_idx == camera_idx && view.pose_idx >= first_new);
            let all = view.map(|view| suspicion.sizes(view, numbers));
            let mut own = [0.0; OF_CAMERA];
            if let Some(all) = all {
                own.copy_from_slice(&all[..OF_CAMERA]);
            }
            own
        })
        .collect()
}

/// Old views with new ones, whose poses come behind.
fn joined(old: &Observations, new: &Observations) -> Observations {
    let mut all = old.clone();
    let (first, number) = (old.poses.len(), old.poses.last().map_or(0, |last| last + 1));
    all.poses.extend(new.poses.iter().map(|pose| number + pose));
    for view in &new.views {
        let mut view = view.clone();
        view.pose_idx += first;
        all.views.push(view);
    }
    all.views
        .sort_by_key(|view| (view.camera_idx, view.pose_idx));
    all
}

/// The new views again, as they are in `all`.
fn new_part(all: &Observations, new: &Observations, first_new: usize) -> Observations {
    let mut part = all.with_pose_indices(|pose| pose >= first_new);
    part.poses.clone_from(&new.poses);
    part
}

/// What may have changed. The change of a camera alone that no other camera is beside is none.
fn suspicions(model: &Model, observations: &Observations, since: &Since) -> Vec<Suspicion> {
    let common = |suspect, cameras, effects: &[Effect]| {
        Suspicion::common(observations, suspect, since.clone(), cameras, effects)
    };
    let every = |suspect, camera, effects: &[Effect], per_view| {
        Suspicion::every(observations, suspect, camera, effects, per_view)
            .only(observations, since.clone())
    };
    let mut list = vec![
        common(Suspect::BoardScale, None, &[BoardScale]),
        every(Suspect::BoardFlexes, None, &SHAPE, false),
        every(Suspect::RollingShutter, None, &[SkewU, SkewV], true),
    ];
    let cameras = model.cameras.len();
    if cameras > 1 {
        let all = Suspect::Focus { camera_idx: None };
        list.push(common(all, None, &[Focus]));
        let all = Suspect::Shift { camera_idx: None };
        list.push(Suspicion::each_camera(observations, all, since, &SHIFT));
    }
    for camera_idx in 0..cameras {
        let one = Some(camera_idx);
        list.push(common(Suspect::Focus { camera_idx: one }, one, &[Focus]));
        list.push(common(Suspect::Shift { camera_idx: one }, one, &SHIFT));
        // Of two cameras, what the first does the second does the other way.
        if camera_idx > 0 || cameras > 2 {
            list.push(common(Suspect::Turned { camera_idx }, one, &TURN));
            list.push(common(Suspect::Moved { camera_idx }, one, &TURN_AND_MOVE));
        }
        if camera_idx > 0 {
            let place = &model.cameras[camera_idx].camera_from_rig;
            let direction = place.translation_mm.normalize();
            list.push(Suspicion::baseline(
                observations,
                camera_idx,
                since.clone(),
                &direction,
            ));
            let late = Suspect::Late { camera_idx };
            list.push(every(late, one, &MOVE, false));
        }
    }
    list
}
