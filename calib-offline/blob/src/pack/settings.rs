//! What a rig is packed for.

use ray_runtime::format::IDENTITY_LEN;

/// What to pack for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PackSettings {
    /// No pixel in the calibrated area may be further from its ray than this, px.
    pub max_error_px: f64,
    /// The distance from the cameras at which things are measured, mm: an error in the offset of
    /// a ray counts as the pixels that it makes there.
    pub working_distance_mm: f64,
    /// First bytes of the hash that identifies the calibration.
    pub identity: [u8; IDENTITY_LEN],
    /// Whether the blob carries what is known of the rays' uncertainty, 648 bytes a pair for smooth lenses.
    pub with_uncertainty: bool,
    /// What matters among tables that hold the bound.
    pub prefer: Prefer,
    /// Whether the error of the arithmetic of integers is proven too, and written with its answers to the self-tests.
    pub with_integers: bool,
}

/// What matters among tables that hold the bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Prefer {
    /// The fewest bytes: a polynomial, and quantized knots of what it leaves.
    #[default]
    Size,
    /// The fewest instructions per lookup: cubic patches.
    Speed,
}

impl Default for PackSettings {
    /// 0.001 px at 1 m, an identity of zeros, the uncertainty, and the fewest bytes.
    fn default() -> Self {
        Self {
            max_error_px: 0.001,
            working_distance_mm: 1000.0,
            identity: [0; IDENTITY_LEN],
            with_uncertainty: true,
            prefer: Prefer::Size,
            with_integers: false,
        }
    }
}
