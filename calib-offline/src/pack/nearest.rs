//! A blob all the same, where the bound cannot be held.

use super::{PackError, PackSettings, Packed, pack};
use crate::field::Rig;

/// What is asked for over the best that was reached: a little room for the pixels that the search
/// did not look at, and for grids smaller than the best one.
const ROOM: f64 = 1.2;
/// Attempts: each camera may fail once in the search and once in the proof.
const ATTEMPTS: usize = 6;

/// Packs a rig within the bound, or within the nearest one that can be held.
///
/// Round-off alone is a share of the sensor's width: a very large sensor or a very long lens may
/// have none that is as small as asked for. [`Packed::worst_error_px`] says what was reached.
///
/// # Errors
/// Any other [`PackError`].
pub fn pack_nearest(rig: &Rig, settings: &PackSettings) -> Result<Packed, PackError> {
    let mut settings = *settings;
    for _ in 1..ATTEMPTS {
        match pack(rig, &settings) {
            Err(PackError::BoundNotReached { best_px, .. }) if best_px.is_finite() => {
                settings.max_error_px = ROOM * best_px.max(settings.max_error_px);
            }
            other => return other,
        }
    }
    pack(rig, &settings)
}
