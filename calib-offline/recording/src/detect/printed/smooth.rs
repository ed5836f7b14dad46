//! Points that lie aside of where all others have them.

use crate::detect::ring_target::local_map::LocalMap;
use calib_rays::numerics::median;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Row and column.
pub type Label = (usize, usize);

/// Points farther from the map through all than this many times the median distance ...
const MAX_ASIDE: f64 = 7.0;
/// ... and than this are dropped, px. A map through points of a wide lens misses some by half of it.
const LEAST_ASIDE_PX: f64 = 0.2;
/// Rounds: without what lay aside, the map is better.
const ROUNDS: usize = 2;

/// Leaves out pixels that lie aside of a smooth map through all. `place` is a label's in the target's plane.
pub fn keep_smooth(
    known: &mut BTreeMap<Label, Vector2<f64>>,
    place: impl Fn(&Label) -> Option<Vector2<f64>>,
) {
    for _ in 0..ROUNDS {
        let pairs: Vec<_> = known
            .iter()
            .filter_map(|(label, pixel)| Some((place(label)?, *pixel)))
            .collect();
        let Some(map) = LocalMap::fit(&pairs) else {
            return;
        };
        let aside = |label: &Label, pixel: &Vector2<f64>| {
            place(label).map_or(f64::INFINITY, |at| (pixel - map.at(&at)).norm())
        };
        let Some(usual) = median(known.iter().map(|(l, p)| aside(l, p))) else {
            return;
        };
        let limit = (MAX_ASIDE * usual).max(LEAST_ASIDE_PX);
        let before = known.len();
        known.retain(|label, pixel| aside(label, pixel) <= limit);
        if known.len() == before {
            return;
        }
    }
}
