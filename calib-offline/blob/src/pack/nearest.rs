//! A blob all the same, where the bound cannot be held, and the best blob of a size.

use super::{PackError, PackSettings, Packed, pack};
use calib_rays::field::Rig;

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

/// The tightest bound tried for a size, px.
const TIGHTEST_PX: f64 = 0.000_5;
/// The loosest bound tried for a size, px.
pub const LOOSEST_PX: f64 = 1.0;
/// Steps between them, each by the same factor.
const STEPS: u32 = 44;

/// Packs a rig into no more bytes than `max_bytes`, with the smallest error that this allows: each
/// bound tried is a fifth looser than the one before. The bound of the settings is the loosest that is
/// accepted.
///
/// # Errors
/// [`PackError::TooFewBytes`] with the bytes that the loosest bound takes, and any other of [`pack`].
pub fn pack_within_bytes(
    rig: &Rig,
    settings: &PackSettings,
    max_bytes: usize,
) -> Result<Packed, PackError> {
    let loosest_px = settings.max_error_px.min(LOOSEST_PX);
    let factor = (LOOSEST_PX / TIGHTEST_PX).powf(1.0 / f64::from(STEPS));
    let attempt = |max_error_px: f64| {
        let settings = PackSettings {
            max_error_px,
            ..*settings
        };
        pack(rig, &settings)
    };
    let mut best = attempt(loosest_px)?.within(max_bytes)?;
    // By halving: the size grows as the bound gets tighter, but for small ripples.
    let bounds: Vec<f64> = (0..STEPS)
        .map(|k| TIGHTEST_PX * factor.powi(k as i32))
        .filter(|bound_px| *bound_px < loosest_px)
        .collect();
    let (mut low, mut high) = (0, bounds.len());
    while low < high {
        let middle = usize::midpoint(low, high);
        match attempt(bounds[middle]) {
            Ok(packed) if packed.bytes.len() <= max_bytes => {
                high = middle;
                best = packed;
            }
            Ok(_) | Err(PackError::BoundNotReached { .. }) => low = middle + 1,
            Err(other) => return Err(other),
        }
    }
    Ok(best)
}
