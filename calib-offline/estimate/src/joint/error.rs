//! Why there is no joint estimate.

/// Why there is no estimate.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// The normal equations are singular.
    #[error("the corners do not determine the cameras: {free} parameters, {corner_count} corners")]
    Singular {
        /// Number of global parameters.
        free: usize,
        /// Number of corners.
        corner_count: usize,
    },
}
