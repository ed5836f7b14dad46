//! The default estimate: ray fields of all cameras, poses, extrinsics and board shape in one bundle
//! adjustment, with smoothness weights and noise found from the data. METHOD sections 2 and 9A.

pub mod calibrated;
pub mod choice;
pub mod correlation;
pub mod covariance;
mod error;
pub mod estimate;
pub mod evidence;
pub mod fit;
pub mod length_variance;
pub mod pinhole_lens;
pub mod pinholes;
mod places;
pub mod point_covariance;
pub mod rebase;
pub mod recheck;
pub mod refit;
mod simpler;

pub use choice::{Alternative, Choice};
pub use error::EstimateError;
pub use estimate::{Estimate, estimate};
pub use evidence::{Family, SmoothnessFound};
pub use length_variance::{Ends, LengthVariance};
pub use recheck::estimate_screened;
pub use simpler::{Simpler, SimplerEstimate};
