//! Which single views do not belong to their pair, and whether another reading of one of them does:
//! labels from another place of the board or mirrored, the two cameras' views exchanged, a view of
//! another pose. What no reading explains was not exposed at the same instant, or is another board.

use super::agreement::{ReadPair, agreement};
use super::finding::Explained;
use super::handedness::Hands;
use super::look::{Look, ViewPair};
use super::reading::Reading;
use super::whole_camera::WholeCamera;
use crate::cause::Code;
use calib_estimate::init::board_pose::{ViewFit, fit_view};
use calib_rays::board::BoardShape;
use calib_rays::geometry::so3;
use rayon::prelude::*;

/// Another reading is believed if the pair then fits better by this factor, px.
const CLEAR: f64 = 3.0;
/// A view is tried as that of a pose as many numbers away.
const MOST_STEPS: i64 = 2;

/// How one view of a pair is changed.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Change {
    First(Reading),
    Second(Reading),
    Exchanged,
    /// The second camera's view is that of the pose so many numbers on.
    OtherPose(i64),
}

/// A pair that fits when it is read otherwise.
pub struct Explanation {
    /// The view, and what it is.
    pub explained: Explained,
    /// What the pair misses by as recorded, and read so, RMS px.
    pub misfit_px: [f64; 2],
}

/// Explains the pairs that do not fit; those that nothing explains are not among the answers.
pub fn explain(look: &Look<'_>, hands: &Hands, whole: &WholeCamera) -> Vec<Explanation> {
    let readings = &whole.agreed.readings;
    let mut found: Vec<Explanation> = Vec::new();
    let turned: Vec<usize> = (0..readings.len())
        .filter(|k| readings[*k].fits && readings[*k].is_turned)
        .collect();
    for k in &turned {
        found.push(explanation(
            look,
            whole,
            *k,
            turned_one(whole, *k, &turned),
            readings[*k].misfit_px,
        ));
    }
    found.extend(exchanged_misfits(look, whole));
    let bad: Vec<usize> = (0..readings.len()).filter(|k| !readings[*k].fits).collect();
    if bad.is_empty() {
        return found;
    }
    let labels = Reading::of_labels().into_iter().chain(Reading::OF_PIXELS);
    let changes: Vec<Change> = labels
        .flat_map(|reading| [Change::Second(reading), Change::First(reading)])
        .chain([Change::Exchanged])
        .chain(
            (-MOST_STEPS..=MOST_STEPS)
                .filter(|s| *s != 0)
                .map(Change::OtherPose),
        )
        .collect();
    // For each change: the bad pairs that fit after it, and how well.
    let tried: Vec<(Change, Vec<(usize, f64)>)> = changes
        .into_par_iter()
        .map(|change| {
            let mut read = whole.read.clone();
            let mut changed = Vec::new();
            for k in &bad {
                if let Some(pair) = changed_pair(look, hands, whole, *k, change) {
                    read[*k] = pair;
                    changed.push(*k);
                }
            }
            let agreed = agreement(look, &read);
            let fitting = changed
                .into_iter()
                .filter_map(|k| {
                    let reading = agreed.as_ref()?.readings[k];
                    let is_clear = CLEAR * reading.misfit_px < readings[k].misfit_px;
                    (reading.fits && !reading.is_turned && is_clear)
                        .then_some((k, reading.misfit_px))
                })
                .collect();
            (change, fitting)
        })
        .collect();
    for k in bad {
        let of_pair = tried.iter().filter_map(|(change, fitting)| {
            let (_, misfit_px) = fitting.iter().find(|(pair, _)| *pair == k)?;
            Some((*change, *misfit_px))
        });
        if let Some((change, misfit_px)) = of_pair.min_by(|a, b| a.1.total_cmp(&b.1)) {
            found.push(explanation(look, whole, k, change, misfit_px));
        }
    }
    found
}

fn explanation(
    look: &Look<'_>,
    whole: &WholeCamera,
    pair: usize,
    change: Change,
    misfit_px: f64,
) -> Explanation {
    let pose = look.pose(whole.pairs[pair].pose_idx);
    let labels = |camera_idx: usize, reading: Reading| Explained {
        pose,
        camera_idx,
        code: reading.code(),
        reading: reading.to_string(),
    };
    let explained = match change {
        Change::First(reading) => labels(whole.reference, reading),
        Change::Second(reading) => labels(whole.camera_idx, reading),
        Change::Exchanged => exchange(look, whole, pose),
        Change::OtherPose(steps) => Explained {
            pose,
            camera_idx: whole.camera_idx,
            code: Code::PoseNumbering,
            reading: format!("as that of the pose {}", away(steps)),
        },
    };
    Explanation {
        explained,
        misfit_px: [whole.agreed.readings[pair].misfit_px, misfit_px],
    }
}

fn away(steps: i64) -> String {
    let word = if steps < 0 { "before" } else { "after" };
    match steps.abs() {
        1 => word.to_owned(),
        n => format!("{n} {word}"),
    }
}

/// The pair with the change; `None` if there is nothing to change so.
fn changed_pair(
    look: &Look<'_>,
    hands: &Hands,
    whole: &WholeCamera,
    pair: usize,
    change: Change,
) -> Option<ReadPair> {
    let views = whole.pairs[pair];
    let board = &look.dataset.board;
    let read = &whole.read[pair];
    let relabelled = |view: usize, fit: &ViewFit, reading: Reading| {
        let block = &look.observations.views[view];
        let is_odd = hands.of_view[view].is_some_and(|h| h != hands.camera(block.camera_idx));
        let labels = block.corners.iter();
        let mut labels = labels.map(|c| reading.label(board, c.row, c.col));
        (reading.mirrors() == is_odd && labels.all(|label| label.is_some()))
            .then(|| reading.of(board, fit))
    };
    match change {
        Change::First(reading) => Some(ReadPair {
            first: relabelled(views.first, &read.first, reading)?,
            second: read.second.clone(),
        }),
        Change::Second(reading) => Some(ReadPair {
            first: read.first.clone(),
            second: relabelled(views.second, &read.second, reading)?,
        }),
        Change::Exchanged => exchanged(look, whole, views),
        Change::OtherPose(steps) => {
            let pose = i64::try_from(look.pose(views.pose_idx)).ok()?;
            let mut others = look.observations.views.iter().zip(&look.fits);
            let (_, fit) = others.find(|(view, _)| {
                view.camera_idx == whole.camera_idx
                    && i64::try_from(look.pose(view.pose_idx)) == Ok(pose + steps)
            })?;
            Some(ReadPair {
                first: read.first.clone(),
                second: whole.reading.of(board, fit.as_ref()?),
            })
        }
    }
}

/// Both views, each through the other's camera.
fn exchanged(look: &Look<'_>, whole: &WholeCamera, views: ViewPair) -> Option<ReadPair> {
    let board = &look.dataset.board;
    let through = |camera_idx: usize, view: usize| {
        let field = &look.cameras[camera_idx].as_ref()?.field;
        let block = &look.observations.views[view];
        fit_view(field, board, &BoardShape::default(), block)
    };
    let second = through(whole.camera_idx, views.first)?;
    Some(ReadPair {
        first: through(whole.reference, views.second)?,
        second: whole.reading.of(board, &second),
    })
}

/// Pairs with a view that does not even fit its own camera: it may be the other's.
fn exchanged_misfits(look: &Look<'_>, whole: &WholeCamera) -> Vec<Explanation> {
    let views = look.observations.views.iter().enumerate();
    let of_camera = |camera_idx: usize| {
        let views = views.clone();
        views.filter(move |(_, view)| view.camera_idx == camera_idx)
    };
    let misfits: Vec<ViewPair> = of_camera(whole.camera_idx)
        .filter_map(|(second, view)| {
            let (first, _) =
                of_camera(whole.reference).find(|(_, v)| v.pose_idx == view.pose_idx)?;
            let is_misfit = look.fits[first].is_none() || look.fits[second].is_none();
            is_misfit.then_some(ViewPair {
                pose_idx: view.pose_idx,
                first,
                second,
            })
        })
        .collect();
    let mut read = whole.read.clone();
    let mut poses = Vec::new();
    for pair in misfits {
        if let Some(pair_read) = exchanged(look, whole, pair) {
            read.push(pair_read);
            poses.push(look.pose(pair.pose_idx));
        }
    }
    let Some(agreed) = agreement(look, &read).filter(|_| !poses.is_empty()) else {
        return Vec::new();
    };
    let readings = &agreed.readings[whole.read.len()..];
    poses
        .into_iter()
        .zip(readings)
        .filter(|(_, reading)| reading.fits && !reading.is_turned)
        .map(|(pose, reading)| Explanation {
            explained: exchange(look, whole, pose),
            misfit_px: [f64::INFINITY, reading.misfit_px],
        })
        .collect()
}

fn exchange(look: &Look<'_>, whole: &WholeCamera, pose: usize) -> Explained {
    Explained {
        pose,
        camera_idx: whole.camera_idx,
        code: Code::CamerasExchanged,
        reading: format!(
            "exchanged with that of camera {}",
            look.name(whole.reference)
        ),
    }
}

/// Of two views one of which is turned, the one that stands out among its camera's others.
fn turned_one(whole: &WholeCamera, pair: usize, turned: &[usize]) -> Change {
    let from_others = |of: fn(&ReadPair) -> &ViewFit| {
        let own = of(&whole.read[pair]).camera_from_board.rotation;
        let others = whole.read.iter().enumerate();
        others
            .filter(|(k, _)| !turned.contains(k))
            .map(|(_, other)| {
                so3::angle_rad(&(own.transpose() * of(other).camera_from_board.rotation))
            })
            .fold(f64::INFINITY, f64::min)
    };
    if from_others(|pair| &pair.first) > from_others(|pair| &pair.second) {
        Change::First(Reading::Turned)
    } else {
        Change::Second(Reading::Turned)
    }
}
