//! Whether all views of one camera are meant otherwise than they are written: labels shifted or
//! mirrored, v upwards, poses counted differently. The cameras then agree on no place to each other, or
//! only badly; with the true reading they do.

use super::agreement::{ReadPair, agreement, own_variance_px2};
use super::handedness::Hands;
use super::look::{Look, ViewPair};
use super::reading::Reading;
use calib_estimate::init::pair_consensus::Consensus;
use calib_rays::geometry::so3;
use rayon::prelude::*;

/// The middle pair may miss by this many times what corners explain (variance) before other readings are
/// tried: fields are cubic here, and lack something.
const SUSPICIOUS: f64 = 9.0;
/// Another reading is believed if the middle pair then fits better by this factor (variance): 3 in px.
const CLEAR: f64 = 9.0;
/// Poses out of step must fit better by more, 10 in px: on a stage that turns by equal steps all pairs of
/// one placement agree on some other place of the cameras.
const CLEAR_STEPS: f64 = 100.0;
/// And so many of the pairs must be left.
const LEFT_SHARE: f64 = 0.75;
/// Readings that fit the same to within this factor (variance) are told apart by what is more usual.
const SAME: f64 = 2.0;
/// Poses are tried out of step by as many.
const MOST_STEPS: i64 = 3;

/// How all views of a camera are to be read.
pub struct WholeCamera {
    /// The camera that it was compared with.
    pub reference: usize,
    /// The camera.
    pub camera_idx: usize,
    /// Its views.
    pub reading: Reading,
    /// What is to be added to its pose numbers.
    pub steps: i64,
    /// The pairs, paired so.
    pub pairs: Vec<ViewPair>,
    /// The same, read so.
    pub read: Vec<ReadPair>,
    /// What they agree on.
    pub agreed: Consensus,
    /// What the middle pair misses by as recorded, RMS px.
    pub as_recorded_px: f64,
}

/// Reads a camera's views against those of the reference; `None` with fewer than two common poses.
pub fn read_camera(
    look: &Look<'_>,
    hands: &Hands,
    reference: usize,
    camera_idx: usize,
) -> Option<WholeCamera> {
    let attempt = |reading: Reading, steps: i64| -> Option<WholeCamera> {
        let pairs = look.pairs(reference, camera_idx, steps);
        let board = &look.dataset.board;
        let read: Vec<ReadPair> = pairs
            .iter()
            .filter_map(|pair| ReadPair::as_recorded(look, pair))
            .map(|pair| ReadPair {
                second: reading.of(board, &pair.second),
                first: pair.first,
            })
            .collect();
        let agreed = agreement(look, &read)?;
        Some(WholeCamera {
            reference,
            camera_idx,
            reading,
            steps,
            pairs,
            read,
            as_recorded_px: agreed.typical_px,
            agreed,
        })
    };
    let plain = attempt(Reading::AsRecorded, 0)?;
    let own_px2 = own_variance_px2(&plain.read);
    if plain.agreed.variance_px2 <= SUSPICIOUS * own_px2 {
        return Some(plain);
    }
    let differs = hands.camera(reference) != hands.camera(camera_idx);
    let of_labels = Reading::of_labels().into_iter();
    let readings = of_labels
        .chain(Reading::OF_PIXELS)
        .filter(|reading| *reading != Reading::Turned && reading.mirrors() == differs)
        .map(|reading| (reading, 0));
    let out_of_step = (-MOST_STEPS..=MOST_STEPS)
        .filter(|steps| *steps != 0)
        .map(|steps| (Reading::AsRecorded, steps));
    let candidates: Vec<(Reading, i64)> = readings.chain(out_of_step).collect();
    let variance = |found: &WholeCamera| found.agreed.variance_px2;
    let is_clear = |found: &WholeCamera| {
        let factor = if found.steps == 0 { CLEAR } else { CLEAR_STEPS };
        let left = found.pairs.len() as f64 >= LEFT_SHARE * plain.pairs.len() as f64;
        left && factor * variance(found) < variance(&plain)
    };
    let tried: Vec<WholeCamera> = candidates
        .into_par_iter()
        .filter_map(|(reading, steps)| attempt(reading, steps))
        .filter(is_clear)
        .collect();
    let least = tried.iter().map(variance).fold(f64::INFINITY, f64::min);
    if tried.is_empty() {
        return Some(plain);
    }
    let as_recorded_px = plain.agreed.typical_px;
    let best = tried
        .into_iter()
        .filter(|found| variance(found) <= SAME * least)
        .min_by(|a, b| unusual(look, a).total_cmp(&unusual(look, b)))?;
    Some(WholeCamera {
        as_recorded_px,
        ..best
    })
}

/// Cameras of a rig stand upright to each other, and labels are on the board; radians, or more.
fn unusual(look: &Look<'_>, found: &WholeCamera) -> f64 {
    let turn_rad = so3::angle_rad(&found.agreed.second_from_first.rotation);
    let readings = &found.agreed.readings;
    let turned = readings.iter().filter(|reading| reading.is_turned).count();
    let mut unusual = turn_rad + turned as f64 / readings.len().max(1) as f64;
    if !is_possible(look, found.camera_idx, found.reading) {
        unusual += std::f64::consts::TAU;
    }
    unusual
}

/// Whether the labels of all views of a camera are on the board if they are read so.
pub fn is_possible(look: &Look<'_>, camera_idx: usize, reading: Reading) -> bool {
    let board = &look.dataset.board;
    let views = look.observations.views.iter();
    views
        .filter(|view| view.camera_idx == camera_idx)
        .flat_map(|view| &view.corners)
        .all(|corner| reading.label(board, corner.row, corner.col).is_some())
}
