//! Random streams: one per purpose, camera and pose, so that no disturbance depends on another.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// What random numbers are drawn for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Corner noise.
    Noise = 1,
    /// Which corners are missing.
    Missing = 2,
    /// Which corners are wrong, and by how much.
    Outliers = 3,
    /// Run-out of the stage.
    Stage = 4,
    /// Points to be measured.
    Points = 5,
    /// Poses and corners held out.
    Holdout = 6,
    /// Noise on the pixels of matches.
    MatchNoise = 7,
    /// Noise of the rendered images.
    ImageNoise = 8,
    /// Heavy tails of the corner noise.
    NoiseTail = 10,
    /// Placements beyond the listed ones.
    Placements = 9,
    /// Where a board in the hand is shown.
    HandHeld = 11,
    /// What a planted fault draws.
    Fault = 12,
}

/// The stream of a purpose for one (a, b), for instance (camera, pose).
pub(super) fn stream(seed: u64, purpose: Purpose, a: usize, b: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((purpose as u64) << 48 | (a as u64 & 0xffff) << 32 | (b as u64 & 0xffff_ffff));
    rng
}

/// A standard normal number.
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

/// A uniform number in [0, 1).
pub(super) fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    rng.random()
}

/// A uniform number between two bounds.
pub(super) fn between(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * uniform(rng)
}
