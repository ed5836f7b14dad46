//! What can be chosen in the search for the target.

/// Choices in the search for the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetSettings {
    /// How often the centers are corrected for the perspective; 0 leaves the middles of the rings'
    /// images. The second time the map behind the correction is free of the first error.
    pub correction_rounds: usize,
    /// Added in quadrature to the standard deviation that each fit predicts from its own residuals,
    /// for what all models of an edge leave out, px.
    pub sigma_floor_px: f64,
}

impl Default for TargetSettings {
    fn default() -> Self {
        Self {
            correction_rounds: 2,
            sigma_floor_px: 0.003,
        }
    }
}
