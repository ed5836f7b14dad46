//! A blob all the same, where the bound cannot be held, and the best blob of a size.

use super::{PackError, PackSettings, Packed, Packer};
use calib_rays::field::Rig;
use calib_rays::progress::Silent;

/// Packs a rig.
///
/// # Errors
/// Any [`PackError`]; [`PackError::BoundNotReached`] says what would have been possible.
pub fn pack(rig: &Rig, settings: &PackSettings) -> Result<Packed, PackError> {
    Packer::new(rig, settings, &Silent)?.within(settings.max_error_px)
}

/// [`Packer::nearest`], unwatched.
///
/// # Errors
/// As there.
pub fn pack_nearest(rig: &Rig, settings: &PackSettings) -> Result<Packed, PackError> {
    Packer::new(rig, settings, &Silent)?.nearest()
}

/// [`Packer::within_bytes`], unwatched.
///
/// # Errors
/// As there.
pub fn pack_within_bytes(
    rig: &Rig,
    settings: &PackSettings,
    max_bytes: usize,
) -> Result<Packed, PackError> {
    Packer::new(rig, settings, &Silent)?.within_bytes(max_bytes)
}

/// What is asked for over the best that was reached: a little room for the pixels that the search
/// did not look at, and for grids smaller than the best one.
const ROOM: f64 = 1.2;
/// Bounds tried: each camera may fail once in the search and once in the proof.
const ATTEMPTS: usize = 6;

/// The tightest bound tried for a size, px.
const TIGHTEST_PX: f64 = 0.000_5;
/// The loosest bound tried for a size, px.
pub const LOOSEST_PX: f64 = 1.0;
/// Steps between them, each by the same factor.
const STEPS: u32 = 44;

impl Packer<'_> {
    /// Packs within the bound of the settings, or within the nearest one that can be held, or else the tables
    /// that turned out best: there is always a blob, unless a table cannot be made at all.
    ///
    /// Round-off alone is a share of the sensor's width: a very large sensor or a very long lens may
    /// have none that is as small as asked for. [`Packed::worst_error_px`] says what was reached.
    ///
    /// # Errors
    /// Any other [`PackError`].
    pub fn nearest(&mut self) -> Result<Packed, PackError> {
        let mut bound_px = self.settings().max_error_px;
        for _ in 0..ATTEMPTS {
            match self.within(bound_px) {
                Err(PackError::BoundNotReached { best_px, .. }) if best_px.is_finite() => {
                    bound_px = ROOM * best_px.max(bound_px);
                }
                Err(PackError::BoundNotReached { .. }) => break,
                other => return other,
            }
        }
        self.best()
    }

    /// Packs into no more bytes than `max_bytes`, with the smallest error that this allows: each
    /// bound tried is a fifth looser than the one before. The bound of the settings is the loosest that is
    /// accepted.
    ///
    /// # Errors
    /// [`PackError::TooFewBytes`] with the bytes that the loosest bound takes, and any other of
    /// [`within`](Self::within).
    pub fn within_bytes(&mut self, max_bytes: usize) -> Result<Packed, PackError> {
        let loosest_px = self.settings().max_error_px.min(LOOSEST_PX);
        let factor = (LOOSEST_PX / TIGHTEST_PX).powf(1.0 / f64::from(STEPS));
        let mut best = self.within(loosest_px)?.within(max_bytes)?;
        // By halving: the size grows as the bound gets tighter, but for small ripples.
        let bounds: Vec<f64> = (0..STEPS)
            .map(|k| TIGHTEST_PX * factor.powi(k as i32))
            .filter(|bound_px| *bound_px < loosest_px)
            .collect();
        let (mut low, mut high) = (0, bounds.len());
        while low < high {
            let middle = usize::midpoint(low, high);
            match self.within(bounds[middle]) {
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
}
